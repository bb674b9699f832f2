//! The search for an equilibrium of an arm at rest.
//!
//! The file `residual` defines the residual `r` of the unknowns `y`. For a law with a potential, `r` is minus its gradient. Then Newton's
//! method, with the absolute values of the eigenvalues of `-dr/dy`, descends to a minimum of the potential.
//!
//! A law with a null space, an integral or limits has no potential. Its unknowns `y = [q, w]` include its integral `w`. The search
//! integrates `M q_dot = r`, `w_dot = K_i e` in time until the equilibrium is reached (pseudo-transient continuation). Each implicit step
//! `d` solves `(diag(M, 1)/h - dr/dy) d = r`, with a step size `h` that grows.

pub use super::recordings::EquilibriumProblem;
use super::recordings::Motors;
use super::residual::Residual;
use crate::error::{Error, Result, finite};
use crate::interrupt;
use crate::linalg::gain::Gain;
use crate::linalg::symmetric_eigen;
use crate::status::Status;
use nalgebra::{DMatrix, DVector};

/// The load of an arm at rest, and the torque that the law does not balance.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// use armlet_core::analysis::equilibrium_problem::{EquilibriumProblem, Unbalanced};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let plant = PlantSpec::from(RigidSpec::new(model.clone()));
/// # let law = LawSpec::from(PdGravitySpec::new(model, vec![0.5], Gain::scalar("kp", 1, 20.0)?, Gain::scalar("kd", 1, 4.0)?)?);
///
/// // The law holds the pendulum at 0.5 rad with 20 N m/rad, and compensates gravity.
/// let problem = EquilibriumProblem { plant: &plant, law: &law, wrench: [0.0; 6], frame: None };
/// let Unbalanced { torque, balanced, .. } = problem.unbalanced(&[0.3], &[])?;
/// assert!((torque[0] - 20.0 * 0.2).abs() < 1e-12 && !balanced);
/// assert!(problem.unbalanced(&[0.5], &[])?.balanced);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct Unbalanced {
    /// The unbalanced torque `tau(q, theta) - L(q)`, `(n,)`, N m or N.
    pub torque: Vec<f64>,
    /// Whether this torque and the rate of the law's state are zero.
    pub balanced: bool,
    /// The load of the joints `L(q)`, `(n,)`, N m or N.
    pub load: Vec<f64>,
    /// Force of the wall, `(3,)`, N.
    pub wall_force: [f64; 3],
}

impl EquilibriumProblem<'_> {
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

    /// Compute the load and the unbalanced torque at `q`, `(n,)`, and at the state `integral` of the law. `theta` are the motor positions
    /// whose springs carry the load. Errors: `Input` for a law that branches on its data.
    ///
    /// A torque counts as zero if a relative change of all positions by `ROUNDING` could cause it.
    pub fn unbalanced(&self, q: &[f64], integral: &[f64]) -> Result<Unbalanced> {
        const ROUNDING: f64 = 1e-10;
        let n = q.len();
        let motors = match self.plant.elastic() {
            Some(plant) => Motors::Carrying(plant.stiffness.inverse(), Gain::unchecked(n, vec![1.0; n])),
            None => Motors::Absent,
        };
        let mut residual = Residual::new(self, motors)?;
        let y = [q, integral].concat();
        let (r, load, wall_force) = residual.with_load(&y);
        let (r, load) = (r.to_vec(), load.to_vec());
        let mut scale: Vec<f64> = (0..y.len()).map(|i| load.get(i).map_or(0.0, |load| load.abs())).collect();
        residual.slopes(&y, |i, j, rate| scale[i] += (rate * (1.0 + y[j].abs())).abs());
        let balanced = r.iter().zip(&scale).all(|(r, scale)| r.abs() <= ROUNDING * scale);
        Ok(Unbalanced { torque: r[..n].to_vec(), balanced, load, wall_force })
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
        let (mut residual, mut arm) = (Residual::new(self, self.motors())?, self.plant.model().at(&y[..n]));
        let mut best = f64::INFINITY;
        let mut h = 0.0f64;
        for _ in 0..STEPS {
            interrupt::check();
            let force = DVector::from_column_slice(residual.at(y));
            finite("equilibrium", force.as_slice())?;
            arm.move_to(&y[..n]);
            let mut rates = DMatrix::<f64>::zeros(size, size);
            let mut inertia = DMatrix::<f64>::identity(size, size);
            residual.slopes(y, |i, j, rate| rates[(i, j)] = rate);
            inertia.view_mut((0, 0), (n, n)).copy_from(&arm.mass_matrix());
            let fastest = rates.amax() / inertia.diagonal().amin();
            let longest_step = LONGEST / fastest.max(f64::MIN_POSITIVE);
            h = if h == 0.0 { 1.0 / fastest.max(1.0) } else { h.min(longest_step) };
            let step = loop {
                let step = (&inertia / h - &rates).lu().solve(&force).filter(|step| step.iter().all(|x| x.is_finite()));
                let long = step.as_ref().is_none_or(|step| step.rows(0, n).amax() > REACH);
                match step {
                    Some(step) if !long => break step,
                    _ if h * fastest < 1e-12 => return Err(no_equilibrium(STEPS)),
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
        Err(no_equilibrium(STEPS))
    }

    /// Move `q` to an equilibrium by Newton steps towards a smaller potential. For a law of motors, the motor positions are appended to
    /// `q`. Errors: as for [`EquilibriumProblem::settle`].
    pub fn descend(&self, q: &mut Vec<f64>) -> Result<()> {
        const STEPS: usize = 500;
        /// The largest motion of a joint in one step, rad or m. A longer step could leave the basin of the equilibrium.
        const REACH: f64 = 0.3;
        /// The smallest eigenvalue, relative to the largest, that counts. A direction with a smaller eigenvalue is a free motion of a
        /// redundant arm. The rounding error of `dr/dq` is 1e-15.
        const FLAT: f64 = 1e-9;
        let (motors, joints) = (self.motors(), q.len());
        let compliance = if let Motors::Unknown(stiffness, _) = &motors { Some(stiffness.inverse()) } else { None };
        let mut residual = Residual::new(self, motors)?;
        let y = q;
        if let Some(compliance) = compliance {
            y.extend_from_within(..);
            let stretch = compliance.times(residual.with_load(y).1);
            y[joints..].iter_mut().zip(stretch).for_each(|(theta, s)| *theta += s);
        }
        let n = y.len();
        let (mut r, mut trial) = (vec![0.0; n], vec![0.0; n]);
        let mut best = f64::INFINITY;
        for _ in 0..STEPS {
            r.copy_from_slice(residual.at(y));
            finite("equilibrium", &r)?;
            let (values, vectors) = symmetric_eigen(&residual.hessian(y), n)?;
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
                let ahead = residual.at(&trial);
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
        Err(no_equilibrium(STEPS))
    }
}

fn no_equilibrium(steps: usize) -> Error {
    Error::Solve { status: Status::MaxSteps, t: steps as f64, problem: "no equilibrium was found: the search did not converge".into() }
}
