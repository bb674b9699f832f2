//! Cartesian impedance (Hogan 1985): a spring and a damper between a frame and its target, with gravity compensation:
//!
//! `tau = J' (K_m e + D_m (x_d_dot - J v)) + g(q)`, `e = x_d - x` (orientation: `log(R_d R')`). The law controls any selection of the rows
//! of position and orientation. `x` and `R` are position and rotation matrix of the frame, `J` is the Jacobian of the controlled rows, and
//! `'` the transpose. The law uses no inverse of `J`, so it is defined at singularities. Two options ([`ImpedanceOptions`]) do use an
//! inverse: the null space and the compensation of the coupling. They clamp its singular values.
//!
//! The orientation of a moving target is a rotation vector. Its components in rows that are not controlled are zero. In the rows of
//! orientation, `x_d_dot` and `x_d_ddot` are the angular velocity and the angular acceleration of the target.

use super::definition::{Definition, Law, Shape};
use super::impedance_options::{Extras, ImpedanceOptions};
use super::null_space::{NullSpace, Place};
use super::sizes::require_size;
use crate::dynamics::{AnyArm, Dynamics, Model, Workspace};
use crate::error::{Error, Result};
use crate::kinematics::Coordinates;
use crate::linalg::gain::{AnyGain, Gain};
use crate::motion::Motion;
use crate::plant::PlantKind;
use crate::scalar::Real;
use crate::spatial::{Vector3, rotation_rate};
use crate::trace::Sym;

/// The Cartesian impedance law of an arm, with validated parameters.
///
/// ```
/// use armlet_core::analysis::equilibrium::equilibrium;
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Model;
/// use armlet_core::law::{CartesianImpedanceSpec, Gain, LawSpec};
/// use armlet_core::motion::Motion;
/// use armlet_core::plant::{PlantSpec, RigidSpec};
/// use nalgebra::dvector;
///
/// let model = Model::from(Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?);
/// let (stiffness, damping) = (Gain::scalar("stiffness", 2, 200.0)?, Gain::scalar("damping", 2, 20.0)?);
/// let target = Motion::hold(dvector![0.6, 0.3])?;
/// let law = LawSpec::from(CartesianImpedanceSpec::new(model.clone(), target, stiffness, damping, "link2", "xy")?);
/// let tip = Some(model.tree("arm")?.frame_index("link2")?);
/// let plant = PlantSpec::from(RigidSpec::new(model));
/// // A force of 10 N along x moves the equilibrium of the tip by F / K = 0.05 m.
/// let rest = equilibrium(&plant, &law, &[10.0, 0.0, 0.0, 0.0, 0.0, 0.0], tip, &[0.9, -1.2])?;
/// assert!(rest.reachable && rest.stable);
/// assert!((rest.x[0] - 0.65).abs() < 1e-6 && (rest.x[1] - 0.3).abs() < 1e-6);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct CartesianImpedanceSpec {
    /// The model of the arm.
    pub model: Model,
    /// The controlled rows: the frame and its `m` axes.
    pub coordinates: Coordinates,
    /// Target motion of the rows, `(m,)`, m and rad. For a fixed pose, use a motion with constant position.
    pub target: Motion,
    /// Stiffness `K_m`, of size `m`, N/m and N m/rad.
    pub stiffness: Gain,
    /// Damping `D_m`, of size `m`, N s/m and N m s/rad.
    pub damping: Gain,
    pub(super) options: ImpedanceOptions,
    /// The integral at the start of a run: zeros, `(m,)`; empty without an integral.
    start: Vec<f64>,
}

impl CartesianImpedanceSpec {
    /// Create the law for the rows `axes` of `frame`. `target`, `stiffness` and `damping` have one row per axis.
    ///
    /// Errors: `Unknown` for the name of the frame, `WrongShape` for a wrong size, `Input` for invalid axes or the planar PR arm.
    pub fn new(model: Model, target: Motion, stiffness: Gain, damping: Gain, frame: &str, axes: &str) -> Result<Self> {
        let coordinates = Coordinates::new(model.tree("arm")?, frame, axes)?;
        let m = coordinates.m();
        if target.dof() != m {
            return Err(Error::wrong("target", "shape", format!("({m},) for axes {axes:?}"), format!("({},)", target.dof())));
        }
        require_size("stiffness", &stiffness, m)?;
        require_size("damping", &damping, m)?;
        Ok(CartesianImpedanceSpec {
            model,
            coordinates,
            target,
            stiffness,
            damping,
            options: ImpedanceOptions::default(),
            start: Vec::new(),
        })
    }

