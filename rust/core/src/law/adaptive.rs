//! Adaptive tracking (Slotine and Li 1987):
//!
//! `e = q_d - q`, `Lambda = Kd^-1 Kp`, `v_r = v_d + Lambda e`, `a_r = a_d + Lambda e_dot`, `s = v_r - v`,
//! `tau = Y(q, v, v_r, a_r) a_hat + Kp e + Kd e_dot = Y a_hat + Kd s`, `a_hat_dot = Gamma Y^T s`.

use super::gain::{Diagonal, Full, Gain, Multiply};
use super::{Law, Term, require_same_dof, require_size};
use crate::dynamics::{Dynamics, PlanarPr};
use crate::error::{Error, Result, finite};
use crate::motion::Motion;
use crate::scalar::Real;

#[derive(Clone, Debug, PartialEq)]
pub struct AdaptiveSpec {
    pub(super) arm: PlanarPr<f64>,
    pub(super) motion: Motion,
    pub kp: Gain,
    pub kd: Gain,
    /// `Kd^-1 Kp`.
    pub lambda: Gain,
    pub gamma: Gain,
    pub(super) estimate: Vec<f64>,
}

impl AdaptiveSpec {
    /// `estimate = None` starts from zero: the law needs no prior knowledge of the parameters.
    pub fn new(arm: PlanarPr<f64>, motion: Motion, kp: Gain, kd: Gain, gamma: Gain, estimate: Option<Vec<f64>>) -> Result<Self> {
        let (n, p) = (Dynamics::<f64>::dof(&arm), Dynamics::<f64>::parameter_count(&arm));
        require_same_dof(n, &motion)?;
        require_size("kp", &kp, n)?;
        require_size("kd", &kd, n)?;
        require_size("gamma", &gamma, p)?;
        let estimate = estimate.unwrap_or_else(|| vec![0.0; p]);
        if estimate.len() != p {
            return Err(Error::input("estimate", format!("has the wrong shape: expected ({p},), got ({},)", estimate.len())));
        }
        finite("estimate", &estimate)?;
        let lambda = kd.solve(&kp);
        Ok(AdaptiveSpec { arm, motion, kp, kd, lambda, gamma, estimate })
    }
}

impl AdaptiveSpec {
    /// The torque `(n,)` at one instant.
    pub(super) fn input(&self, t: f64, q: &[f64], v: &[f64], z: &[f64], tau: &mut [f64]) {
        let mut desired = [0.0; 6];
        self.motion.sample(t, &mut desired);
        let full = |k: &Gain| [k.at(0, 0), k.at(0, 1), k.at(1, 0), k.at(1, 1)];
        // The rate of the estimate is not asked for, so its gain does not matter.
        let mut law = Adaptive::new(self.arm, Full(full(&self.lambda)), Full(full(&self.kd)), Diagonal([1.0; 3]), [0.0; 2], [0.0; 3]);
        let trig = [Real::sin_cos(q[0]), Real::sin_cos(q[1])];
        let x = [q[0], q[1], v[0], v[1]];
        law.evaluate(&desired, &trig, &x, z, tau, &mut [0.0; 3]);
    }
}

/// The law in a loop: `B` holds joint vectors, `P` parameter vectors.
pub struct Adaptive<S, D: Dynamics<S>, J, G, B, P>
where
    S: Real,
{
    arm: D,
    workspace: D::Workspace,
    lambda: J,
    kd: J,
    gamma: G,
    s: B,
    e: B,
    e_dot: B,
    v_r: B,
    a_r: B,
    yt_s: P,
}

