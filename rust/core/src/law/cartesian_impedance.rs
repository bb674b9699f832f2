//! Cartesian impedance (Hogan 1985): spring and damper between a frame and its target, gravity compensated,
//!
//! `tau = J' (K_m e + D_m (x_d' - J v)) + g(q)`, `e = x_d - x` (orientation: `log(R_d R')`), in any rows of position and
//! orientation. No inverse of `J`: the law stays defined at singularities.

use super::{Build, Definition, Instant, Law, LawSpec, Term, require_size};
use crate::dynamics::{AnyArm, Dynamics, Model, Workspace};
use crate::error::{Error, Result};
use crate::kinematics::Coordinates;
use crate::linalg::gain::{AnyGain, Gain, Multiply};
use crate::motion::Motion;
use crate::plant::PlantKind;
use crate::scalar::Real;

/// The Cartesian impedance law of an arm, validated.
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
/// // A force of 10 N along x moves the tip by F / K = 0.05 m.
/// let rest = equilibrium(&plant, &law, &[10.0, 0.0, 0.0, 0.0, 0.0, 0.0], tip, &[0.9, -1.2])?;
/// assert!(rest.reachable && rest.stable);
/// assert!((rest.x[0] - 0.65).abs() < 1e-6 && (rest.x[1] - 0.3).abs() < 1e-6);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct CartesianImpedanceSpec {
    /// The arm.
    pub model: Model,
    /// The controlled rows of a frame.
    pub coordinates: Coordinates,
    /// A fixed pose is a motion that holds.
    pub target: Motion,
    /// `K_m`, N/m, N m/rad.
    pub stiffness: Gain,
    /// `D_m`, N s/m, N m s/rad.
    pub damping: Gain,
}

impl CartesianImpedanceSpec {
    /// The law for the rows `axes` of `frame`; `target`, `stiffness` and `damping` have that many rows.
    pub fn new(model: Model, target: Motion, stiffness: Gain, damping: Gain, frame: &str, axes: &str) -> Result<Self> {
        let coordinates = Coordinates::new(model.tree("arm")?, frame, axes)?;
        let m = coordinates.m();
        if target.dof() != m {
            return Err(Error::input("target", format!("has the wrong shape: expected ({m},) for axes {axes:?}, got ({},)", target.dof())));
        }
        require_size("stiffness", &stiffness, m)?;
        require_size("damping", &damping, m)?;
        Ok(CartesianImpedanceSpec { model, coordinates, target, stiffness, damping })
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
        vec![&self.target]
    }

    fn terms(&self, at: &Instant) -> Vec<Term> {
        let (n, m) = (self.model.n(), self.coordinates.m());
        let mut law = Self::build::<f64>(|_| self);
        let mut u = vec![0.0; n];
        law.evaluate(at.desired, at.trig, at.x, &[], &mut u, &mut []);
        let x_dot = law.velocity(&at.x[n..2 * n]);
        let mut position = vec![0.0; m];
        if let AnyArm::Tree(tree) = &law.arm {
            self.coordinates.position(tree, &mut law.workspace.poses, at.trig, &at.x[..n], &mut position);
        }
        vec![
            ("x", vec![m], position),
            ("x_d", vec![m], at.desired[..m].to_vec()),
            ("x_dot", vec![m], x_dot),
            ("e", vec![m], law.e.clone()),
            ("J", vec![m, n], law.jacobian.clone()),
            ("force", vec![m], law.force.clone()),
            ("u", vec![n], u.clone()),
            ("tau", vec![n], u),
        ]
    }

    fn coordinates(&self) -> Option<&Coordinates> {
        Some(&self.coordinates)
    }
    fn impedance(&self) -> Option<&CartesianImpedanceSpec> {
        Some(self)
    }
    fn outer(&self) -> Option<LawSpec> {
        Some(self.clone().into())
    }
    fn outer_stiffness(&mut self) -> Option<&mut Gain> {
        Some(&mut self.stiffness)
    }
}

