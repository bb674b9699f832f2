//! `loop_program` returns a *program*, the recorded operations of a closed loop, as lists.

use crate::arrays::{flag, object, text};
use crate::errors::Failure;
use crate::force::Raised;
use crate::interrupts::long;
use crate::plant::Plant;
use crate::run_options::{RunOptions, law_of};
use armlet_core::simulate::{Problem, list_loop};
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};

/// Return one program of a closed loop as a dict. `armlet.loop_program` documents the options.
#[entered]
#[pyfunction]
#[arguments(plant, law, options)]
pub fn loop_program<'py>(options: &Bound<'py, PyDict>) -> Result<Bound<'py, PyDict>, Failure> {
    let plant = object::<Plant>(NAME, "plant", "a plant such as RigidArm", plant)?;
    let plant = &plant.get().spec;
    let raised = Raised::default();
    let law = &law_of(NAME, law, plant, &raised)?;
    let given = RunOptions { function: NAME, entries: options.clone() };
    let options = given.options(plant.n())?;
    given.require_force()?;
    let (force, force_frame) = given.force(plant, law, &raised)?;
    let batch = flag(NAME, "batch", &given.required("batch")?)?;
    let part = given.get("part")?.map(|part| text(NAME, "part", &part)).transpose()?;
    let x0 = vec![0.0; plant.states()];
    let problem =
        Problem { plants: vec![plant], laws: vec![law], x0, forces: force.iter().collect(), force_frame, options, measures: None };
    let listed = long(py, || list_loop(&problem, batch, part.as_deref()))?;
    let fields = PyDict::new(py);
    fields.set_item("part", listed.part)?;
    let parts = PyDict::new(py);
    for (name, operations) in listed.parts {
        parts.set_item(name, operations)?;
    }
    fields.set_item("parts", parts)?;
    fields.set_item("engine", listed.engine)?;
    fields.set_item("set", listed.set)?;
    fields.set_item("lanes", listed.lanes)?;
    fields.set_item("code_bytes", listed.size.map(|(bytes, _)| bytes))?;
    fields.set_item("spilled", listed.size.map(|(_, spilled)| spilled))?;
    fields.set_item("inputs", listed.inputs.into_iter().map(|((name, kind), value)| (name, kind, value)).collect::<Vec<_>>())?;
    let stages = PyDict::new(py);
    for (stage, listing) in listed.stages {
        let lines = PyList::empty(py);
        for line in listing.lines {
            lines.append((line.to, line.kind, PyTuple::new(py, line.operands)?))?;
        }
        stages.set_item(stage, (lines, listing.outputs))?;
    }
    fields.set_item("stages", stages)?;
    Ok(fields)
}
