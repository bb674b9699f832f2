//! Momentum observer (`DeLuca2006`): it estimates the external torque from positions, velocities and motor torques, without accelerations.
//!
//! ```text
//! p = M v,   p_dot = tau + tau_ext - tau_f + C' v - g       (dM/dt = C + C', C the Christoffel factorisation)
//! r = K [ p(t) - p(0) - int (tau - tau_f + C' v - g + r) ds ]        =>        r_dot = K (tau_ext - r)
//! sampled: r_k = (I + K dt)^-1 (r_(k-1) + K (p_k - p_(k-1) - (tau - tau_f + C' v - g)_(k-1) dt))
//! ```
//!
//! Here `p` is the momentum, `r` the residual, `tau_f` the known friction, `tau_ext` the external torque, and `'` the transpose. The
//! observer also applies to the motors of elastic joints. Then the motor inertia `B` replaces `M`, the motor torque minus the joint torque
//! replaces `tau`, and `C = g = 0`. In this case, `r` estimates the motor friction with a negative sign.
//!
//! A wrench `F` at a frame with the Jacobian `J` has the residual `r = J' F`. From `r`, `F` is computed as a least-squares solution, with
//! singular values of `J'` below `eps` clamped (`linalg::clamp`). The rest is `r - J' F`. The touched link is the outermost link whose
//! joint has `|r_i|` above its threshold. A force on a link does not load the joints beyond that link.

mod contact;
mod momentum;
mod printed;

use crate::dynamics::Model;
use crate::error::{Error, Result, finite, positive};
use crate::linalg::cholesky::factor_into;
use crate::linalg::{AnyGain, Gain, Svd};
use crate::memory::zeros;
use momentum::{Gained, Momentum};
use std::ops::Range;

/// The state of an observer. Each array has one row of `n` numbers per arm.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::Gain};
/// use armlet_core::analysis::momentum_observer::MomentumObserver;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
///
/// let observer = || MomentumObserver::new(model.clone(), Gain::scalar("gain", 1, 10.0)?, false);
/// let (mut first, mut second) = (observer()?, observer()?);
/// first.reset(&[0.0], &[0.0])?;
/// // Without motor torque, the arm of 2 kg m^2 reaches 0.1 rad/s in 0.1 s. So the external torque is near 2 N m.
/// first.update(&[0.005], &[0.1], &[0.0], 0.1)?;
/// assert!((first.state().residual[0] - 10.0 * 0.2 / (1.0 + 10.0 * 0.1)).abs() < 1e-12);
/// second.resume(first.state().clone())?;
/// assert_eq!(second.state(), first.state());
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObserverState {
    /// The residual `r`, an estimate of the external torque, N m or N.
    pub residual: Vec<f64>,
    /// Momentum `p` at the last sample, kg m^2/s or kg m/s.
    pub momentum: Vec<f64>,
    /// Drift `C' v - g - tau_f` at the last sample, N m or N.
    pub drift: Vec<f64>,
}

impl ObserverState {
    fn zeros(size: usize) -> Result<Self> {
        Ok(ObserverState { residual: zeros(size)?, momentum: zeros(size)?, drift: zeros(size)? })
    }

    /// The index of the first number in the state that is not finite; `None` if all numbers are finite.
    fn bad(&self) -> Option<usize> {
        let sound = |i: &usize| self.residual[*i].is_finite() && self.momentum[*i].is_finite() && self.drift[*i].is_finite();
        (0..self.residual.len()).find(|i| !sound(i))
    }
}

/// The observer of one arm, or of several equal arms.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::Gain};
/// use armlet_core::analysis::momentum_observer::MomentumObserver;
///
/// // An arm of 2 kg m^2 without gravity and without motor torque. An external torque of 2 N m accelerates it with 1 rad/s^2.
/// let mut observer = MomentumObserver::new(Model::from(Arm::pendulum(2.0, 0.0)?), Gain::scalar("gain", 1, 10.0)?, false)?;
/// observer.set_thresholds(vec![0.5])?;
/// for k in 0..=100 {
///     let t = 0.01 * f64::from(k);
///     observer.update(&[0.5 * t * t], &[t], &[0.0], 0.01)?;
/// }
/// assert!((observer.state().residual[0] - 2.0).abs() < 1e-3);
/// assert_eq!(observer.contacts()?, [Some(0)]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct MomentumObserver {
    model: Model,
    /// Gain `K` as passed by the caller.
    given: Gain,
    gain: AnyGain<f64>,
    /// Known viscous friction, N m s/rad or N s/m, and Coulomb friction, N m or N, `(n,)` each; zero if unknown.
    friction: [Vec<f64>; 2],
    takes_friction: bool,
    motors: Option<Gain>,
    thresholds: Option<Vec<f64>>,
    sample: Momentum<f64>,
    state: ObserverState,
    /// Memory for the state after a sample. If all its numbers are finite, it replaces `state`.
    next: ObserverState,
    /// The `dt` for which `factor` was computed, s.
    dt: f64,
    /// The diagonal of `I + K dt` for a diagonal gain, or its Cholesky factor for a full gain.
    factor: Vec<f64>,
    sum: Vec<f64>,
    work: Vec<f64>,
    svd: Svd,
    transposed: Vec<f64>,
}