    /// Replace the options of the law. Errors: `WrongShape` for a wrong size; `Input` for an `eps` or a limit out of range, or numbers that
    /// are not finite.
    pub fn with(self, options: ImpedanceOptions) -> Result<Self> {
        let m = self.coordinates.m();
        options.validate(m, self.model.n()).map_err(|error| self.model.name_limit(error))?;
        let start = vec![0.0; if options.integral_gain.is_some() { m } else { 0 }];
        Ok(CartesianImpedanceSpec { options, start, ..self })
    }

    /// The options of the law.
    pub fn options(&self) -> &ImpedanceOptions {
        &self.options
    }

    pub(super) fn without_torque_limits(mut self) -> Self {
        self.options.tau_max = None;
        self
    }

    /// Whether the target has a rotation vector that changes with time.
    pub fn turns_target(&self) -> bool {
        self.coordinates.turns() && !matches!(self.target, Motion::Hold(_))
    }
}

impl Definition for CartesianImpedanceSpec {
    fn name(&self) -> &'static str {
        "CartesianImpedance"
    }
    fn plant(&self) -> PlantKind {
        PlantKind::Rigid
    }
    fn model(&self) -> &Model {
        &self.model
    }
    fn motions(&self) -> Vec<&Motion> {
        std::iter::once(&self.target).chain(self.options.null_space.as_ref().map(|null_space| &null_space.posture)).collect()
    }
    fn initial_state(&self) -> &[f64] {
        &self.start
    }

    fn coordinates(&self) -> Option<&Coordinates> {
        Some(&self.coordinates)
    }
    fn outer_stiffness(&mut self) -> Option<&mut Gain> {
        Some(&mut self.stiffness)
    }
}

impl Shape for CartesianImpedanceSpec {
    fn same_shape(&self, other: &Self) -> bool {
        self.options.same_shape(&other.options) && self.turns_target() == other.turns_target()
    }
}

impl CartesianImpedanceSpec {
    pub(super) fn build(&self) -> CartesianImpedance {
        let (n, m, options) = (self.model.n(), self.coordinates.m(), &self.options);
        let arm = AnyArm::new(&self.model);
        let zeros = |k: usize| vec![Sym::zero(); k];
        CartesianImpedance {
            workspace: arm.workspace(),
            arm,
            coordinates: self.coordinates.clone(),
            stiffness: AnyGain::labelled("stiffness", &self.stiffness),
            damping: AnyGain::labelled("damping", &self.damping),
            full: zeros(6 * n),
            jacobian: zeros(m * n),
            e: zeros(m),
            slip: zeros(m),
            spring: zeros(m),
            force: zeros(m),
            acceleration: zeros(m),
            turns_target: self.turns_target(),
            null_space: NullSpace::new(options.null_space.as_ref(), options.compensate_coupling, options.eps, [m, n]),
            extras: Extras::new(options),
        }
    }
}

/// The law in the control loop of a rigid arm, or as the outer loop of an elastic arm.
pub struct CartesianImpedance {
    pub(super) arm: AnyArm<Sym>,
    pub(super) workspace: Workspace<Sym>,
    pub(super) coordinates: Coordinates,
    pub(super) stiffness: AnyGain<Sym>,
    pub(super) damping: AnyGain<Sym>,
    full: Vec<Sym>,
    /// Jacobian of the rows, `(m, n)`.
    pub(super) jacobian: Vec<Sym>,
    pub(super) e: Vec<Sym>,
    /// Velocity error `x_d_dot - x_dot`, `(m,)`, m/s and rad/s.
    pub(super) slip: Vec<Sym>,
    /// Spring wrench `K_m e`, `(m,)`, N and N m.
    spring: Vec<Sym>,
    /// Wrench, `(m,)`, N and N m: `K_m e + D_m (x_d_dot - x_dot)` and the terms of the options.
    force: Vec<Sym>,
    /// Acceleration `x_d_ddot` of the target, `(m,)`, m/s^2 and rad/s^2.
    acceleration: Vec<Sym>,
    turns_target: bool,
    null_space: Option<NullSpace>,
    pub(super) extras: Extras,
}

/// Velocity `J v` of the rows, `(m,)`.
fn velocity(jacobian: &[Sym], v: &[Sym]) -> Vec<Sym> {
    jacobian.chunks_exact(v.len()).map(|row| row.iter().zip(v).fold(Sym::zero(), |sum, (&j, &v)| j.mul_add(v, sum))).collect()
}

