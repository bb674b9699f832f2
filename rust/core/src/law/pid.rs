//! PID control with gravity compensation (Arimoto and Miyazaki 1984): `u = Kp (q_d - q) - Kd v + w + g(q)`, `tau` = `u` within the limits,
//!
//! with the integral torque `w` as the law's state, `w' = Ki (q_d - q)`. While `u_i` exceeds the limit of joint `i`, `w_i` does not go further
//! that way (conditional integration, Astrom and Hagglund 2006, section 3.5): a long saturation leaves no integral behind.

use super::{Build, Definition, Instant, JointReference, Law, Term, require_rows, require_size};
use crate::dynamics::{AnyArm, Dynamics, Model, Workspace};
use crate::error::{Error, Result, finite};
use crate::linalg::gain::{AnyGain, Gain, Multiply};
use crate::motion::Motion;
use crate::plant::PlantKind;
use crate::scalar::Real;
use nalgebra::DVector;

/// PID with gravity compensation, validated.
#[derive(Clone, Debug, PartialEq)]
pub struct PidSpec {
    model: Model,
    target: Motion,
    /// Position gain, N m/rad or N/m.
    pub kp: Gain,
    /// Integral gain, N m/(rad s) or N/(m s).
    pub ki: Gain,
    /// Velocity gain, N m s/rad or N s/m.
    pub kd: Gain,
    /// The largest torques `(n,)`, N m or N; `None` without limits.
    tau_max: Option<Vec<f64>>,
    start: Vec<f64>,
}

impl PidSpec {
    /// The law of this model for a target `(n,)`, with gains `Kp, Ki, Kd`, without limits of torque. It starts with no integral.
    pub fn new(model: Model, target: impl Into<DVector<f64>>, [kp, ki, kd]: [Gain; 3]) -> Result<Self> {
        let target = Vec::from(target.into().data);
        let n = model.n();
        require_rows("target", n, target.len())?;
        finite("target", &target)?;
        for (name, gain) in [("kp", &kp), ("ki", &ki), ("kd", &kd)] {
            require_size(name, gain, n)?;
        }
        Ok(PidSpec { model, target: Motion::Hold(target), kp, ki, kd, tau_max: None, start: vec![0.0; n] })
    }

    /// The law with its torques within `-tau_max` and `tau_max`, `(n,)`; infinity is no limit.
    pub fn limited(self, tau_max: Vec<f64>) -> Result<Self> {
        require_rows("tau_max", self.model.n(), tau_max.len())?;
        match tau_max.iter().position(|&limit| !(limit > 0.0)) {
            Some(i) => {
                Err(Error::input("tau_max", format!("is not positive: expected numbers > 0, got {} (first bad index {i})", tau_max[i])))
            }
            None => Ok(PidSpec { tau_max: Some(tau_max), ..self }),
        }
    }
}

impl Definition for PidSpec {
    fn name(&self) -> &'static str {
        "PID"
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
    fn initial_state(&self) -> &[f64] {
        &self.start
    }
    fn joint_reference(&self) -> Option<JointReference> {
        Some(JointReference::held(&self.target))
    }

    /// The error, gravity, the integral torque and its rate, the torque before its limits and within them.
    fn terms(&self, at: &Instant) -> Vec<Term> {
        let n = self.model.n();
        let mut law = Self::build::<f64>(|_| self);
        let (mut tau, mut rate) = (vec![0.0; n], vec![0.0; n]);
        law.evaluate(at.desired, at.trig, at.x, at.z, &mut tau, &mut rate);
        let e = (0..n).map(|i| at.desired[i] - at.x[i]).collect();
        let mut g = vec![0.0; n];
        self.model.at(&at.x[..n]).gravity(&mut g);
        let [q_d, w] = [&at.desired[..n], at.z].map(<[f64]>::to_vec);
        let vectors = [("q_d", q_d), ("e", e), ("g", g), ("integral", w), ("integral_rate", rate), ("u", law.free), ("tau", tau)];
        vectors.into_iter().map(|(name, values)| (name, vec![n], values)).collect()
    }
}

impl Build for PidSpec {
    type Lanes<S: Real> = Pid<S>;

    fn build<'a, S: Real>(of: impl Fn(usize) -> &'a Self) -> Pid<S> {
        let arm = AnyArm::from_lanes(|i| &of(i).model);
        let n = of(0).model.n();
        let limit = |k: usize| S::from_lanes(|i| of(i).tau_max.as_ref().map_or(f64::INFINITY, |limits| limits[k]));
        Pid {
            workspace: arm.workspace(),
            arm,
            kp: AnyGain::labelled("kp", |i| &of(i).kp),
            ki: AnyGain::labelled("ki", |i| &of(i).ki),
            kd: AnyGain::labelled("kd", |i| &of(i).kd),
            limits: of(0).tau_max.as_ref().map(|_| S::labelled("law_tau_max", 1, || (0..n).map(limit).collect())),
            work: vec![S::zero(); n],
            free: vec![S::zero(); n],
        }
    }

    fn same_shape(&self, other: &Self) -> bool {
        self.tau_max.is_some() == other.tau_max.is_some()
    }
}

/// The law in a loop.
pub struct Pid<S: Real> {
    arm: AnyArm<S>,
    workspace: Workspace<S>,
    kp: AnyGain<S>,
    ki: AnyGain<S>,
    kd: AnyGain<S>,
    limits: Option<Vec<S>>,
    work: Vec<S>,
    /// `u`: the torque before its limits.
    free: Vec<S>,
}

impl<S: Real> Law<S> for Pid<S> {
    fn evaluate(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], z: &[S], tau: &mut [S], dz: &mut [S]) {
        let n = tau.len();
        let (q, v) = (&x[..n], &x[n..2 * n]);
        self.arm.gravity(&mut self.workspace, trig, q, tau);
        for i in 0..n {
            self.work[i] = desired[i] - q[i];
        }
        self.kp.add_to(&self.work, tau);
        self.ki.multiply(&self.work, dz);
        for i in 0..n {
            self.work[i] = -v[i];
        }
        self.kd.add_to(&self.work, tau);
        for i in 0..n {
            tau[i] += z[i];
        }
        self.free.copy_from_slice(tau);
        let Some(limits) = &self.limits else { return };
        for (i, &limit) in limits.iter().enumerate() {
            let (free, rate) = (tau[i], dz[i]);
            let down = S::select(free.lt(-limit), rate.max(S::zero()), rate);
            dz[i] = S::select(limit.lt(free), rate.min(S::zero()), down);
            tau[i] = free.clamped(-limit, limit);
        }
    }
}
