//! The torque of dry friction at recorded states.

use super::recorded::function_of;
use super::{LoopStickSlip, PlantSpec};
use crate::trace::by_engine::{Evaluator, SharedFunction};
use crate::trace::form;
use crate::trace::function::Evaluation;
use crate::trace::rows::Rows;
use std::sync::Arc;

/// States of a plant and its input at `K` records, `(K, n)` each. `theta` and `theta_dot` are empty for a plant without motors, and
/// `bristles` is empty for a plant without bristles.
#[derive(Clone, Copy, Debug)]
pub struct Rubbed<'a> {
    /// Positions of the links, rad or m.
    pub q: &'a [f64],
    /// Velocities of the links, rad/s or m/s.
    pub v: &'a [f64],
    /// Positions of the motors, rad or m.
    pub theta: &'a [f64],
    /// Velocities of the motors, rad/s or m/s.
    pub theta_dot: &'a [f64],
    /// Deflections of the bristles, rad or m.
    pub bristles: &'a [f64],
    /// Inputs of the plant, N m or N.
    pub tau: &'a [f64],
}

/// Stick-slip friction. Native code decides its modes from the recorded loads.
#[derive(Clone)]
struct Sticking {
    friction: LoopStickSlip<f64>,
    /// The index in the state of the first speed.
    first: usize,
    /// The numbers of [`LoopStickSlip::loads`], one row per lane.
    loads: Vec<f64>,
    a: Vec<f64>,
}

/// The computation of the friction torques of one plant.
#[derive(Clone)]
pub struct FrictionTorque {
    n: usize,
    /// A function of the state, the input and the wrench, with one record per lane. Its results are the friction torques, or the numbers of
    /// [`LoopStickSlip::loads`].
    evaluation: Evaluator,
    /// The stick-slip friction; `None` for friction with bristles.
    sticking: Option<Sticking>,
}

impl FrictionTorque {
    /// Create the computation for about `records` records; `None` for a plant without a `JointFriction`. Wrenches act at `force_frame`.
    pub fn of(plant: &PlantSpec, force_frame: Option<usize>, records: usize) -> Option<Self> {
        let n = plant.n();
        plant.friction()?;
        let recorded = function_of(plant, force_frame, |recorded, at| {
            if plant.sticks() {
                let friction = recorded.stick_slip(at.x, &at.tau, at.wrench);
                return friction.map_or(Vec::new(), |(friction, _)| friction.loads());
            }
            recorded.rates(at.x, &at.tau, at.wrench).friction.map_or(Vec::new(), |friction| friction.as_slice().to_vec())
        });
        let lanes = form(true).lanes();
        let values = recorded.values.clone();
        let evaluation = Evaluator::new(Arc::new(SharedFunction::new(recorded, true)), &values).expecting(records / lanes);
        let sticking = plant.sticking_friction().map(|(friction, first)| {
            let loads = vec![0.0; lanes * friction.loads().len()];
            Sticking { friction, first, loads, a: vec![0.0; n] }
        });
        Some(FrictionTorque { n, evaluation, sticking })
    }

    /// Compute the friction torques of `K` records, `(K, n)`, N m or N, under the wrenches `wrench(k)`.
    pub fn series(&mut self, records: &Rubbed, wrench: impl Fn(usize) -> [f64; 6], out: &mut [f64]) {
        let (n, lanes, count) = (self.n, self.evaluation.lanes(), out.len() / self.n.max(1));
        let parts = [records.q, records.v, records.theta, records.theta_dot, records.bristles, records.tau];
        let parts = parts.map(|numbers| Rows { numbers, width: if numbers.is_empty() { 0 } else { n } });
        let width: usize = parts.iter().map(|rows| rows.width).sum();
        for at in (0..count).step_by(lanes) {
            self.evaluation.read(&parts, at);
            let wrenches = &mut self.evaluation.inputs()[width * lanes..];
            for lane in 0..lanes {
                let wrench = wrench((at + lane).min(count - 1));
                wrench.iter().enumerate().for_each(|(k, &number)| wrenches[k * lanes + lane] = number);
            }
            self.evaluation.run();
            let end = (at + lanes).min(count);
            let out = &mut out[at * n..end * n];
            match &mut self.sticking {
                None => _ = self.evaluation.last().write(0, n, out),
                Some(sticking) => sticking.compute(self.evaluation.last(), &parts[sticking.first / n].numbers[at * n..end * n], out),
            }
        }
    }

    /// The modes of the joints with stick-slip friction at the state `x`, the input `tau` and the wrench (see [`LoopStickSlip::sides`]).
    /// The result is `None` for friction with bristles.
    pub fn sides(&mut self, x: &[f64], tau: &[f64], wrench: &[f64; 6]) -> Option<Vec<i8>> {
        let rows = [x, tau, wrench].map(|numbers| Rows { numbers, width: numbers.len() });
        self.evaluation.read(&rows, 0);
        self.evaluation.run();
        let sticking = self.sticking.as_mut()?;
        sticking.compute(self.evaluation.last(), &x[sticking.first..sticking.first + self.n], &mut vec![0.0; self.n]);
        Some(sticking.friction.sides().to_vec())
    }
}

impl Sticking {
    /// Compute the friction torques from the loads in the first lanes of `evaluation`. `v` has the speeds of these lanes.
    fn compute(&mut self, evaluation: &Evaluation, v: &[f64], out: &mut [f64]) {
        let n = self.a.len();
        let size = n * n + 2 * n;
        let loads = &mut self.loads[..out.len() / n * size];
        evaluation.write(0, size, loads);
        for ((loads, v), out) in loads.chunks_exact(size).zip(v.chunks_exact(n)).zip(out.chunks_exact_mut(n)) {
            self.friction.set_loads(loads);
            self.friction.settle(v, None);
            self.friction.slide(v);
            self.friction.hold(&mut self.a);
            // The sum with zero makes negative zeros positive.
            out.iter_mut().zip(self.friction.torque()).for_each(|(out, torque)| *out = torque + 0.0);
        }
    }
}