impl CartesianImpedance {
    /// The power `x_dot.(force) + (x_d_dot - x_dot).K_m e` at the last evaluation, W: the power of the wrench on the frame, plus the rate
    /// of the spring's energy.
    ///
    /// For a target at rest and without options it is `-x_dot' D_m x_dot`. A null space or a compensated coupling adds the power of its
    /// torque, `v.(N' tau_0 + C v)` (`null_space.rs`).
    pub(super) fn power(&self, x: &[Sym]) -> Sym {
        let (m, n) = (self.e.len(), self.jacobian.len() / self.e.len());
        let mut sum = Sym::zero();
        for k in 0..m {
            let mut rate = Sym::zero();
            for i in 0..n {
                rate = self.jacobian[k * n + i].mul_add(x[n + i], rate);
            }
            sum = rate.mul_add(self.force[k], sum);
            sum = self.slip[k].mul_add(self.spring[k], sum);
        }
        if let Some(null_space) = &self.null_space {
            sum = null_space.torque.iter().zip(&x[n..2 * n]).fold(sum, |sum, (&torque, &v)| torque.mul_add(v, sum));
        }
        sum
    }
}

/// Compute the angular velocity and the angular acceleration of the target for the rows of orientation, and write them to `rate` and
/// `second`, `(m,)` each. `desired` has the samples of a rotation vector that changes with time.
pub(crate) fn turn_rates(rows: &[usize], desired: &[Sym], rate: &mut [Sym], second: &mut [Sym]) {
    let m = rows.len();
    let part = |k: usize| {
        let mut vector = [Sym::zero(); 3];
        rows.iter().enumerate().filter(|(_, row)| **row > 2).for_each(|(at, row)| vector[row - 3] = desired[k * m + at]);
        Vector3::from(vector)
    };
    let (velocity, acceleration) = rotation_rate(part(0), part(1), part(2));
    for (at, row) in rows.iter().enumerate().filter(|(_, row)| **row > 2) {
        (rate[at], second[at]) = (velocity[row - 3], acceleration[row - 3]);
    }
}

impl Law for CartesianImpedance {
    fn evaluate(&mut self, desired: &[Sym], trig: &[(Sym, Sym)], x: &[Sym], z: &[Sym], tau: &mut [Sym], dz: &mut [Sym]) {
        let (n, m) = (tau.len(), self.e.len());
        let (q, v) = (&x[..n], &x[n..2 * n]);
        self.arm.gravity(&mut self.workspace, trig, q, tau);
        self.slip.copy_from_slice(&desired[m..2 * m]);
        if self.null_space.is_some() {
            self.acceleration.copy_from_slice(&desired[2 * m..3 * m]);
        }
        if self.turns_target {
            turn_rates(&self.coordinates.rows, desired, &mut self.slip, &mut self.acceleration);
        }
        let CartesianImpedance { arm, workspace, coordinates, full, jacobian, e, slip, spring, force, stiffness, damping, .. } = self;
        arm.error_and_jacobian(workspace, coordinates, full, (trig, q), &desired[..m], (e, jacobian));
        for k in 0..m {
            let mut rate = slip[k];
            for i in 0..n {
                rate = jacobian[k * n + i].neg_mul_add(v[i], rate);
            }
            slip[k] = rate;
        }
        Sym::term("x", &[m], || {
            let mut position = vec![Sym::zero(); m];
            if let AnyArm::Tree(tree) = &*arm {
                coordinates.position(tree, &mut workspace.poses, trig, q, &mut position);
            }
            position
        });
        Sym::term("x_d", &[m], || desired[..m].to_vec());
        Sym::term("x_dot", &[m], || velocity(jacobian, v));
        Sym::term("e", &[m], || e.clone());
        Sym::term("J", &[m, n], || jacobian.clone());
        stiffness.multiply(e, spring);
        force.copy_from_slice(spring);
        damping.add_to(slip, force);
        self.extras.add(e, z, force, dz);
        if let Some(null_space) = &mut self.null_space {
            let (posture, acceleration, gravity) = (&desired[3 * m..], &self.acceleration[..], &tau[..]);
            null_space.evaluate(arm, workspace, coordinates, &Place { trig, q, v, jacobian, acceleration, posture, gravity }, force);
        }
        for i in 0..n {
            for k in 0..m {
                tau[i] = jacobian[k * n + i].mul_add(force[k], tau[i]);
            }
        }
        if let Some(null_space) = &self.null_space {
            tau.iter_mut().zip(&null_space.torque).for_each(|(tau, &torque)| *tau += torque);
        }
        self.extras.limit(jacobian, tau, dz);
        Sym::term("force", &[m], || force.clone());
        Sym::term("u", &[n], || tau.to_vec());
        if !z.is_empty() {
            Sym::term("integral", &[m], || z.to_vec());
            Sym::term("integral_rate", &[m], || dz.to_vec());
        }
        if let Some(null_space) = &self.null_space {
            null_space.name_terms();
        }
    }
}