impl<S: Real, D: Dynamics<S>, J, G, B: Clone, P> Adaptive<S, D, J, G, B, P> {
    #[inline(always)]
    pub fn new(arm: D, lambda: J, kd: J, gamma: G, joints: B, parameters: P) -> Self {
        let workspace = arm.workspace();
        let zero = || joints.clone();
        Adaptive { arm, workspace, lambda, kd, gamma, s: zero(), e: zero(), e_dot: zero(), v_r: zero(), a_r: zero(), yt_s: parameters }
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
    #[inline(always)]
    fn evaluate(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], z: &[S], tau: &mut [S], dz: &mut [S]) {
        let n = tau.len();
        let (q, v) = (&x[..n], &x[n..2 * n]);
        let (e, e_dot) = (self.e.as_mut(), self.e_dot.as_mut());
        let (s, v_r, a_r) = (self.s.as_mut(), self.v_r.as_mut(), self.a_r.as_mut());
        for i in 0..n {
            e[i] = desired[i] - q[i];
            e_dot[i] = desired[n + i] - v[i];
            (s[i], v_r[i], a_r[i]) = (e_dot[i], desired[n + i], desired[2 * n + i]);
        }
        // Lambda e twice, fused with its two sums: no more work than once and two additions.
        self.lambda.add_to(e, s);
        self.lambda.add_to(e, v_r);
        self.lambda.add_to(e_dot, a_r);
        self.arm.regressor_products(&mut self.workspace, trig, q, v, v_r, a_r, z, s, tau, self.yt_s.as_mut());
        self.kd.add_to(s, tau);
        self.gamma.multiply(self.yt_s.as_ref(), dz);
    }

    /// `s^T Kd s`.
    #[inline(always)]
    fn dissipation(&self) -> S {
        let s = self.s.as_ref();
        let mut kd_s = self.s.clone();
        self.kd.multiply(s, kd_s.as_mut());
        let kd_s = kd_s.as_ref();
        let mut sum = s[0] * kd_s[0];
        for i in 1..s.len() {
            sum = s[i].mul_add(kd_s[i], sum);
        }
        sum
    }
}

/// `Y`, `s`, `v_r`, `a_r`, `e`, `e_dot`, the torque and the rate of the estimate.
pub fn adaptive_terms(law: &AdaptiveSpec, t: f64, q: &[f64], v: &[f64], z: &[f64]) -> Vec<Term> {
    let n = q.len();
    let p = z.len();
    let mut desired = vec![0.0; 3 * n];
    law.motion.sample(t, &mut desired);
    let e: Vec<f64> = (0..n).map(|i| desired[i] - q[i]).collect();
    let e_dot: Vec<f64> = (0..n).map(|i| desired[n + i] - v[i]).collect();
    let times = |k: &Gain, x: &[f64]| -> Vec<f64> { (0..k.n()).map(|i| (0..k.n()).map(|j| k.at(i, j) * x[j]).sum()).collect() };
    let (le, le_dot) = (times(&law.lambda, &e), times(&law.lambda, &e_dot));
    let v_r: Vec<f64> = (0..n).map(|i| desired[n + i] + le[i]).collect();
    let a_r: Vec<f64> = (0..n).map(|i| desired[2 * n + i] + le_dot[i]).collect();
    let s: Vec<f64> = (0..n).map(|i| v_r[i] - v[i]).collect();
    let trig: Vec<(f64, f64)> = q.iter().map(|q| Real::sin_cos(*q)).collect();
    let mut y = vec![0.0; n * p];
    law.arm.regressor(&mut (), &trig, q, v, &v_r, &a_r, &mut y);
    let kd_s = times(&law.kd, &s);
    let tau: Vec<f64> = (0..n).map(|i| (0..p).map(|j| y[i * p + j] * z[j]).sum::<f64>() + kd_s[i]).collect();
    let yt_s: Vec<f64> = (0..p).map(|j| (0..n).map(|i| y[i * p + j] * s[i]).sum()).collect();
    let rate = times(&law.gamma, &yt_s);
    let (n_shape, p_shape) = (vec![n], vec![p]);
    vec![
        ("q_d", n_shape.clone(), desired[..n].to_vec()),
        ("v_d", n_shape.clone(), desired[n..2 * n].to_vec()),
        ("a_d", n_shape.clone(), desired[2 * n..].to_vec()),
        ("e", n_shape.clone(), e),
        ("e_dot", n_shape.clone(), e_dot),
        ("v_r", n_shape.clone(), v_r),
        ("a_r", n_shape.clone(), a_r),
        ("s", n_shape.clone(), s),
        ("Y", vec![n, p], y),
        ("tau", n_shape, tau),
        ("estimate_rate", p_shape, rate),
    ]
}
