//! Equilibria of a controlled arm under a constant force:
//!
//! `r(q) = u(q) + J'F - g(q) = 0`, `tau_E = g(q_E) - J'F`, `theta_E = q_E + K^-1 tau_E`, with the joint stiffness `K`.
//!
//! Here `u` is the output of the law, `F` the external force, `g` the gravity torque and `'` the transpose. For a Cartesian impedance law
//! with the stiffness `K_m`, the target `x_d` and the plant's gravity, this is `J'(K_m (x_d - x) + F) = 0`. A pose with
//! `x = x_E = x_d + K_m^-1 F` is a solution, if such a pose is reachable. Another solution is spurious: `J' p = 0` with
//! `p = K_m (x_d - x) + F != 0`, where `J` loses rank. [`Equilibrium::spurious`] marks it.
//!
//! A law with a null space adds `N' tau_0` to its output. An integral with the gain `K_i` adds a wrench `w` to the spring, and requires
//! `K_i e = 0`. Limits of the law may hold the arm away from `x_E`. A wall and joint stops add their forces to `F`. A law that regulates
//! motors has its equilibrium where `tau(q, theta) = K (theta - q) = tau_E`.

use super::equilibrium_problem::{EquilibriumProblem, Unbalanced};
use super::loop_slope::{Modes, loop_modes};
use crate::dynamics::At;
use crate::error::{Error, Result, finite};
use crate::interrupt;
use crate::law::{CartesianImpedanceSpec, ElasticImpedanceSpec, LawSpec};
use crate::linalg::{Gain, cholesky, symmetric_eigen};
use crate::memory;
use crate::plant::PlantSpec;
use nalgebra::DVector;

/// An equilibrium and its properties.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// use armlet_core::analysis::equilibrium::equilibrium;
/// # let model = Model::from(Arm::planar(&[0.5], None, None, None, [0.0, 0.0])?);
/// # let tip = model.tree("arm")?.frame_index("link1")?;
/// # let plant = PlantSpec::from(RigidSpec::new(model.clone()));
///
/// // The target is -0.05 rad. At q = 0, the force of 2 N at 0.5 m balances the spring of 20 N m/rad.
/// let law = LawSpec::from(PdGravitySpec::new(model, vec![-0.05], Gain::scalar("kp", 1, 20.0)?, Gain::scalar("kd", 1, 4.0)?)?);
/// let found = equilibrium(&plant, &law, &[0.0, 2.0, 0.0, 0.0, 0.0, 0.0], Some(tip), &[0.3])?;
/// assert!(found.q[0].abs() < 1e-9 && (found.tau[0] + 1.0).abs() < 1e-6);
/// assert!(found.stable && found.eigenvalues.len() == 2);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Equilibrium {
    /// Joint positions `(n,)`, rad or m.
    pub q: Vec<f64>,
    /// Motor positions, `(n,)`, rad or m; empty for a rigid plant.
    pub theta: Vec<f64>,
    /// The plant's input at the equilibrium, `(n,)`, N m or N.
    pub tau: Vec<f64>,
    /// The controlled coordinates, `(m,)`, m or rad; joint positions for a law of joints.
    pub x: Vec<f64>,
    /// The law's integral wrench `w`, `(m,)`, N and N m; empty without an integral.
    pub integral: Vec<f64>,
    /// Unbalanced torque, `(n,)`, N m or N: the output of the law minus `tau`. It is zero up to rounding, unless no equilibrium was found.
    /// Then `reachable`, `spurious` and `stable` are false.
    pub residual: Vec<f64>,
    /// Whether the pose `x_d + K_m^-1 F`, or `x_d` with an integral, can be reached. A wall, a stop or a limit of the law may prevent this.
    /// For a law of joints: whether neither the wall nor a stop is in contact.
    pub reachable: bool,
    /// Whether the total wrench `p` of spring, external force and contacts is not zero, although no torque limit is active. For a law that
    /// regulates motors with the plant's model: whether the arm misses its target without an external force and a contact.
    pub spurious: bool,
    /// Force of the wall on its frame, `(3,)`, N, world axes.
    pub wall_force: [f64; 3],
    /// Whether the residual is zero and all eigenvalues, except those of free motions, have negative real parts, up to rounding.
    pub stable: bool,
    /// The number of free motions, which no torque opposes, such as null motions of a redundant arm without a posture.
    pub free_motions: usize,
    /// Eigenvalues of the linearised closed loop as `(real, imaginary)`, 1/s, by ascending real part; zeros for free motions.
    pub eigenvalues: Vec<(f64, f64)>,
}

