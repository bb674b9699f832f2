//! PID control with gravity compensation (Arimoto and Miyazaki 1984): `u = Kp (q_d - q) - Kd v + w + g(q)`, `tau` = `u` within the limits,
//!
//! with the integral torque `w` as the law's state, `w' = Ki (q_d - q)`. While `u_i` exceeds the limit of joint `i`, `w_i` does not go further
//! that way (conditional integration, Astrom and Hagglund 2006, section 3.5): a long saturation leaves no integral behind.

use super::{Build, Definition, Instant, JointReference, Law, PdGravity, PdGravitySpec, Term, require_rows, require_size};
use crate::dynamics::Model;
use crate::error::{Error, Result};
use crate::linalg::gain::{AnyGain, Gain, Multiply};
use crate::motion::Motion;
use crate::plant::PlantKind;
use crate::scalar::Real;
use nalgebra::DVector;

/// PID with gravity compensation, validated.
#[derive(Clone, Debug, PartialEq)]
pub struct PidSpec {
    /// The law without its integral and limits: the model, the target, `Kp` and `Kd`.
    pub pd: PdGravitySpec,
    /// Integral gain, N m/(rad s) or N/(m s).
    pub ki: Gain,
    /// The largest torques `(n,)`, N m or N; `None` without limits.
    tau_max: Option<Vec<f64>>,
    start: Vec<f64>,
}

impl PidSpec {
    /// The law of this model for a target `(n,)`, with gains `Kp, Ki, Kd`, without limits of torque. It starts with no integral.
    pub fn new(model: Model, target: impl Into<DVector<f64>>, [kp, ki, kd]: [Gain; 3]) -> Result<Self> {
        let pd = PdGravitySpec::new(model, target, kp, kd)?;
        let n = pd.model().n();
        require_size("ki", &ki, n)?;
        Ok(PidSpec { pd, ki, tau_max: None, start: vec![0.0; n] })
    }

    /// The law with its torques within `-tau_max` and `tau_max`, `(n,)`; infinity is no limit.
    pub fn limited(self, tau_max: Vec<f64>) -> Result<Self> {
        require_rows("tau_max", self.start.len(), tau_max.len())?;
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
        self.pd.model()
    }
    fn motions(&self) -> Vec<&Motion> {
        self.pd.motions()
    }
    fn initial_state(&self) -> &[f64] {
        &self.start
    }
    fn joint_reference(&self) -> Option<JointReference> {
        self.pd.joint_reference()
    }

    /// The terms of PD control, the integral torque and its rate, the torque before its limits and within them.
    fn terms(&self, at: &Instant) -> Vec<Term> {
        let n = self.start.len();
        let mut law = Self::build::<f64>(|_| self);
        let (mut tau, mut rate) = (vec![0.0; n], vec![0.0; n]);
        law.evaluate(at.desired, at.trig, at.x, at.z, &mut tau, &mut rate);
        let mut terms = self.pd.terms(at);
        terms.retain(|(name, ..)| *name != "tau");
        let vectors = [("integral", at.z.to_vec()), ("integral_rate", rate), ("u", law.free), ("tau", tau)];
        terms.extend(vectors.map(|(name, values)| (name, vec![n], values)));
        terms
    }
}

impl Build for PidSpec {
    type Lanes<S: Real> = Pid<S>;

    fn build<'a, S: Real>(of: impl Fn(usize) -> &'a Self) -> Pid<S> {
        let n = of(0).start.len();
        let limit = |k: usize| S::from_lanes(|i| of(i).tau_max.as_ref().map_or(f64::INFINITY, |limits| limits[k]));
        Pid {
            pd: PdGravitySpec::build(|i| &of(i).pd),
            ki: AnyGain::labelled("ki", |i| &of(i).ki),
            limits: of(0).tau_max.as_ref().map(|_| S::labelled("law_tau_max", 1, || (0..n).map(limit).collect())),
            e: vec![S::zero(); n],
            free: vec![S::zero(); n],
        }
    }

    fn same_shape(&self, other: &Self) -> bool {
        self.tau_max.is_some() == other.tau_max.is_some()
    }
}

/// The law in a loop.
pub struct Pid<S: Real> {
    pd: PdGravity<S>,
    ki: AnyGain<S>,
    limits: Option<Vec<S>>,
    /// `q_d - q`.
    e: Vec<S>,
    /// `u`: the torque before its limits.
    free: Vec<S>,
}

impl<S: Real> Law<S> for Pid<S> {
    fn evaluate(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], z: &[S], tau: &mut [S], dz: &mut [S]) {
        self.pd.evaluate(desired, trig, x, &[], tau, &mut []);
        for (i, e) in self.e.iter_mut().enumerate() {
            *e = desired[i] - x[i];
        }
        self.ki.multiply(&self.e, dz);
        for (tau, &w) in tau.iter_mut().zip(z) {
            *tau += w;
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
