//! The torque of dry friction at recorded states.

use super::lugre::LoopLuGre;
use super::recorded::{Arguments, function_of};
use super::rigid::loop_bristles;
use super::{LoopStickSlip, Plant, PlantSpec};
use crate::linalg::gain::AnyGain;
use crate::scalar::labelled_numbers;
use crate::trace::Sym;
use crate::trace::form;
use crate::trace::function::{Evaluation, Recorded};
use crate::trace::rows::Rows;

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

/// Springs and dampers of elastic joints, whose torque loads the motors.
struct Joints {
    stiffness: AnyGain<Sym>,
    damping: Vec<Sym>,
}

/// Friction with bristles, whose torque is a function of state and input.
struct Bristles {
    friction: LoopLuGre,
    joints: Option<Joints>,
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

/// The compilation takes about as long as this number of interpreted evaluations, with one record per lane.
const REPAYS: usize = 256;

/// The computation of the friction torques of one plant.
#[derive(Clone)]
pub struct FrictionTorque {
    n: usize,
    /// A function of the state, the input and the wrench, with one record per lane. Its results are the friction torques, or the numbers of
    /// [`LoopStickSlip::loads`].
    recorded: Recorded,
    evaluation: Evaluation,
    /// The stick-slip friction; `None` for friction with bristles.
    sticking: Option<Sticking>,
}

impl FrictionTorque {
    /// Create the computation for about `records` records; `None` for a plant without a `JointFriction`. Wrenches act at `force_frame`.
    pub fn of(plant: &PlantSpec, force_frame: Option<usize>, records: usize) -> Option<Self> {
        let n = plant.n();
        plant.friction()?;
        let torques = |bristles: Option<Bristles>, at: &Arguments| bristles.map_or(Vec::new(), |bristles| bristles.torques(at));
        let loads = |mut plant: Box<dyn Plant + Send>, at: &Arguments| {
            plant.load_friction(&at.trig, at.x, at.tau, at.wrench);
            plant.stick_slip().map_or(Vec::new(), |(friction, _)| friction.loads())
        };
        let recorded = match plant.sticks() {
            true => function_of(plant, || plant.build(force_frame), loads),
            false => function_of(plant, || Bristles::of(plant), torques),
        };
        let lanes = form(true).lanes();
        let evaluation = if records < REPAYS * lanes { recorded.clone().interpreted(true) } else { recorded.clone().program(true) };
        let sticking = plant.sticking_friction().map(|(friction, first)| {
            let loads = vec![0.0; lanes * friction.loads().len()];
            Sticking { friction, first, loads, a: vec![0.0; n] }
        });
        Some(FrictionTorque { n, recorded, evaluation, sticking })
    }

    /// Compute the friction torques of `K` records, `(K, n)`, N m or N, under the wrenches `wrench(k)`.
    pub fn series(&mut self, records: &Rubbed, wrench: impl Fn(usize) -> [f64; 6], out: &mut [f64]) {
        let (n, lanes, count) = (self.n, self.evaluation.lanes(), out.len() / self.n.max(1));
        let parts = [records.q, records.v, records.theta, records.theta_dot, records.bristles, records.tau];
        let parts = parts.map(|numbers| Rows { numbers, width: if numbers.is_empty() { 0 } else { n } });
        let width = parts.iter().map(|rows| rows.width).sum();
        for at in (0..count).step_by(lanes) {
            self.evaluation.read(&parts, at);
            let wrenches = self.evaluation.inputs(width, 6);
            for lane in 0..lanes {
                let wrench = wrench((at + lane).min(count - 1));
                wrench.iter().enumerate().for_each(|(k, &number)| wrenches[k * lanes + lane] = number);
            }
            self.run();
            let end = (at + lanes).min(count);
            let out = &mut out[at * n..end * n];
            match &mut self.sticking {
                None => _ = self.evaluation.write(0, n, out),
                Some(sticking) => sticking.compute(&self.evaluation, &parts[sticking.first / n].numbers[at * n..end * n], out),
            }
        }
    }

    /// The modes of the joints with stick-slip friction at the state `x`, the input `tau` and the wrench (see [`LoopStickSlip::sides`]).
    /// The result is `None` for friction with bristles.
    pub fn sides(&mut self, x: &[f64], tau: &[f64], wrench: &[f64; 6]) -> Option<Vec<i8>> {
        let rows = [x, tau, wrench].map(|numbers| Rows { numbers, width: numbers.len() });
        self.evaluation.read(&rows, 0);
        self.run();
        let sticking = self.sticking.as_mut()?;
        sticking.compute(&self.evaluation, &x[sticking.first..sticking.first + self.n], &mut vec![0.0; self.n]);
        Some(sticking.friction.sides().to_vec())
    }

    /// Evaluate the recorded function for the present inputs. After an angle for which machine code is not valid, the interpreter
    /// continues.
    fn run(&mut self) {
        self.evaluation.run();
        if (0..self.evaluation.lanes()).any(|lane| !self.evaluation.is_near(lane)) {
            let inputs = self.evaluation.all_inputs().to_vec();
            self.evaluation = self.recorded.clone().interpreted(true);
            self.evaluation.all_inputs().copy_from_slice(&inputs);
            self.evaluation.run();
        }
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

impl Bristles {
    fn of(plant: &PlantSpec) -> Option<Self> {
        let joints = plant.elastic().map(|elastic| Joints {
            stiffness: AnyGain::new(&elastic.stiffness),
            damping: labelled_numbers("joint_damping", &elastic.joint_damping),
        });
        Some(Bristles { friction: loop_bristles(plant.friction())?, joints })
    }

    /// Friction torques, `(n,)`, N m or N.
    fn torques(&self, at: &Arguments) -> Vec<Sym> {
        let n = at.tau.len();
        let z = &at.x[at.x.len() - n..];
        let (loads, rates) = match &self.joints {
            None => ((0..n).map(|i| at.tau[i] - self.friction.spring(i, z[i])).collect(), &at.x[n..2 * n]),
            Some(joints) => (joints.torques(at.x, n), &at.x[3 * n..4 * n]),
        };
        (0..n).map(|i| self.friction.rub(i, rates[i], z[i], loads[i]).torque).collect()
    }
}

impl Joints {
    /// Joint torques at the state `x` of a plant with `n` joints, `(n,)`, N m or N.
    fn torques(&self, x: &[Sym], n: usize) -> Vec<Sym> {
        let stretch: Vec<Sym> = (0..n).map(|i| x[2 * n + i] - x[i]).collect();
        let mut torques = stretch.clone();
        self.stiffness.multiply(&stretch, &mut torques);
        for i in 0..n {
            torques[i] += self.damping[i] * (x[3 * n + i] - x[n + i]);
        }
        torques
    }
}
