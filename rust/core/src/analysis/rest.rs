//! The torques on an arm at rest, and the search for an equilibrium.
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
//!
//! For a law with a potential, `r` is minus its gradient. Then Newton's
//! method, with the absolute values of the eigenvalues of `-dr/dy`, descends to a minimum of the potential.
//!
//! A law with a null space, an integral or limits has no potential. Its unknowns `y = [q, w]` include its integral `w`. The search
//! integrates `M q_dot = r`, `w_dot = K_i e` in time until the equilibrium is reached (pseudo-transient continuation). Each implicit step
//! `d` solves `(diag(M, 1)/h - dr/dy) d = r`, with a step size `h` that grows.

use crate::dynamics::ArmAt;
use crate::error::{Error, Result, finite};
use crate::interrupt::look;
use crate::law::{Law, LawSpec};
use crate::linalg::gain::{AnyGain, Gain};
use crate::linalg::symmetric_eigen;
use crate::plant::{LoopWall, PlantSpec, Stop, unilateral};
use crate::scalar::{Dual, Real};
use crate::spatial::{Vector, Vector3};
use crate::status::Status;
use nalgebra::{DMatrix, DVector};

/// A plant at rest, with its law and an external wrench.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// use armlet_core::analysis::rest::Rest;
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let plant = PlantSpec::from(RigidSpec::new(model.clone()));
///
/// let law = LawSpec::from(PdGravitySpec::new(model, vec![0.5], Gain::scalar("kp", 1, 20.0)?, Gain::scalar("kd", 1, 4.0)?)?);
/// let rest = Rest { plant: &plant, law: &law, wrench: [0.0; 6], frame: None };
/// assert!((rest.load(&[0.3]).0[0] - 5.0 * 0.3f64.sin()).abs() < 1e-12);
/// let mut q = vec![0.0];
/// rest.descend(&mut q)?;
/// assert!((q[0] - 0.5).abs() < 1e-9);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct Rest<'a> {
    /// The plant.
    pub plant: &'a PlantSpec,
    /// A law of the links, or a law of motors.
    pub law: &'a LawSpec,
    /// External wrench `[f; m]`, N and N m, world axes.
    pub wrench: [f64; 6],
    /// Index of the frame at which the wrench acts; `None` for no wrench.
    pub frame: Option<usize>,
}

/// The motor positions in the residual, and the factor of the balance of motor torques.
enum Motors {
    /// The law does not depend on them.
    Absent,
    /// They are unknowns: the joint stiffness `K`, and the factor `(I + Kt)^-1`.
    Unknown(Gain, Gain),
    /// The springs carry the load: the compliance `K^-1`, and the factor.
    Carrying(Gain, Gain),
}

