//! The residual of an arm at rest, as a recorded function.
//!
//! The load of the joints is `L(q) = g(q) - J'F - contacts`, with the gravity torque `g`, the external wrench `F` and the transpose `J'`.
//! At rest, a law of the links has the output `u(q)`, and a law of motors has the output `tau(q, theta)`. The residual `r` of the unknowns
//! `y` is
//!
//! `r(q) = u(q) - L(q)`, or `r(q, theta) = [K (theta - q) - L(q), (I + Kt)^-1 (tau(q, theta) - K (theta - q))]`.
//!
//! `K` is the joint stiffness, and `Kt` the torque gain of the law. A law may reduce the motor inertia `B` to `B0` and depend on `theta`.
//! Then the springs carry the load, and `q` is the only unknown:
//!
//! `r(q) = B0 B^-1 (tau(q, theta) - L(q))`, `theta = q + K^-1 L(q)`.

use super::recordings::{EquilibriumProblem, Function, Motors, jacobian};
use crate::error::{Error, Result};
use crate::law::{Answer, RecordedLaw};
use crate::plant::{LoopWall, Parameters, unilateral};
use crate::scalar::Real;
use crate::spatial::{Vector, Vector3};
use crate::trace::expression::{constant, stacked, vector, zeros};
use crate::trace::function::recorded;
use crate::trace::{E, Jacobian, V, sym};

/// The recorded residual `r(y)`. Its results are the residual, then the load `L(q)`, then the force of the wall.
pub(super) struct Residual {
    function: Jacobian,
    size: usize,
}

impl Residual {
    pub fn new(problem: &EquilibriumProblem, motors: Motors) -> Result<Self> {
        let n = problem.plant.n();
        let size = match motors {
            Motors::Unknown(..) => 2 * n,
            Motors::Absent | Motors::Carrying(..) => n + problem.law.initial_state().len(),
        };
        let record = |forces: Forces, y: &[E]| {
            let (load, wall) = sym::contract(|| forces.load(&vector(&y[..n])));
            let residual = sym::contract(|| forces.residual(y, &load));
            stacked([&residual, &load, &vector(&wall.array())]).as_slice().to_vec()
        };
        let function = Function::Residual(motors.clone());
        match jacobian(problem, function, || recorded(size, || Forces::new(problem, motors), record).map(|recorded| (recorded, size))) {
            Some(function) => Ok(Residual { function, size }),
            None => Err(Error::input("law", format!("branches on its data: expected an impedance or PD law, got {}", problem.law.name()))),
        }
    }

    /// The residual at `y`.
    pub fn at(&mut self, y: &[f64]) -> &[f64] {
        &self.function.value(y)[..self.size]
    }

    /// The residual at `y`, the load `L(q)` and the force of the wall.
    pub fn with_load(&mut self, y: &[f64]) -> (&[f64], &[f64], [f64; 3]) {
        let (residual, forces) = self.function.value(y).split_at(self.size);
        let (load, wall) = forces.split_at(forces.len() - 3);
        (residual, load, [wall[0], wall[1], wall[2]])
    }

    /// Call `put(i, j, dr_i/dy_j)` for all entries of the derivative of the residual, column by column.
    pub fn slopes(&mut self, y: &[f64], put: impl FnMut(usize, usize, f64)) {
        self.function.slopes(y, put);
    }

    /// The symmetric part of `-dr/dy`.
    pub fn hessian(&mut self, y: &[f64]) -> Vec<f64> {
        let n = y.len();
        let mut h = vec![0.0; n * n];
        self.slopes(y, |i, j, rate| {
            h[i * n + j] -= 0.5 * rate;
            h[j * n + i] -= 0.5 * rate;
        });
        h
    }
}

/// The equations of the residual `r`.
struct Forces<'a> {
    problem: &'a EquilibriumProblem<'a>,
    law: RecordedLaw<'a>,
    numbers: Parameters,
    desired: Vec<E>,
    /// Whether the springs carry the load.
    carrying: bool,
}

impl<'a> Forces<'a> {
    fn new(problem: &'a EquilibriumProblem<'a>, motors: Motors) -> Self {
        let law = RecordedLaw::continuous(problem.law);
        let carrying = matches!(motors, Motors::Carrying(..));
        let numbers = Parameters::of_arm(problem.plant.model());
        let numbers = match motors {
            Motors::Absent => numbers,
            // The joint stiffness, or the compliance of springs that carry the load; then the factor of the balance of motor torques.
            Motors::Unknown(elasticity, share) | Motors::Carrying(elasticity, share) => {
                numbers.gain("elasticity", &elasticity).gain("share", &share)
            }
        };
        Forces { problem, law, numbers, desired: problem.law.desired(0.0), carrying }
    }

    /// The load `L(q)`, and the force of the wall.
    fn load(&self, q: &V) -> (V, Vector3<E>) {
        let Some(arm) = self.numbers.arm_at(q) else { unreachable!("the residual has an arm") };
        let mut load = arm.gravity();
        if let Some(frame) = self.problem.frame {
            load -= arm.jacobian(frame).1.tr_mul(&vector(&self.problem.wrench.map(constant)));
        }
        let mut push = Vector3::zero();
        if let Some(wall) = self.problem.plant.wall() {
            let (p, j) = arm.jacobian(wall.frame);
            push = LoopWall::new(wall).force(p, Vector3::zero(), None).0;
            load -= j.rows(0, 3).tr_mul(&push);
        }
        if let Some(stops) = self.problem.plant.stops() {
            for stop in stops.all() {
                let i = stop.joint;
                let (depth, _) = stop.depth(constant(stops.limit(stop)), q[i], E::zero());
                let force = unilateral::push(constant(stops.stiffness[i]), E::zero(), depth, E::zero(), None).0;
                load[i] += if stop.upper { force } else { -force };
            }
        }
        (load, push)
    }

    /// The residual `r` of the unknowns `y` under the load `L(q)`. After `q`, the unknowns are the motor positions or the law's state.
    fn residual(&self, y: &[E], load: &V) -> V {
        let n = load.len();
        let (q, behind) = (vector(&y[..n]), &y[n..]);
        // The links and the motors at the positions `theta` are at rest.
        let answer = |theta: &V, z: &[E]| self.law.answer(&self.desired, stacked([&q, &zeros(n), theta, &zeros(n)]).as_slice(), z);
        if !self.numbers.has("elasticity") {
            let Answer { tau, z_dot, .. } = self.law.answer(&self.desired, stacked([&q, &zeros(n)]).as_slice(), behind);
            return stacked([&(tau - load), &z_dot]);
        }
        let (elasticity, share) = (self.numbers.get_gain("elasticity"), self.numbers.get_gain("share"));
        if self.carrying {
            let theta = &q + elasticity * load;
            let Answer { tau, z_dot, .. } = answer(&theta, behind);
            return stacked([&(share * &(tau - load)), &z_dot]);
        }
        let theta = vector(behind);
        let spring = elasticity * &(&theta - &q);
        stacked([&(&spring - load), &(share * &(answer(&theta, &[]).tau - &spring))])
    }
}
