//! An arm at one configuration `q`, with the intermediate results of its algorithms. It is used for occasional evaluations: terms of a law,
//! monitors, equilibria. Integration steps do not use it, because there the plant and the law share the sines and cosines. Joint torques
//! are in N m for revolute joints, and in N for prismatic joints.

use super::{AnyArm, Dynamics, Model, Workspace};
use crate::kinematics::Coordinates;
use crate::scalar::Real;
use crate::spatial::Vector3;

/// An arm at one configuration, with its buffers.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Model;
///
/// let model = Model::from(Arm::pendulum(1.0, 5.0)?);
/// let (mut arm, mut g) = (model.at(&[0.3]), [0.0]);
/// arm.gravity(&mut g);
/// assert!((g[0] - 5.0 * 0.3f64.sin()).abs() < 1e-15);
/// arm.move_to(&[-0.3]);
/// let (kinetic, _) = arm.energy(&[2.0]);
/// assert!((kinetic - 2.0).abs() < 1e-15);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct ArmAt<S: Real = f64> {
    arm: AnyArm<S>,
    workspace: Workspace<S>,
    q: Vec<S>,
    trig: Vec<(S, S)>,
    /// Memory for a geometric Jacobian, `(6, n)`.
    full: Vec<S>,
}

impl Model {
    /// The arm at the configuration `q`, `(n,)`.
    pub fn at<S: Real>(&self, q: &[S]) -> ArmAt<S> {
        let mut at = ArmAt::new(self);
        at.move_to(q);
        at
    }
}

impl<S: Real> ArmAt<S> {
    /// Create the arm of a model. [`ArmAt::move_to`] sets the configuration.
    pub fn new(model: &Model) -> Self {
        let n = model.n();
        let arm = AnyArm::new(model);
        ArmAt {
            workspace: arm.workspace(),
            arm,
            q: vec![S::zero(); n],
            trig: vec![(S::zero(), S::splat(1.0)); n],
            full: vec![S::zero(); 6 * n],
        }
    }

    /// Set the configuration `q`, `(n,)`, rad or m.
    pub fn move_to(&mut self, q: &[S]) {
        self.q.copy_from_slice(q);
        for (trig, q) in self.trig.iter_mut().zip(q) {
            *trig = q.sin_cos();
        }
    }

    /// (sin, cos) of each coordinate.
    pub fn trig(&self) -> &[(S, S)] {
        &self.trig
    }

    /// Compute the mass matrix `M(q)`, `(n, n)`.
    pub fn mass_matrix(&mut self, m: &mut [S]) {
        self.arm.mass_matrix(&mut self.workspace, &self.trig, &self.q, m);
    }

    /// Compute the Coriolis matrix `C(q, v)`, `(n, n)`, in the Christoffel factorisation.
    pub fn coriolis_matrix(&mut self, v: &[S], c: &mut [S]) {
        self.arm.coriolis_matrix(&mut self.workspace, &self.trig, &self.q, v, c);
    }

    /// Compute the gravity torque `g(q)`, `(n,)`.
    pub fn gravity(&mut self, g: &mut [S]) {
        self.arm.gravity(&mut self.workspace, &self.trig, &self.q, g);
    }

    /// Compute the inverse dynamics `tau = M a + C v + g`, `(n,)`.
    pub fn inverse_dynamics(&mut self, v: &[S], a: &[S], tau: &mut [S]) {
        self.arm.inverse_dynamics(&mut self.workspace, &self.trig, &self.q, v, a, tau);
    }

    /// Compute the Slotine-Li regressor `Y(q, v, v_r, a_r)`, `(n, p)`, for `p` inertial parameters.
    pub fn regressor(&mut self, v: &[S], v_r: &[S], a_r: &[S], y: &mut [S]) {
        self.arm.regressor(&mut self.workspace, &self.trig, &self.q, [v, v_r, a_r], y);
    }

    /// Kinetic and potential energy, J, at the velocity `v`.
    pub fn energy(&mut self, v: &[S]) -> (S, S) {
        self.arm.energy(&mut self.workspace, &self.trig, &self.q, v)
    }

    /// Position of a frame, m, world axes.
    pub fn position(&mut self, frame: usize) -> Vector3<S> {
        self.arm.position(&mut self.workspace, &self.trig, &self.q, frame)
    }

    /// Position of a frame, m, world axes, and its geometric Jacobian, `(6, n)`.
    pub fn jacobian(&mut self, frame: usize) -> (Vector3<S>, &[S]) {
        let position = self.arm.jacobian(&mut self.workspace, &self.trig, &self.q, frame, &mut self.full);
        (position, &self.full)
    }

    /// The acceleration of a frame at the velocity `v` and zero joint accelerations, `[v; w]` in world axes.
    pub fn bias_acceleration(&mut self, v: &[S], frame: usize) -> [Vector3<S>; 2] {
        self.arm.bias_acceleration(&mut self.workspace, (&self.trig, &self.q), v, frame)
    }

    /// Compute the error `e`, `(m,)`, of `m` Cartesian coordinates to `target`, and their Jacobian `j`, `(m, n)`.
    pub fn error_and_jacobian(&mut self, coordinates: &Coordinates, target: &[S], e: &mut [S], j: &mut [S]) {
        self.arm.error_and_jacobian(&mut self.workspace, coordinates, &mut self.full, (&self.trig, &self.q), target, (e, j));
    }
}