impl Rest<'_> {
    /// The motor positions in the search for an equilibrium.
    fn motors(&self) -> Motors {
        let Some(plant) = self.plant.elastic() else { return Motors::Absent };
        match (self.law.torque_share(), self.law.reduction()) {
            (Some(share), _) => Motors::Unknown(plant.stiffness.clone(), share),
            (None, Some(reduction)) => {
                Motors::Carrying(plant.stiffness.inverse(), reduction.reduced_inertia.product(&reduction.motor_inertia.inverse()))
            }
            (None, None) => Motors::Absent,
        }
    }

    /// Compute the unbalanced torque `tau(q, theta) - L(q)`, `(n,)`, N m or N, at the state `integral` of the law. `theta` are the motor
    /// positions whose springs carry the load. Also return whether this torque and the rate of the law's state are zero.
    ///
    /// A torque counts as zero if a relative change of all positions by `ROUNDING` could cause it.
    pub fn unbalanced(&self, q: &[f64], integral: &[f64]) -> (Vec<f64>, bool) {
        const ROUNDING: f64 = 1e-10;
        let n = q.len();
        let motors = || match self.plant.elastic() {
            Some(plant) => Motors::Carrying(plant.stiffness.inverse(), Gain::unchecked(n, vec![1.0; n])),
            None => Motors::Absent,
        };
        let (mut here, mut slope) = (Forces::<f64>::new(self, motors()), Forces::<Dual>::new(self, motors()));
        let y = [q, integral].concat();
        let mut r = vec![0.0; y.len()];
        here.residual(&y, &mut r);
        let mut scale: Vec<f64> = (0..y.len()).map(|i| here.load.get(i).map_or(0.0, |load| load.abs())).collect();
        slopes(&mut slope, &y, |i, j, rate| scale[i] += (rate * (1.0 + y[j].abs())).abs());
        let balanced = r.iter().zip(&scale).all(|(r, scale)| r.abs() <= ROUNDING * scale);
        r.truncate(n);
        (r, balanced)
    }

    /// Compute the load of the joints `L(q)`, `(n,)`, N m or N, and the force of the wall, `(3,)`, N.
    pub fn load(&self, q: &[f64]) -> (Vec<f64>, [f64; 3]) {
        let mut forces = Forces::<f64>::new(self, Motors::Absent);
        let wall = forces.load(q);
        (forces.load, wall.array())
    }

    /// Move `q` to the equilibrium of a law without a potential, by pseudo-transient continuation. The law's integral is appended to `q`,
    /// unless `q` already contains its start.
    /// Errors: `Solve` if no equilibrium is found, `Input` after an overflow.
    pub fn settle(&self, q: &mut Vec<f64>) -> Result<()> {
        const STEPS: usize = 1000;
        /// The largest motion of a joint in one step, rad or m. A longer step is repeated with a smaller `h`.
        const REACH: f64 = 0.3;
        /// The largest product of `h` and the fastest rate. It prevents rounding errors from growing along directions without stiffness.
        const LONGEST: f64 = 1e8;
        let n = self.plant.n();
        q.extend(&self.law.initial_state()[q.len() - n..]);
        let (y, size) = (q, n + self.law.initial_state().len());
        let (mut here, mut slope) = (Forces::<f64>::new(self, self.motors()), Forces::<Dual>::new(self, self.motors()));
        let (mut r, mut mass, mut best) = (vec![0.0; size], vec![0.0; n * n], f64::INFINITY);
        let mut h = 0.0f64;
        for _ in 0..STEPS {
            look();
            here.residual(y, &mut r);
            finite("equilibrium", &r)?;
            here.arm.mass_matrix(&mut mass);
            let mut rates = DMatrix::<f64>::zeros(size, size);
            let mut inertia = DMatrix::<f64>::identity(size, size);
            slopes(&mut slope, y, |i, j, rate| rates[(i, j)] = rate);
            (0..n * n).for_each(|at| inertia[(at / n, at % n)] = mass[at]);
            let fastest = rates.amax() / inertia.diagonal().amin();
            let longest_step = LONGEST / fastest.max(f64::MIN_POSITIVE);
            h = if h == 0.0 { 1.0 / fastest.max(1.0) } else { h.min(longest_step) };
            let force = DVector::from_column_slice(&r);
            let step = loop {
                let step = (&inertia / h - &rates).lu().solve(&force).filter(|step| step.iter().all(|x| x.is_finite()));
                let long = step.as_ref().is_none_or(|step| step.rows(0, n).amax() > REACH);
                match step {
                    Some(step) if !long => break step,
                    _ if h * fastest < 1e-12 => return Err(no_rest(STEPS)),
                    _ => h *= 0.25,
                }
            };
            y.iter_mut().zip(step.iter()).for_each(|(y, step)| *y += step);
            let (longest, close) = (step.amax(), 1.0 + crate::linalg::largest(y));
            let settled = h >= longest_step && longest <= 1e-9 * close && longest >= best;
            if settled || (h >= longest_step && longest <= 1e-15 * close) {
                return Ok(());
            }
            best = if h >= longest_step { longest } else { f64::INFINITY };
            h *= 2.0;
        }
        Err(no_rest(STEPS))
    }

    /// Move `q` to an equilibrium by Newton steps towards a smaller potential. For a law of motors, the motor positions are appended to
    /// `q`. Errors: as for [`Rest::settle`].
    pub fn descend(&self, q: &mut Vec<f64>) -> Result<()> {
        const STEPS: usize = 500;
        /// The largest motion of a joint in one step, rad or m. A longer step could leave the basin of the equilibrium.
        const REACH: f64 = 0.3;
        /// The smallest eigenvalue, relative to the largest, that counts. A direction with a smaller eigenvalue is a free motion of a
        /// redundant arm. The rounding error of `dr/dq` is 1e-15.
        const FLAT: f64 = 1e-9;
        if let Motors::Unknown(stiffness, _) = self.motors() {
            let stretch = stiffness.inverse().times(&self.load(q).0);
            let theta: Vec<f64> = q.iter().zip(stretch).map(|(q, s)| q + s).collect();
            q.extend(theta);
        }
        let y = q;
        let n = y.len();
        let (mut here, mut slope) = (Forces::<f64>::new(self, self.motors()), Forces::<Dual>::new(self, self.motors()));
        let (mut r, mut ahead, mut trial) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let mut best = f64::INFINITY;
        for _ in 0..STEPS {
            here.residual(y, &mut r);
            finite("equilibrium", &r)?;
            let (values, vectors) = symmetric_eigen(&hessian(&mut slope, y), n)?;
            let stiffest = values.iter().fold(0.0f64, |most, l| most.max(l.abs()));
            let mut step = vec![0.0; n];
            for (l, u) in values.iter().zip(vectors.chunks_exact(n)) {
                if l.abs() > FLAT * stiffest {
                    crate::linalg::axpy(crate::linalg::dot(u, &r) / l.abs(), u, &mut step);
                }
            }
            let longest = crate::linalg::largest(&step);
            let close = 1.0 + crate::linalg::largest(y);
            // The search has converged up to rounding, or makes no further progress.
            if longest <= 1e-15 * close || (longest <= 1e-9 * close && longest >= best) {
                return Ok(());
            }
            best = longest;
            let mut size = (REACH / longest).min(1.0);
            loop {
                for i in 0..n {
                    trial[i] = y[i] + size * step[i];
                }
                here.residual(&trial, &mut ahead);
                // The work of the residual `r` along the step, by the trapezoidal rule. `r` decreases towards the equilibrium, and changes
                // its sign beyond the equilibrium. So a step with negative work is too long.
                let work: f64 = (0..n).map(|i| step[i] * (r[i] + ahead[i])).sum();
                if work >= 0.0 || size < 1e-12 || longest < 1e-7 * close {
                    break;
                }
                size *= 0.5;
            }
            y.copy_from_slice(&trial);
        }
        Err(no_rest(STEPS))
    }
}

