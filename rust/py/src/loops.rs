//! The closed loops of a batch, read from Python arguments.

use crate::arrays::{count, items};
use crate::errors::{Failure, input_error};
use crate::force::{Raised, raise};
use crate::law::Law;
use crate::plant::Plant;
use crate::run_options::{MOST_ROWS, RunOptions};
use armlet_core::law::LawSpec;
use armlet_core::memory;
use armlet_core::parallel;
use armlet_core::plant::PlantSpec;
use armlet_core::simulate::{self as core, Problem};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};

/// Read one object of the class `T`, or a list of such objects.
fn several<'py, T: pyo3::PyClass>(
    function: &str,
    name: &str,
    expected: &str,
    value: &Bound<'py, PyAny>,
) -> Result<Vec<Bound<'py, T>>, Failure> {
    let items = if value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>() {
        items(function, name, "a list", value, MOST_ROWS)?
    } else {
        vec![value.clone()]
    };
    if items.is_empty() {
        return Err(input_error(value.py(), function, name, format!("is empty: expected {expected}, got []")).into());
    }
    let wrong = |item: &Bound<'py, PyAny>, i: usize| -> Failure {
        let problem = format!(
            "is of the wrong type: expected {expected}, got {} (first bad index {i})",
            item.get_type().name().map(|name| name.to_string()).unwrap_or_default()
        );
        input_error(value.py(), function, name, problem).into()
    };
    let mut out = memory::reserved(items.len())?;
    for (i, item) in items.iter().enumerate() {
        out.push(item.cast::<T>().cloned().map_err(|_| wrong(item, i))?);
    }
    Ok(out)
}

/// Read the number of threads. The Python value None means the default.
pub fn threads_of(function: &str, value: Option<&Bound<'_, PyAny>>) -> Result<usize, Failure> {
    // The default is computed only if it is used, because it reads files of the system.
    match value {
        Some(threads) => Ok(parallel::require_threads(count(function, "threads", threads)?)?),
        None => Ok(core::default_threads()),
    }
}

/// The plants and the laws, one for all runs or one per run, and the options of the runs.
pub struct Loops<'py> {
    plants: Vec<Bound<'py, Plant>>,
    laws: Vec<Bound<'py, Law>>,
    pub given: RunOptions<'py>,
}

impl<'py> Loops<'py> {
    pub fn of(
        function: &'static str,
        plant: &Bound<'py, PyAny>,
        law: &Bound<'py, PyAny>,
        options: &Bound<'py, PyDict>,
    ) -> Result<Self, Failure> {
        Ok(Loops {
            plants: several(function, "plant", "a plant such as RigidArm, or a list of them", plant)?,
            laws: several(function, "law", "a law such as Adaptive, or a list of them", law)?,
            given: RunOptions { function, entries: options.clone() },
        })
    }

    /// The first plant.
    pub fn plant(&self) -> &PlantSpec {
        &self.plants[0].get().spec
    }

    pub fn specs(&self) -> Result<(Vec<&PlantSpec>, Vec<&LawSpec>), Failure> {
        let plants = memory::collected(self.plants.iter().map(|plant| &plant.get().spec))?;
        Ok((plants, memory::collected(self.laws.iter().map(|law| &law.get().spec))?))
    }

    /// Call `work` with the simulation problem of runs that start at `q0`, `(B, n)`, and with the number of runs `B`.
    pub fn with_problem<T>(
        &self,
        q0: &Bound<'py, PyAny>,
        work: impl FnOnce(Problem, usize, &Raised) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        let (plants, laws) = self.specs()?;
        let options = self.given.options(plants[0].n())?;
        let (rows, x0) = self.given.initial_states(&plants, q0, true)?;
        let raised = Raised::default();
        self.given.require_force()?;
        let (forces, force_frame) = self.given.forces(plants[0], laws[0], &raised)?;
        let forces = memory::collected(forces.iter())?;
        let done = work(Problem { plants, laws, x0, forces, force_frame, options, measures: None }, rows, &raised)?;
        raise(&raised)?;
        Ok(done)
    }
}