impl MomentumObserver {
    /// Create the observer of `model` with the gain `K`, of size `n`, 1/s. `friction` states whether the model's viscous and Coulomb
    /// friction is known. Errors: `WrongShape` for a gain of another size.
    pub fn new(model: Model, gain: Gain, friction: bool) -> Result<Self> {
        let n = model.n();
        if gain.n() != n {
            return Err(Error::wrong("gain", "size", n, gain.n()));
        }
        let known = model.friction(friction);
        Ok(MomentumObserver {
            sample: Momentum::new(&model, None, &known),
            friction: known,
            model,
            gain: AnyGain::new(&gain),
            given: gain,
            takes_friction: friction,
            motors: None,
            thresholds: None,
            state: ObserverState::default(),
            next: ObserverState::default(),
            dt: f64::NAN,
            factor: vec![0.0; n * n],
            sum: vec![0.0; n * n],
            work: vec![0.0; n],
            svd: Svd::new(n, 6),
            transposed: vec![0.0; 6 * n],
        })
    }

    /// Observe motors of the inertia `B`, of size `n`, kg m^2 or kg. Samples are then motor positions, motor velocities, and motor torques
    /// minus joint torques. Errors: `Input` for an observer with known friction, `WrongShape` for another size.
    pub fn of_motors(mut self, inertia: Gain) -> Result<Self> {
        if self.takes_friction {
            let problem = "goes with no motor_inertia: expected False, since the model's friction is that of its joints, got True";
            return Err(Error::input("friction", problem));
        }
        if inertia.n() != self.n() {
            return Err(Error::wrong("motor_inertia", "size", self.n(), inertia.n()));
        }
        self.sample = Momentum::new(&self.model, Some(&inertia), &self.friction);
        self.motors = Some(inertia);
        Ok(self)
    }

    /// The model, the gain `K`, and the known viscous and Coulomb friction; `None` for an observer of motors.
    pub fn of_links(&self) -> Option<(&Model, &Gain, &[Vec<f64>; 2])> {
        self.motors.is_none().then_some((&self.model, &self.given, &self.friction))
    }

    /// Number of joints.
    pub fn n(&self) -> usize {
        self.model.n()
    }

    /// The state of the observer; empty before the first sample.
    pub fn state(&self) -> &ObserverState {
        &self.state
    }

    /// The number of observed arms; 0 before the first sample.
    pub fn rows(&self) -> usize {
        self.state.residual.len() / self.n()
    }

    /// Continue from a stored state. Errors: `Input` for wrong sizes or numbers that are not finite.
    pub fn resume(&mut self, state: ObserverState) -> Result<()> {
        let size = state.residual.len();
        if !size.is_multiple_of(self.n()) || state.momentum.len() != size || state.drift.len() != size {
            return Err(Error::input("state", format!("has the wrong size: expected three times rows of {}", self.n())));
        }
        for (name, values) in [("residual", &state.residual), ("momentum", &state.momentum), ("drift", &state.drift)] {
            finite(name, values)?;
        }
        (self.next, self.state) = (ObserverState::zeros(size)?, state);
        Ok(())
    }

    /// Start at positions `q` and velocities `v`, rows of `n`, with the residual zero. Errors: as for [`MomentumObserver::update`].
    pub fn reset(&mut self, q: &[f64], v: &[f64]) -> Result<()> {
        self.check(&[("q", q), ("v", v)], None)?;
        let n = self.n();
        let [mut state, next] = [ObserverState::zeros(q.len())?, ObserverState::zeros(q.len())?];
        for first in (0..q.len()).step_by(n) {
            self.write_sample(&mut state, q, v, first..first + n);
        }
        self.accepted(&state, q, v, None)?;
        (self.state, self.next) = (state, next);
        Ok(())
    }

    /// Process a sample: positions and velocities now, and the torques since the last sample, `dt` seconds ago; rows of `n`.
    ///
    /// The first sample only starts the observer. Errors: `WrongShape` for a wrong size. `Input` for a `dt` that is not positive, no row,
    /// or numbers that are not finite, also in the new state. After an error, the state is unchanged.
    pub fn update(&mut self, q: &[f64], v: &[f64], tau: &[f64], dt: f64) -> Result<()> {
        positive("dt", dt)?;
        if self.rows() == 0 {
            self.check(&[("q", q), ("v", v), ("tau", tau)], None)?;
            return self.reset(q, v);
        }
        self.check(&[("q", q), ("v", v), ("tau", tau)], Some(self.state.residual.len()))?;
        self.prepare(dt)?;
        let mut next = std::mem::take(&mut self.next);
        let n = self.n();
        for first in (0..q.len()).step_by(n) {
            let row = first..first + n;
            self.write_sample(&mut next, q, v, row.clone());
            self.correct(&mut next.residual[row.clone()], &next.momentum[row.clone()], &tau[row.clone()], row.start);
        }
        let accepted = self.accepted(&next, q, v, Some((tau, dt)));
        self.next = next;
        if accepted.is_ok() {
            std::mem::swap(&mut self.state, &mut self.next);
        }
        accepted
    }

