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
use crate::dynamics::ArmAt;
use crate::error::{Error, Result};
use crate::law::Law;
use crate::linalg::gain::{AnyGain, Gain};
use crate::plant::{LoopWall, Stop, unilateral};
use crate::scalar::Real;
use crate::spatial::{Vector, Vector3};
use crate::trace::function::recorded;
use crate::trace::{Jacobian, Sym};

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
        let record = |mut forces: Forces, y: &[Sym]| {
            let mut results = vec![Sym::zero(); size];
            let wall = forces.residual(y, &mut results);
            results.extend(&forces.load);
            results.extend(wall.array());
            results
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

/// The operations of the residual `r`, with their buffers.
struct Forces<'a> {
    problem: &'a EquilibriumProblem<'a>,
    law: Box<dyn Law + Send>,
    arm: ArmAt<Sym>,
    desired: Vec<Sym>,
    x: Vec<Sym>,
    load: Vec<Sym>,
    tau: Vec<Sym>,
    stops: Vec<Stop>,
    /// The joint stiffness, or the compliance of springs that carry the load.
    elasticity: Option<AnyGain<Sym>>,
    /// The factor of the balance of motor torques.
    share: Option<AnyGain<Sym>>,
    /// Whether the springs carry the load.
    carrying: bool,
    stretch: Vec<Sym>,
    spring: Vec<Sym>,
}

impl<'a> Forces<'a> {
    fn new(problem: &'a EquilibriumProblem<'a>, motors: Motors) -> Self {
        let n = problem.plant.n();
        let zeros = |k: usize| vec![Sym::zero(); k];
        let carrying = matches!(motors, Motors::Carrying(..));
        let (elasticity, share) = match motors {
            Motors::Absent => (None, None),
            Motors::Unknown(elasticity, share) | Motors::Carrying(elasticity, share) => (Some(elasticity), Some(share)),
        };
        let built = |gain: Option<Gain>| gain.map(|gain| AnyGain::new(&gain));
        Forces {
            problem,
            law: problem.law.build(),
            arm: ArmAt::new(problem.plant.model()),
            desired: problem.law.desired(0.0),
            x: zeros(4 * n),
            load: zeros(n),
            tau: zeros(n),
            stops: problem.plant.stops().into_iter().flat_map(|stops| stops.all()).collect(),
            elasticity: built(elasticity),
            share: built(share),
            carrying,
            stretch: zeros(n),
            spring: zeros(n),
        }
    }

    /// Write the load `L(q)` to `self.load`, and return the force of the wall.
    fn load(&mut self, q: &[Sym]) -> Vector3<Sym> {
        let n = q.len();
        self.arm.move_to(q);
        self.arm.gravity(&mut self.load);
        if let Some(frame) = self.problem.frame {
            let (_, jacobian) = self.arm.jacobian(frame);
            for i in 0..n {
                for (k, &w) in self.problem.wrench.iter().enumerate() {
                    self.load[i] = jacobian[k * n + i].neg_mul_add(Sym::splat(w), self.load[i]);
                }
            }
        }
        let mut push = Vector3::zero();
        if let Some(wall) = self.problem.plant.wall() {
            let (p, jacobian) = self.arm.jacobian(wall.frame);
            push = LoopWall::new(wall).force(p, Vector3::zero(), None).0;
            for i in 0..n {
                for k in 0..3 {
                    self.load[i] = jacobian[k * n + i].neg_mul_add(push[k], self.load[i]);
                }
            }
        }
        if let Some(stops) = self.problem.plant.stops() {
            for &stop in &self.stops {
                let i = stop.joint;
                let (depth, _) = stop.depth(Sym::splat(stops.limit(stop)), q[i], Sym::zero());
                let force = unilateral::push(Sym::splat(stops.stiffness[i]), Sym::zero(), depth, Sym::zero(), None).0;
                self.load[i] += if stop.upper { force } else { -force };
            }
        }
        push
    }

    /// Write the residual `r` of the unknowns `y` to the argument `r`, and return the force of the wall. After `q`, the unknowns are the
    /// motor positions or the law's state.
    fn residual(&mut self, y: &[Sym], r: &mut [Sym]) -> Vector3<Sym> {
        let n = self.load.len();
        let (q, behind) = y.split_at(n);
        self.x[..n].copy_from_slice(q);
        let wall = self.load(q);
        let (Some(elasticity), Some(share)) = (&self.elasticity, &self.share) else {
            let (r, rate) = r.split_at_mut(n);
            self.law.evaluate(&self.desired, self.arm.trig(), &self.x[..2 * n], behind, r, rate);
            for i in 0..n {
                r[i] -= self.load[i];
            }
            return wall;
        };
        if self.carrying {
            let (r, rate) = r.split_at_mut(n);
            elasticity.multiply(&self.load, &mut self.stretch);
            for i in 0..n {
                self.x[2 * n + i] = q[i] + self.stretch[i];
            }
            self.law.evaluate(&self.desired, self.arm.trig(), &self.x, behind, &mut self.tau, rate);
            for i in 0..n {
                self.tau[i] -= self.load[i];
            }
            share.multiply(&self.tau, r);
            return wall;
        }
        self.x[2 * n..3 * n].copy_from_slice(behind);
        self.law.evaluate(&self.desired, self.arm.trig(), &self.x, &[], &mut self.tau, &mut []);
        for i in 0..n {
            self.stretch[i] = behind[i] - q[i];
        }
        elasticity.multiply(&self.stretch, &mut self.spring);
        for i in 0..n {
            r[i] = self.spring[i] - self.load[i];
            self.tau[i] -= self.spring[i];
        }
        share.multiply(&self.tau, &mut r[n..]);
        wall
    }
}
