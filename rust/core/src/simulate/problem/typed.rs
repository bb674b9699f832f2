//! Problems of one run, with the types of nalgebra.

use super::bound::DEFAULT_STATE_LIMIT;
use super::times::Times;
use super::{Options, Problem};
use crate::error::{Error, Result};
use crate::integrate::Method;
use crate::law::LawSpec;
use crate::plant::PlantSpec;
use nalgebra::DVector;

impl Options {
    /// Return options for RK4 with steps of `dt`, s, up to `t_end`, s. The law is evaluated in every stage. Every step has a record with
    /// monitors.
    pub fn fixed(t_end: f64, dt: f64) -> Self {
        Options { dt: Some(dt), method: Method::Rk4, ..Options::adaptive(t_end) }
    }

    /// Return options for Dormand and Prince's method of order 5 up to `t_end`, s. The relative tolerance is 1e-8, the absolute tolerance
    /// 1e-10. Every step has a record with monitors.
    pub fn adaptive(t_end: f64) -> Self {
        Options {
            t_end,
            dt: None,
            method: Method::Dopri5,
            rtol: 1e-8,
            atol: 1e-10,
            max_step: None,
            sampling: None,
            times: Times::Every(1),
            tau_max: None,
            monitors: true,
            state_limit: DEFAULT_STATE_LIMIT,
        }
    }
}

impl<'a> Problem<'a> {
    /// Return one run from the joint positions `q0`, rad or m, and velocities `v0`, rad/s or m/s, shape `(n,)` each. In an elastic plant,
    /// the springs carry the gravity load at the start, and the motors move with the links. A velocity-controlled plant requires `v0 = 0`.
    /// Errors: [`Error::WrongShape`] for a wrong length, [`Error::Input`] for a velocity of a velocity-controlled plant.
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

    /// Return one run from rest at the joint positions `q0`, shape `(n,)`, rad or m. Errors: [`Error::WrongShape`] for a wrong length.
    pub fn from_rest(plant: &'a PlantSpec, law: &'a LawSpec, q0: &DVector<f64>, options: Options) -> Result<Self> {
        Problem::new(plant, law, q0, &DVector::zeros(plant.n()), options)
    }
}