    /// Correct the residual `r` of the row that starts at `first`. The correction is the change of momentum that the known torques do not
    /// explain.
    fn correct(&mut self, residual: &mut [f64], momentum: &[f64], tau: &[f64], first: usize) {
        let before = first..first + residual.len();
        residual.copy_from_slice(&self.state.residual[before.clone()]);
        let gained = Gained { momentum: &self.state.momentum[before.clone()], drift: &self.state.drift[before], now: momentum };
        gained.correct((&self.gain, &self.factor), (tau, self.dt), &mut self.work, residual);
    }

    /// Refuse a state that is not finite, and name the argument that caused it. `tau` has the torques and their duration.
    fn accepted(&self, state: &ObserverState, q: &[f64], v: &[f64], tau: Option<(&[f64], f64)>) -> Result<()> {
        let Some(bad) = state.bad() else { return Ok(()) };
        let (n, rows) = (self.n(), q.len() / self.n());
        let row = bad / n * n..(bad / n + 1) * n;
        let of_state = row.clone().any(|i| !(state.momentum[i].is_finite() && state.drift[i].is_finite()));
        // The error names the largest number of this row among those that can cause the overflow. Among equal numbers, it names the first.
        let sizes = |i: usize| match tau {
            Some((tau, dt)) if !of_state => [((tau[i] * dt).abs(), "tau", tau[i]), (state.momentum[i].abs(), "v", v[i])],
            _ => [(q[i].abs(), "q", q[i]), (v[i].abs(), "v", v[i])],
        };
        let all = row.rev().flat_map(|i| sizes(i).map(|size| (i, size)));
        let largest = all.max_by(|a, b| a.1.0.total_cmp(&b.1.0));
        let Some((i, (_, argument, value))) = largest else { return Ok(()) };
        let index = if rows > 1 { vec![i / n, i % n] } else { vec![i] };
        Err(Error::input(argument, format!("is too large: expected a finite residual, got {value:e}")).at(index))
    }

    /// Compute the diagonal of `I + K dt`, or its Cholesky factor.
    fn prepare(&mut self, dt: f64) -> Result<()> {
        if dt == self.dt {
            return Ok(());
        }
        let n = self.n();
        self.dt = f64::NAN;
        let finite = match &self.gain {
            AnyGain::Diagonal(k) => {
                self.factor.iter_mut().zip(k).for_each(|(f, k)| *f = k.mul_add(dt, 1.0));
                self.factor[..n].iter().all(|f| f.is_finite())
            }
            AnyGain::Full(k) => {
                for (at, (sum, k)) in self.sum.iter_mut().zip(k).enumerate() {
                    *sum = k.mul_add(dt, if at / n == at % n { 1.0 } else { 0.0 });
                }
                // `factor_into` returns one if `I + K dt` is positive definite, else zero. It is zero only after an overflow.
                factor_into(n, &self.sum, &mut self.factor) > 0.0
            }
        };
        if !finite {
            return Err(Error::input("dt", format!("is too large for this gain: expected a finite I + K dt, got {dt:e}")));
        }
        self.dt = dt;
        Ok(())
    }

    /// Write the momentum `p` and the drift `C' v - g - tau_f` of one arm to its entries `row` in the state.
    fn write_sample(&mut self, state: &mut ObserverState, q: &[f64], v: &[f64], row: Range<usize>) {
        let (momentum, drift) = (&mut state.momentum[row.clone()], &mut state.drift[row.clone()]);
        self.sample.momentum_and_drift(&q[row.clone()], &v[row], momentum, drift);
    }

    /// Require rows of `n` finite numbers, and equal lengths of all arguments.
    fn check(&self, arguments: &[(&str, &[f64])], length: Option<usize>) -> Result<()> {
        let n = self.n();
        let wanted = length.unwrap_or(arguments[0].1.len());
        if wanted == 0 {
            return Err(Error::input(arguments[0].0, format!("has no rows: expected at least one row of {n}")));
        }
        for (name, values) in arguments {
            if values.len() != wanted || !values.len().is_multiple_of(n) {
                return Err(Error::wrong(*name, "size", format!("{} rows of {n}", wanted / n), format!("{} numbers", values.len())));
            }
            finite(name, values)?;
        }
        Ok(())
    }
}