/// The balance of wrenches at `q`, for a law with the integral wrench `w` under the wrench `push`.
struct Balance {
    /// The total wrench `p = K_m e + F_ff + w + F`, `(m,)`, N and N m. The wrench of the law, which is `p` without `F`, is within its
    /// limits.
    p: Vec<f64>,
    x: Vec<f64>,
    /// Whether the law misses its goal: the total wrench without the limits of the law is not zero, or `K_i e` is not zero. `K_i` is the
    /// integral gain.
    short: bool,
    /// The largest absolute value of an entry of the total wrench `p` that counts as a rounding error.
    rounding: f64,
}

impl Balance {
    fn of(law: &CartesianImpedanceSpec, push: &[f64], w: &[f64], q: &[f64]) -> Self {
        let m = law.coordinates.m();
        let (e, target, options) = (TargetError::new(law).at(q).0, target(law), law.options());
        let fed = |k: usize| options.feedforward.as_ref().map_or(0.0, |fed| fed[k]);
        let constant: Vec<f64> = (0..m).map(|k| push[k] + fed(k)).collect();
        let load = law.stiffness.inverse().times(&constant);
        let goal: Vec<f64> = (0..m).map(|k| (target[k] + load[k]).abs() + 1.0).collect();
        let rounding = |gain: &Gain| 1e-7 * crate::linalg::largest(&gain.times(&goal));
        let off = |p: &[f64], gain: &Gain| crate::linalg::largest(p) > rounding(gain);
        let spring = law.stiffness.times(&e);
        let wrench: Vec<f64> = (0..m).map(|k| spring[k] + fed(k) + w.get(k).copied().unwrap_or(0.0)).collect();
        let limit = |k: usize| options.wrench_max.as_ref().map_or(f64::INFINITY, |limits| limits[k]);
        let free: Vec<f64> = (0..m).map(|k| wrench[k] + push[k]).collect();
        let missed = options.integral_gain.as_ref().is_some_and(|gain| off(&gain.times(&e), gain));
        Balance {
            short: missed || off(&free, &law.stiffness),
            p: (0..m).map(|k| wrench[k].clamp(-limit(k), limit(k)) + push[k]).collect(),
            x: (0..m).map(|k| target[k] - e[k]).collect(),
            rounding: rounding(&law.stiffness),
        }
    }
}

fn target(law: &CartesianImpedanceSpec) -> Vec<f64> {
    let m = law.coordinates.m();
    let mut sample = vec![0.0; 3 * m];
    law.target.sample(0.0, &mut sample);
    sample.truncate(m);
    sample
}

/// The task of a law, evaluated at one pose after another.
struct TargetError<'a> {
    law: &'a CartesianImpedanceSpec,
    arm: At,
    target: Vec<f64>,
}

impl<'a> TargetError<'a> {
    fn new(law: &'a CartesianImpedanceSpec) -> Self {
        TargetError { law, arm: law.model.at(&vec![0.0; law.model.n()]), target: target(law) }
    }

    /// Compute the task error `e`, `(m,)`, and the Jacobian `J`, `(m, n)`, at `q`.
    fn at(&mut self, q: &[f64]) -> (Vec<f64>, Vec<f64>) {
        self.arm.move_to(q);
        let (e, j) = self.arm.error_and_jacobian(&self.law.coordinates, &DVector::from_column_slice(&self.target));
        (e.as_slice().to_vec(), j.transpose().as_slice().to_vec())
    }
}

/// For each joint: the diagonals of the mass matrix `M`, of `J' K_m J` and of `J' D_m J` at `q`. `K_m` and `D_m` are the stiffness and the
/// damping of a Cartesian impedance. For `PdGravity`, the last two diagonals are those of its gains. For other laws they are zero.
pub(super) fn joint_view(plant: &PlantSpec, law: &LawSpec, q: &[f64]) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let n = q.len();
    let mass = plant.model().at(q).mass_matrix().diagonal().as_slice().to_vec();
    match law.outer() {
        Some(LawSpec::CartesianImpedance(law)) => {
            let (_, j) = TargetError::new(&law).at(q);
            let column = |i: usize| -> Vec<f64> { j.iter().skip(i).step_by(n).copied().collect() };
            (mass, (0..n).map(|i| law.stiffness.form(&column(i))).collect(), (0..n).map(|i| law.damping.form(&column(i))).collect())
        }
        Some(LawSpec::PdGravity(law)) => (mass, (0..n).map(|i| law.kp.at(i, i)).collect(), (0..n).map(|i| law.kd.at(i, i)).collect()),
        _ => (mass, vec![0.0; n], vec![0.0; n]),
    }
}

