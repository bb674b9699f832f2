//! One run on nalgebra's types: its options, its start, its records as matrices.

use super::{DEFAULT_STATE_LIMIT, Method, Options, Problem, Run, Times, simulate};
use crate::error::{Error, Result};
use crate::law::LawSpec;
use crate::plant::PlantSpec;
use nalgebra::{DMatrixView, DVector};
use std::sync::atomic::AtomicBool;

impl Options {
    /// Steps of `dt` seconds by RK4 up to `t_end`, the law in every stage, every step recorded, with monitors.
    pub fn fixed(t_end: f64, dt: f64) -> Self {
        Options { dt: Some(dt), method: Method::Rk4, ..Options::adaptive(t_end) }
    }

    /// Steps by Dormand and Prince's method of order 5 up to `t_end`, relative tolerance 1e-8, absolute tolerance 1e-10, every step
    /// recorded, with monitors.
    pub fn adaptive(t_end: f64) -> Self {
        Options {
            t_end,
            dt: None,
            method: Method::Dopri5,
            rtol: 1e-8,
            atol: 1e-10,
            sampling: None,
            times: Times::Every(1),
            tau_max: None,
            monitors: true,
            state_limit: DEFAULT_STATE_LIMIT,
        }
    }
}

impl<'a> Problem<'a> {
    /// One run from the joint positions `q0` `(n,)` and velocities `v0` `(n,)`. An elastic plant starts with its springs at rest, a
    /// velocity-controlled one takes `v0 = 0`.
    pub fn new(plant: &'a PlantSpec, law: &'a LawSpec, q0: &DVector<f64>, v0: &DVector<f64>, options: Options) -> Result<Self> {
        let n = plant.n();
        for (name, value) in [("q0", q0), ("v0", v0)] {
            if value.len() != n {
                return Err(Error::wrong_shape(name, &[n], &[value.len()]));
            }
        }
        if !plant.kind().has_speeds() && v0.iter().any(|v| *v != 0.0) {
            let problem = format!("is not a state of the plant: expected zeros for {}", plant.kind().name());
            return Err(Error::input("v0", problem));
        }
        let x0 = plant.initial_state(q0.as_slice(), v0.as_slice(), None, None);
        Ok(Problem { plants: vec![plant], laws: vec![law], x0, forces: Vec::new(), force_frame: None, options, measures: None })
    }

    /// One run from rest at `q0` `(n,)`.
    pub fn from_rest(plant: &'a PlantSpec, law: &'a LawSpec, q0: &DVector<f64>, options: Options) -> Result<Self> {
        Problem::new(plant, law, q0, &DVector::zeros(plant.n()), options)
    }

    /// Run it on the calling thread. How the run ended is [`Run::status`]; errors are those of the arguments.
    pub fn run(&self) -> Result<Run> {
        simulate(self, &AtomicBool::new(false))
    }
}

impl Run {
    /// `(n, K)`: column `k` holds `q` at time `t[k]`.
    pub fn positions(&self) -> DMatrixView<'_, f64> {
        self.columns(&self.q)
    }

    /// `(n, K)`: column `k` holds `v` at time `t[k]`.
    pub fn velocities(&self) -> DMatrixView<'_, f64> {
        self.columns(&self.v)
    }

    /// `(n, K)`: column `k` holds the input of the plant from time `t[k]` on.
    pub fn inputs(&self) -> DMatrixView<'_, f64> {
        self.columns(&self.tau)
    }

    /// The series of a monitor, `(K,)`; `None` where the run has none of that name.
    pub fn monitor(&self, name: &str) -> Option<&[f64]> {
        self.monitors.iter().find(|(known, _)| *known == name).map(|(_, series)| series.as_slice())
    }

    /// Time is the first axis of a series, so that its records are the columns of a matrix.
    fn columns<'a>(&self, series: &'a [f64]) -> DMatrixView<'a, f64> {
        let records = self.t.len();
        DMatrixView::from_slice(series, series.len().checked_div(records).unwrap_or(0), records)
    }
}