fn no_rest(steps: usize) -> Error {
    Error::Solve { status: Status::MaxSteps, t: steps as f64, problem: "no rest was found: the descent did not end".into() }
}

/// The residual `r` on the number type `S`, with its buffers.
struct Forces<'a, S: Real> {
    rest: &'a Rest<'a>,
    law: Box<dyn Law<S> + Send>,
    arm: ArmAt<S>,
    desired: Vec<S>,
    x: Vec<S>,
    load: Vec<S>,
    tau: Vec<S>,
    stops: Vec<Stop>,
    /// The joint stiffness, or the compliance of springs that carry the load.
    elasticity: Option<AnyGain<S>>,
    /// The factor of the balance of motor torques.
    share: Option<AnyGain<S>>,
    /// Whether the springs carry the load.
    carrying: bool,
    stretch: Vec<S>,
    spring: Vec<S>,
}

impl<'a, S: Real> Forces<'a, S> {
    fn new(rest: &'a Rest<'a>, motors: Motors) -> Self {
        let n = rest.plant.n();
        let zeros = |k: usize| vec![S::zero(); k];
        let carrying = matches!(motors, Motors::Carrying(..));
        let (elasticity, share) = match motors {
            Motors::Absent => (None, None),
            Motors::Unknown(elasticity, share) | Motors::Carrying(elasticity, share) => (Some(elasticity), Some(share)),
        };
        let lanes = |gain: Option<Gain>| gain.map(|gain| AnyGain::new(&gain));
        Forces {
            rest,
            law: rest.law.build(),
            arm: rest.plant.model().at(&zeros(n)),
            desired: rest.law.desired(0.0),
            x: zeros(4 * n),
            load: zeros(n),
            tau: zeros(n),
            stops: rest.plant.stops().into_iter().flat_map(|stops| stops.all()).collect(),
            elasticity: lanes(elasticity),
            share: lanes(share),
            carrying,
            stretch: zeros(n),
            spring: zeros(n),
        }
    }

