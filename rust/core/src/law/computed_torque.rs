//! Computed torque (inverse-dynamics control):
//!
//! `tau = M(q) (a_d + Kd e_dot + Kp e) + C(q, v) v + g(q)`, so that `e_ddot + Kd e_dot + Kp e = 0` on the
//! exact model. `Kp` is in 1/s^2 and `Kd` in 1/s.

use super::gain::{Full, Gain, Multiply};
use super::{Law, Term, require_same_dof, require_size};
use crate::dynamics::{Dynamics, PlanarPr};
use crate::error::Result;
use crate::motion::Motion;
use crate::scalar::Real;

#[derive(Clone, Debug, PartialEq)]
pub struct ComputedTorqueSpec {
    pub(super) arm: PlanarPr<f64>,
    pub(super) motion: Motion,
    pub kp: Gain,
    pub kd: Gain,
}

impl ComputedTorqueSpec {
    pub fn new(arm: PlanarPr<f64>, motion: Motion, kp: Gain, kd: Gain) -> Result<Self> {
        let n = Dynamics::<f64>::dof(&arm);
        require_same_dof(n, &motion)?;
        require_size("kp", &kp, n)?;
        require_size("kd", &kd, n)?;
        Ok(ComputedTorqueSpec { arm, motion, kp, kd })
    }
}

impl ComputedTorqueSpec {
    /// The torque `(n,)` at one instant.
    pub(super) fn input(&self, t: f64, q: &[f64], v: &[f64], tau: &mut [f64]) {
        let mut desired = [0.0; 6];
        self.motion.sample(t, &mut desired);
        let full = |k: &Gain| [k.at(0, 0), k.at(0, 1), k.at(1, 0), k.at(1, 1)];
        let mut law = ComputedTorque::new(self.arm, Full(full(&self.kp)), Full(full(&self.kd)), [0.0; 2]);
        let trig = [Real::sin_cos(q[0]), Real::sin_cos(q[1])];
        law.evaluate(&desired, &trig, &[q[0], q[1], v[0], v[1]], &[], tau, &mut []);
    }
}

/// The law in a loop.
pub struct ComputedTorque<S: Real, D: Dynamics<S>, J, B> {
    arm: D,
    workspace: D::Workspace,
    kp: J,
    kd: J,
    e: B,
    e_dot: B,
    kp_e: B,
    command: B,
    scalar: std::marker::PhantomData<S>,
}

impl<S: Real, D: Dynamics<S>, J, B: Clone> ComputedTorque<S, D, J, B> {
    #[inline(always)]
    pub fn new(arm: D, kp: J, kd: J, joints: B) -> Self {
        let workspace = arm.workspace();
        let zero = || joints.clone();
        ComputedTorque { arm, workspace, kp, kd, e: zero(), e_dot: zero(), kp_e: zero(), command: zero(), scalar: Default::default() }
    }
}

impl<S, D, J, B> Law<S> for ComputedTorque<S, D, J, B>
where
    S: Real,
    D: Dynamics<S>,
    J: Multiply<S>,
    B: AsRef<[S]> + AsMut<[S]>,
{
    #[inline(always)]
    fn evaluate(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], _: &[S], tau: &mut [S], _: &mut [S]) {
        let n = tau.len();
        let (q, v) = (&x[..n], &x[n..2 * n]);
        let (e, e_dot) = (self.e.as_mut(), self.e_dot.as_mut());
        let (kp_e, command) = (self.kp_e.as_mut(), self.command.as_mut());
        for i in 0..n {
            e[i] = desired[i] - q[i];
            e_dot[i] = desired[n + i] - v[i];
        }
        self.kp.multiply(e, kp_e);
        self.kd.multiply(e_dot, command);
        for i in 0..n {
            command[i] += kp_e[i] + desired[2 * n + i];
        }
        self.arm.inverse_dynamics(&mut self.workspace, trig, q, v, command, tau);
    }

    #[inline(always)]
    fn dissipation(&self) -> S {
        S::zero()
    }
}

/// `e`, `e_dot`, the commanded acceleration and the torque.
pub fn computed_torque_terms(law: &ComputedTorqueSpec, t: f64, q: &[f64], v: &[f64]) -> Vec<Term> {
    let n = q.len();
    let mut desired = vec![0.0; 3 * n];
    law.motion.sample(t, &mut desired);
    let e: Vec<f64> = (0..n).map(|i| desired[i] - q[i]).collect();
    let e_dot: Vec<f64> = (0..n).map(|i| desired[n + i] - v[i]).collect();
    let command: Vec<f64> =
        (0..n).map(|i| desired[2 * n + i] + (0..n).map(|j| law.kd.at(i, j) * e_dot[j] + law.kp.at(i, j) * e[j]).sum::<f64>()).collect();
    let trig: Vec<(f64, f64)> = q.iter().map(|q| Real::sin_cos(*q)).collect();
    let mut tau = vec![0.0; n];
    law.arm.inverse_dynamics(&mut (), &trig, q, v, &command, &mut tau);
    vec![
        ("q_d", vec![n], desired[..n].to_vec()),
        ("v_d", vec![n], desired[n..2 * n].to_vec()),
        ("a_d", vec![n], desired[2 * n..].to_vec()),
        ("e", vec![n], e),
        ("e_dot", vec![n], e_dot),
        ("a", vec![n], command),
        ("tau", vec![n], tau),
    ]
}