/// The part of the wrench `p` in the null space of `J'`. This part loads no joint.
fn unfelt(law: &CartesianImpedanceSpec, q: &[f64], p: &[f64]) -> Result<Vec<f64>> {
    /// Squared singular values below this fraction of the largest count as zero. They are not exact, because the equilibrium has an error
    /// of about 1e-9.
    const SINGULAR: f64 = 1e-12;
    let (n, m) = (q.len(), p.len());
    let (_, j) = TargetError::new(law).at(q);
    let gram: Vec<f64> = (0..m * m).map(|at| (0..n).map(|i| j[at / m * n + i] * j[at % m * n + i]).sum()).collect();
    let (values, vectors) = symmetric_eigen(&gram, m)?;
    let largest = values.iter().fold(0.0f64, |most, &l| most.max(l));
    let mut part = vec![0.0; m];
    for (l, u) in values.iter().zip(vectors.chunks_exact(m)) {
        if *l <= SINGULAR * largest {
            crate::linalg::axpy(crate::linalg::dot(u, p), u, &mut part);
        }
    }
    Ok(part)
}

/// Whether some pose has `e + K_m^-1 F = 0`, with the error `e = x_d - x` and the force `F`, which is `push`. The search is a damped
/// Gauss-Newton method from `q0` and from spread starts. It may miss a reachable pose.
fn reaches(law: &CartesianImpedanceSpec, push: &[f64], q0: &[f64]) -> bool {
    const STARTS: u32 = 24;
    const STEPS: usize = 200;
    let (n, m) = (q0.len(), law.coordinates.m());
    let load = law.stiffness.inverse().times(push);
    let mut task = TargetError::new(law);
    // The starts are an additive recurrence with powers of the generalised golden ratio. This fixed sequence is spread evenly in n
    // dimensions.
    let phi = (0..64).fold(2.0f64, |x, _| (1.0 + x).powf(1.0 / (n as f64 + 1.0)));
    (0..STARTS).any(|start| {
        let spread = |i: usize| (f64::from(start) * phi.powi(-(i as i32 + 1))).fract() * std::f64::consts::TAU - std::f64::consts::PI;
        let mut q: Vec<f64> = (0..n).map(|i| q0[i] + if start == 0 { 0.0 } else { spread(i) }).collect();
        for _ in 0..STEPS {
            interrupt::check();
            let (e, j) = task.at(&q);
            let miss: Vec<f64> = (0..m).map(|k| e[k] + load[k]).collect();
            let size = miss.iter().map(|x| x * x).sum::<f64>();
            if size.sqrt() < 1e-9 {
                return true;
            }
            let gram: Vec<f64> = (0..m * m)
                .map(|at| {
                    let (a, b) = (at / m, at % m);
                    (0..n).map(|i| j[a * n + i] * j[b * n + i]).sum::<f64>() + if a == b { 1e-2 * size + 1e-14 } else { 0.0 }
                })
                .collect();
            let Some(l) = cholesky::factor(m, &gram) else { return false };
            let mut weights = miss;
            cholesky::solve(m, &l, &mut weights);
            for i in 0..n {
                q[i] += (0..m).map(|k| j[k * n + i] * weights[k]).sum::<f64>();
            }
        }
        false
    })
}