    /// Write the load `L(q)` to `self.load`, and return the force of the wall.
    fn load(&mut self, q: &[S]) -> Vector3<S> {
        let n = q.len();
        self.arm.move_to(q);
        self.arm.gravity(&mut self.load);
        if let Some(frame) = self.rest.frame {
            let (_, jacobian) = self.arm.jacobian(frame);
            for i in 0..n {
                for (k, &w) in self.rest.wrench.iter().enumerate() {
                    self.load[i] = jacobian[k * n + i].neg_mul_add(S::splat(w), self.load[i]);
                }
            }
        }
        let mut push = Vector3::zero();
        if let Some(wall) = self.rest.plant.wall() {
            let (p, jacobian) = self.arm.jacobian(wall.frame);
            push = LoopWall::new(wall).force(p, Vector3::zero(), None).0;
            for i in 0..n {
                for k in 0..3 {
                    self.load[i] = jacobian[k * n + i].neg_mul_add(push[k], self.load[i]);
                }
            }
        }
        if let Some(stops) = self.rest.plant.stops() {
            for &stop in &self.stops {
                let i = stop.joint;
                let (depth, _) = stop.depth(S::splat(stops.limit(stop)), q[i], S::zero());
                let force = unilateral::push(S::splat(stops.stiffness[i]), S::zero(), depth, S::zero(), None).0;
                self.load[i] += if stop.upper { force } else { -force };
            }
        }
        push
    }

    /// Write the residual `r` of the unknowns `y` to the argument `r`. After `q`, the unknowns are the motor positions or the law's state.
    fn residual(&mut self, y: &[S], r: &mut [S]) {
        let n = self.load.len();
        let (q, behind) = y.split_at(n);
        self.x[..n].copy_from_slice(q);
        self.load(q);
        let (Some(elasticity), Some(share)) = (&self.elasticity, &self.share) else {
            let (r, rate) = r.split_at_mut(n);
            self.law.evaluate(&self.desired, self.arm.trig(), &self.x[..2 * n], behind, r, rate);
            for i in 0..n {
                r[i] -= self.load[i];
            }
            return;
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
            return;
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
    }
}

/// Call `put(i, j, dr_i/dy_j)` for all entries of the derivative of the residual `r(y)`, column by column.
fn slopes(forces: &mut Forces<Dual>, y: &[f64], mut put: impl FnMut(usize, usize, f64)) {
    let mut moving: Vec<Dual> = y.iter().map(|&y| Dual::splat(y)).collect();
    let mut r = vec![Dual::default(); y.len()];
    for j in 0..y.len() {
        look();
        moving[j].rate = 1.0;
        forces.residual(&moving, &mut r);
        moving[j].rate = 0.0;
        r.iter().enumerate().for_each(|(i, r)| put(i, j, r.rate));
    }
}

/// The symmetric part of `-dr/dy`, `(n, n)`, with the residual `r` and the unknowns `y`.
fn hessian(forces: &mut Forces<Dual>, y: &[f64]) -> Vec<f64> {
    let n = y.len();
    let mut h = vec![0.0; n * n];
    slopes(forces, y, |i, j, rate| {
        h[i * n + j] -= 0.5 * rate;
        h[j * n + i] -= 0.5 * rate;
    });
    h
}
