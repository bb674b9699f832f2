//! Adaptive tracking (Slotine and Li 1987):
//!
//! `e = q_d - q`, `Lambda = Kd^-1 Kp`, `v_r = v_d + Lambda e`, `a_r = a_d + Lambda e_dot`, `s = v_r - v`,
//! `tau = Y(q, v, v_r, a_r) a_hat + Kp e + Kd e_dot = Y a_hat + Kd s`, `a_hat_dot = Gamma Y' s`.
//!
//! The regressor `Y` satisfies `Y a = M(q) a_r + C(q, v) v_r + g(q)` for the inertial parameters `a`. The prime is the transpose.
//!
//! Rotor inertias (armature) and friction may be among the estimated parameters `a` (`joint_columns`). If rotor inertias are not estimated,
//! they are known, and the torque `armature a_r` is added.

use crate::dynamics::{AnyArm, Dynamics, Workspace};
use crate::linalg::gain::AnyGain;
use crate::scalar::Real;
use crate::trace::Sym;

/// The law in a control loop, without its options.
pub struct Adaptive {
    pub(super) arm: AnyArm<Sym>,
    pub(super) workspace: Workspace<Sym>,
    lambda: AnyGain<Sym>,
    kd: AnyGain<Sym>,
    pub(super) gamma: AnyGain<Sym>,
    pub(super) s: Vec<Sym>,
    pub(super) e: Vec<Sym>,
    pub(super) e_dot: Vec<Sym>,
    pub(super) v_r: Vec<Sym>,
    pub(super) a_r: Vec<Sym>,
    pub(super) yt_s: Vec<Sym>,
}

impl Adaptive {
    /// Create the law with its buffers.
    pub fn new(arm: AnyArm<Sym>, lambda: AnyGain<Sym>, kd: AnyGain<Sym>, gamma: AnyGain<Sym>) -> Self {
        let (n, p) = (arm.dof(), arm.parameter_count());
        let zeros = || vec![Sym::zero(); n];
        Adaptive {
            workspace: arm.workspace(),
            arm,
            lambda,
            kd,
            gamma,
            s: zeros(),
            e: zeros(),
            e_dot: zeros(),
            v_r: zeros(),
            a_r: zeros(),
            yt_s: vec![Sym::zero(); p],
        }
    }

    /// Compute the torque `tau` for the parameters `pi`. The law stores the sliding variable `s`, the reference acceleration `a_r`, and the
    /// product `Y' s` with the regressor `Y`.
    pub(super) fn torque(&mut self, desired: &[Sym], trig: &[(Sym, Sym)], x: &[Sym], pi: &[Sym], tau: &mut [Sym]) {
        let n = tau.len();
        let (q, v) = (&x[..n], &x[n..2 * n]);
        let Adaptive { s, e, e_dot, v_r, a_r, .. } = self;
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
        self.arm.regressor_products(&mut self.workspace, trig, q, [v, v_r, a_r], (pi, tau), (s, &mut self.yt_s));
    }

    /// The dissipation `s' Kd s`, W.
    pub(super) fn dissipation(&self) -> Sym {
        self.kd.quadratic(&self.s)
    }
}