/// Compute the equilibrium that is reached from `q0`, `(n,)`, rad or m, under a constant wrench `[f; m]`, N and N m, world axes. The wrench
/// acts at `force_frame`; with `None` no wrench acts.
///
/// Errors: `Input` for a law that is not an impedance or PD law, has a moving target or is made for another plant. Also `Input` for a `q0`
/// that is not finite, and after an overflow. `Solve` if the search does not converge, `Memory` if the memory does not suffice.
pub fn equilibrium(plant: &PlantSpec, law: &LawSpec, wrench: &[f64; 6], force_frame: Option<usize>, q0: &[f64]) -> Result<Equilibrium> {
    finite("q0", q0)?;
    // Number of `(n, n)` matrices that the memory check assumes: stiffness, mass, slopes and eigenvectors of the loop.
    const MATRICES: usize = 32;
    memory::require((MATRICES * 8 * plant.n()).saturating_mul(plant.n()))?;
    let (n, fault) = (plant.n(), |argument: &str, problem: String| Err(Error::input(argument, problem)));
    if law.plant() != plant.kind() || law.model().n() != n {
        return fault(
            "law",
            format!("is made for another plant: expected a law for {} of {n} joints, got {}", plant.kind().name(), law.name()),
        );
    }
    // With the plant's joint stiffness and without limits of the motor torque, a law that reduces the motor inertia is at rest where its
    // outer loop balances the load.
    let exact = law.joint_stiffness() == plant.elastic().map(|plant| &plant.stiffness) && !law.storage().is_some_and(limits_motors);
    let held = match (law.outer(), law.torque_share()) {
        (Some(outer), _) if exact => outer,
        (Some(_), _) | (None, Some(_)) => law.clone(),
        _ => return fault("law", format!("is not at rest by a spring: expected an impedance or PD law, got {}", law.name())),
    };
    let task = law.impedance().or(law.storage().map(|law| &law.outer));
    if held.motions().iter().any(|motion| motion.moves()) {
        return fault("law", "has a target that moves: expected a law with a fixed target".into());
    }
    let problem = EquilibriumProblem { plant, law: &held, wrench: *wrench, frame: force_frame };
    let (q, integral) = search(&problem, task.is_none_or(|task| task.options().has_potential()), q0)?;
    let Unbalanced { torque: residual, balanced, load: tau, wall_force } =
        EquilibriumProblem { law, ..problem }.unbalanced(&q, &integral)?;
    let pressed = wall_force.iter().any(|&f| f != 0.0) || plant.stops().is_some_and(|stops| stops.energy(&q) > 0.0);
    let mut state = q.clone();
    state.resize(2 * n, 0.0);
    let mut theta = Vec::new();
    if let Some(plant) = plant.elastic() {
        let stretch = plant.stiffness.inverse().times(&tau);
        theta = q.iter().zip(stretch).map(|(q, s)| q + s).collect();
        state.extend(&theta);
    }
    // At rest, speeds and deflections of friction bristles are zero.
    state.resize(plant.states(), 0.0);
    let (mut reachable, mut spurious, mut x) = (!pressed, false, q.clone());
    if let Some(task) = task {
        // The external wrench in the coordinates of the task, if it acts at the frame of the task.
        let same = force_frame.is_none_or(|frame| frame == task.coordinates.frame);
        let push: Vec<f64> = task.coordinates.rows.iter().map(|&row| if same { wrench[row] } else { 0.0 }).collect();
        let Balance { mut p, x: position, short, rounding } = Balance::of(task, &push, &integral, &q);
        x = position;
        let options = task.options();
        let saturated = |limits: &Vec<f64>| tau.iter().zip(limits).any(|(tau, limit)| tau.abs() >= limit * (1.0 - 1e-9));
        let limited = options.tau_max.as_ref().is_some_and(saturated);
        reachable &= !limited;
        if same {
            if pressed {
                // The force of a contact balances the spring. Only a wrench that loads no joint remains unbalanced.
                if plant.wall().is_some_and(|wall| wall.frame == task.coordinates.frame) {
                    for (p, &row) in p.iter_mut().zip(&task.coordinates.rows) {
                        *p += wall_force.get(row).copied().unwrap_or(0.0);
                    }
                }
                p = unfelt(task, &q, &p)?;
            }
            spurious = !limited && crate::linalg::largest(&p) > rounding;
            let free = !pressed && !options.have_limits();
            reachable = !limited && (!short || (free && reaches(task, &push, q0)));
        }
    } else if let Some(target) = held.link_target() {
        let knows = plant.model() == law.model() && plant.elastic().is_some_and(|plant| law.joint_stiffness() == Some(&plant.stiffness));
        let away = q.iter().zip(&target).any(|(q, target)| (q - target).abs() > 1e-6 * (1.0 + target.abs()));
        spurious = knows && !pressed && wrench.iter().all(|&w| w == 0.0) && away;
    }
    let Modes { free: free_motions, eigenvalues, stable } = loop_modes(plant, law, &state, &integral, wrench, force_frame)?;
    let [reachable, spurious, stable] = [reachable, spurious, stable].map(|flag| flag && balanced);
    Ok(Equilibrium { q, theta, tau, x, integral, residual, reachable, spurious, wall_force, stable, free_motions, eigenvalues })
}

/// Search the equilibrium from `q0`. Return its positions, and the integral of a law that has one. `potential`: whether the law's spring has
/// a potential, so that the search can descend it.
fn search(problem: &EquilibriumProblem, potential: bool, q0: &[f64]) -> Result<(Vec<f64>, Vec<f64>)> {
    let mut q = q0.to_vec();
    if problem.law.reduction().is_none() && potential {
        problem.descend(&mut q)?;
        q.truncate(q0.len());
        return Ok((q, Vec::new()));
    }
    // For a law that reduces the motor inertia, the search starts at the equilibrium of its outer loop, with limits of the joint torque.
    let law = problem.law;
    let outer = law.storage().map(|law| law.outer.clone().into()).or(law.outer().filter(|_| law.reduction().is_some()));
    if let Some(outer) = &outer {
        let mut near = q.clone();
        if (EquilibriumProblem { law: outer, ..*problem }).settle(&mut near).is_ok() {
            q = near;
        }
    }
    problem.settle(&mut q)?;
    let integral = q.split_off(q0.len());
    Ok((q, integral))
}

/// Whether the law limits the motor torque.
fn limits_motors(law: &ElasticImpedanceSpec) -> bool {
    law.outer.options().tau_max.is_some()
}
