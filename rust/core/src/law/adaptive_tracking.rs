//! Adaptive tracking (Slotine and Li 1987):
//!
//! `e = q_d - q`, `Lambda = Kd^-1 Kp`, `v_r = v_d + Lambda e`, `a_r = a_d + Lambda e_dot`, `s = v_r - v`,
//! `tau = Y(q, v, v_r, a_r) a_hat + Kp e + Kd e_dot = Y a_hat + Kd s`, `a_hat_dot = Gamma Y' s`.
//!
//! The regressor `Y` satisfies `Y a = M(q) a_r + C(q, v) v_r + g(q)` for the inertial parameters `a`. The prime is the transpose.
//!
//! Rotor inertias (armature) and friction may be among the estimated parameters `a` (`joint_columns`). If rotor inertias are not estimated,
//! they are known, and the torque `armature a_r` is added.

use super::definition::Law;
use crate::dynamics::Dynamics;
use crate::linalg::gain::Multiply;
use crate::scalar::Real;

/// The law in a control loop. `D` is the type of the arm, `J` and `G` are the types of joint gains and of `Gamma`. `B` is the type of joint
/// vectors, `P` the type of parameter vectors.
pub struct Adaptive<S, D: Dynamics<S>, J, G, B, P>
where
    S: Real,
{
    pub(super) arm: D,
    pub(super) workspace: D::Workspace,
    lambda: J,
    kd: J,
    pub(super) gamma: G,
    pub(super) s: B,
    e: B,
    e_dot: B,
    pub(super) v_r: B,
    pub(super) a_r: B,
    pub(super) yt_s: P,
}

impl<S: Real, D: Dynamics<S>, J, G, B: Clone, P> Adaptive<S, D, J, G, B, P> {
    /// Create the law with its buffers.
    pub fn new(arm: D, lambda: J, kd: J, gamma: G, joints: B, parameters: P) -> Self {
        let workspace = arm.workspace();
        let zero = || joints.clone();
        Adaptive { arm, workspace, lambda, kd, gamma, s: zero(), e: zero(), e_dot: zero(), v_r: zero(), a_r: zero(), yt_s: parameters }
    }
}

impl<S, D, J, G, B, P> Adaptive<S, D, J, G, B, P>
where
    S: Real,
    D: Dynamics<S>,
    J: Multiply<S>,
    B: Clone + AsRef<[S]> + AsMut<[S]>,
    P: AsRef<[S]> + AsMut<[S]>,
{
    /// Compute the torque `tau` for the parameters `pi`. The law stores the sliding variable `s`, the reference acceleration `a_r`, and the
    /// product `Y' s` with the regressor `Y`.
    pub(super) fn torque(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], pi: &[S], tau: &mut [S]) {
        let n = tau.len();
        let (q, v) = (&x[..n], &x[n..2 * n]);
        let (e, e_dot) = (self.e.as_mut(), self.e_dot.as_mut());
        let (s, v_r, a_r) = (self.s.as_mut(), self.v_r.as_mut(), self.a_r.as_mut());
        for i in 0..n {
            e[i] = desired[i] - q[i];
            e_dot[i] = desired[n + i] - v[i];
            (s[i], v_r[i], a_r[i]) = (e_dot[i], desired[n + i], desired[2 * n + i]);
        }
        // `Lambda e` is computed twice, because the multiplication and each addition are fused.
        self.lambda.add_to(e, s);
        self.lambda.add_to(e, v_r);
        self.lambda.add_to(e_dot, a_r);
        self.kd.multiply(s, tau);
        self.arm.regressor_products(&mut self.workspace, trig, q, [v, v_r, a_r], (pi, tau), (s, self.yt_s.as_mut()));
    }
}

impl<S, D, J, G, B, P> Law<S> for Adaptive<S, D, J, G, B, P>
where
    S: Real,
    D: Dynamics<S>,
    J: Multiply<S>,
    G: Multiply<S>,
    B: Clone + AsRef<[S]> + AsMut<[S]>,
    P: AsRef<[S]> + AsMut<[S]>,
{
    fn evaluate(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], z: &[S], tau: &mut [S], dz: &mut [S]) {
        self.torque(desired, trig, x, z, tau);
        self.gamma.multiply(self.yt_s.as_ref(), dz);
    }

    /// The dissipation `s' Kd s`, W.
    fn dissipation(&self) -> S {
        self.kd.quadratic(self.s.as_ref())
    }
}