impl Build for CartesianImpedanceSpec {
    type Lanes<S: Real> = CartesianImpedance<S>;

    fn build<'a, S: Real>(of: impl Fn(usize) -> &'a Self) -> CartesianImpedance<S> {
        let first = of(0);
        let (n, m) = (first.model.n(), first.coordinates.m());
        let arm = AnyArm::from_lanes(|i| &of(i).model);
        let zeros = |k: usize| vec![S::zero(); k];
        CartesianImpedance {
            workspace: arm.workspace(),
            arm,
            coordinates: first.coordinates.clone(),
            stiffness: AnyGain::labelled("stiffness", |i| &of(i).stiffness),
            damping: AnyGain::labelled("damping", |i| &of(i).damping),
            full: zeros(6 * n),
            jacobian: zeros(m * n),
            e: zeros(m),
            slip: zeros(m),
            spring: zeros(m),
            force: zeros(m),
        }
    }
}

/// The law in a loop; through elastic joints it is the outer loop.
pub struct CartesianImpedance<S: Real> {
    pub(super) arm: AnyArm<S>,
    pub(super) workspace: Workspace<S>,
    coordinates: Coordinates,
    pub(super) stiffness: AnyGain<S>,
    pub(super) damping: AnyGain<S>,
    full: Vec<S>,
    /// `(m, n)`
    pub(super) jacobian: Vec<S>,
    pub(super) e: Vec<S>,
    /// `x_d' - x'`
    pub(super) slip: Vec<S>,
    /// `K_m e`
    spring: Vec<S>,
    /// `K_m e + D_m (x_d' - x')`
    force: Vec<S>,
}

impl<S: Real> CartesianImpedance<S> {
    /// `J v`.
    fn velocity(&self, v: &[S]) -> Vec<S> {
        self.jacobian.chunks_exact(v.len()).map(|row| row.iter().zip(v).fold(S::zero(), |sum, (&j, &v)| j.mul_add(v, sum))).collect()
    }
}

impl<S: Real> CartesianImpedance<S> {
    /// `x_dot.(force) + (x_d' - x_dot).K_m e`, as of the last evaluation: what the law's spring takes and its damper loses,
    /// `-x_dot'D_m x_dot` for a target at rest.
    pub(super) fn power(&self, x: &[S]) -> S {
        let (m, n) = (self.e.len(), self.jacobian.len() / self.e.len());
        let mut sum = S::zero();
        for k in 0..m {
            let mut rate = S::zero();
            for i in 0..n {
                rate = self.jacobian[k * n + i].mul_add(x[n + i], rate);
            }
            sum = rate.mul_add(self.force[k], sum);
            sum = self.slip[k].mul_add(self.spring[k], sum);
        }
        sum
    }
}

impl<S: Real> Law<S> for CartesianImpedance<S> {
    fn evaluate(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], _: &[S], tau: &mut [S], _: &mut [S]) {
        let (n, m) = (tau.len(), self.e.len());
        let (q, v) = (&x[..n], &x[n..2 * n]);
        self.arm.gravity(&mut self.workspace, trig, q, tau);
        let CartesianImpedance { arm, workspace, coordinates, full, jacobian, e, slip, spring, force, stiffness, damping } = self;
        arm.error_and_jacobian(workspace, coordinates, full, trig, q, &desired[..m], e, jacobian);
        for k in 0..m {
            let mut rate = desired[m + k];
            for i in 0..n {
                rate = jacobian[k * n + i].neg_mul_add(v[i], rate);
            }
            slip[k] = rate;
        }
        stiffness.multiply(e, spring);
        force.copy_from_slice(spring);
        damping.add_to(slip, force);
        for i in 0..n {
            for k in 0..m {
                tau[i] = jacobian[k * n + i].mul_add(force[k], tau[i]);
            }
        }
    }
}
