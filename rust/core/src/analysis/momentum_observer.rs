//! Momentum observer (`DeLuca2006`): the torque from outside, from positions, velocities and motor torques, without accelerations.
//!
//! ```text
//! p = M v,   p' = tau + tau_ext - tau_f + C' v - g          (M' = C + C', C the Christoffel factorisation)
//! r = K [ p(t) - p(0) - int (tau - tau_f + C' v - g + r) ds ]        =>        r' = K (tau_ext - r)
//! sampled: r_k = (I + K dt)^-1 (r_(k-1) + K (p_k - p_(k-1) - (tau - tau_f + C' v - g)_(k-1) dt))
//! ```
//!
//! With `M = B`, `C = g = 0` and the torque `tau_m - tau_J` it observes the motors of elastic joints: `r` goes to minus their friction.
//!
//! At a frame `r = J' F`: `F` by least squares, singular values of `J'` below `eps` clamped (`linalg::clamp`); `r - J' F` is the rest.
//! The touched link is the outermost one whose joint has `|r_i|` above its threshold: what acts on a link loads no joint beyond it.

use crate::dynamics::{ArmAt, Model};
use crate::error::{Error, Result, finite, positive};
use crate::linalg::cholesky::{factor_into, solve};
use crate::linalg::{Gain, Svd, axpy, clamp_gain, dot};
use crate::scalar::sign;

/// Share of the largest row norm of `J'` below which singular values are clamped where nothing is said.
const SHARE: f64 = 0.02;

/// The state of an observer: rows of `n` numbers each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObserverState {
    /// The estimate of the torque from outside.
    pub residual: Vec<f64>,
    /// `p` at the last sample.
    pub momentum: Vec<f64>,
    /// `C' v - g - tau_f` there.
    pub drift: Vec<f64>,
}

/// The observer of one arm, or of several that move side by side.
pub struct MomentumObserver {
    model: Model,
    gain: Gain,
    /// Viscous and Coulomb friction that is taken off; zero where it is not known.
    friction: [Vec<f64>; 2],
    takes_friction: bool,
    motors: Option<Gain>,
    thresholds: Option<Vec<f64>>,
    arm: ArmAt<f64>,
    state: ObserverState,
    /// The state before the last sample, which comes back where that is refused.
    before: ObserverState,
    /// The `dt` of `factor`, which is of `I + K dt`.
    dt: f64,
    factor: Vec<f64>,
    mass: Vec<f64>,
    coriolis: Vec<f64>,
    work: Vec<f64>,
    svd: Svd,
    transposed: Vec<f64>,
}

impl MomentumObserver {
    /// The observer of this model with the gain `K`, 1/s, of size `n`. `friction`: the model's viscous and Coulomb friction is known.
    pub fn new(model: Model, gain: Gain, friction: bool) -> Result<Self> {
        let n = model.n();
        if gain.n() != n {
            return Err(Error::input("gain", format!("has the wrong size: expected {n}, got {}", gain.n())));
        }
        let of = |get: fn(&crate::arm::Joint) -> f64| match &model {
            Model::Tree(arm) if friction => arm.joints.iter().map(get).collect(),
            _ => vec![0.0; n],
        };
        let (takes_friction, friction) = (friction, [of(|joint| joint.damping), of(|joint| joint.friction)]);
        Ok(MomentumObserver {
            arm: ArmAt::of_lanes(|_| &model),
            model,
            gain,
            friction,
            takes_friction,
            motors: None,
            thresholds: None,
            state: ObserverState::default(),
            before: ObserverState::default(),
            dt: f64::NAN,
            factor: vec![0.0; n * n],
            mass: vec![0.0; n * n],
            coriolis: vec![0.0; n * n],
            work: vec![0.0; n],
            svd: Svd::new(n, 6),
            transposed: vec![0.0; 6 * n],
        })
    }

    /// The same for motors of this inertia `B`, which have positions, velocities and torques `tau_m - tau_J` of their own.
    pub fn of_motors(mut self, inertia: Gain) -> Result<Self> {
        if self.takes_friction {
            let problem = "goes with no motor_inertia: expected False, since the model's friction is that of its joints, got True";
            return Err(Error::input("friction", problem));
        }
        if inertia.n() != self.n() {
            return Err(Error::input("motor_inertia", format!("has the wrong size: expected {}, got {}", self.n(), inertia.n())));
        }
        self.motors = Some(inertia);
        Ok(self)
    }

    /// Number of joints.
    pub fn n(&self) -> usize {
        self.model.n()
    }

    /// What it remembers; empty before the first sample.
    pub fn state(&self) -> &ObserverState {
        &self.state
    }

    /// Go on from a state that was remembered.
    pub fn resume(&mut self, state: ObserverState) -> Result<()> {
        let size = state.residual.len();
        if !size.is_multiple_of(self.n()) || state.momentum.len() != size || state.drift.len() != size {
            return Err(Error::input("state", format!("has the wrong size: expected three times rows of {}", self.n())));
        }
        for (name, values) in [("residual", &state.residual), ("momentum", &state.momentum), ("drift", &state.drift)] {
            finite(name, values)?;
        }
        self.state = state;
        Ok(())
    }

    /// The thresholds of contact `(n,)`, > 0.
    pub fn set_thresholds(&mut self, thresholds: Vec<f64>) -> Result<()> {
        if thresholds.len() != self.n() {
            let problem = format!("has the wrong shape: expected ({},), got ({},)", self.n(), thresholds.len());
            return Err(Error::input("threshold", problem));
        }
        thresholds.iter().try_for_each(|&threshold| positive("threshold", threshold))?;
        self.thresholds = Some(thresholds);
        Ok(())
    }

    /// The thresholds of contact, where they are known.
    pub fn thresholds(&self) -> Option<&[f64]> {
        self.thresholds.as_deref()
    }

    /// Thresholds from residuals of free motion, rows of `n`: the size of their mean and so many standard deviations beside it.
    pub fn calibrate(&mut self, residuals: &[f64], sigmas: f64) -> Result<()> {
        let n = self.n();
        positive("sigmas", sigmas)?;
        finite("residuals", residuals)?;
        let rows = residuals.len() / n;
        if rows < 2 || !residuals.len().is_multiple_of(n) {
            return Err(Error::input(
                "residuals",
                format!("has the wrong shape: expected (K, {n}) with K >= 2, got {} numbers", residuals.len()),
            ));
        }
        let of_joint = |i: usize| residuals.iter().skip(i).step_by(n);
        let thresholds = (0..n).map(|i| {
            let mean = of_joint(i).sum::<f64>() / rows as f64;
            let square = of_joint(i).map(|r| (r - mean) * (r - mean)).sum::<f64>() / (rows - 1) as f64;
            mean.abs() + sigmas * square.sqrt()
        });
        let thresholds: Vec<f64> = thresholds.collect();
        if let Some(i) = thresholds.iter().position(|&threshold| !(threshold > 0.0)) {
            return Err(Error::input(
                "residuals",
                format!("have no noise: expected residuals that vary, got zeros (first bad index (0, {i}))"),
            ));
        }
        self.set_thresholds(thresholds)
    }

    /// Start at positions and velocities, rows of `n`, with no torque from outside.
    pub fn reset(&mut self, q: &[f64], v: &[f64]) -> Result<()> {
        self.check(&[("q", q), ("v", v)], None)?;
        self.before.clone_from(&self.state);
        self.state = ObserverState { residual: vec![0.0; q.len()], momentum: vec![0.0; q.len()], drift: vec![0.0; q.len()] };
        let n = self.n();
        for row in 0..q.len() / n {
            let at = row * n..(row + 1) * n;
            self.look(&q[at.clone()], &v[at.clone()]);
            self.state.momentum[at.clone()].copy_from_slice(&self.work);
            self.drift(&v[at.clone()], at);
        }
        self.accept(q, v, None)
    }

    /// A sample: positions and velocities now, and the torques that acted since the last one, `dt` ago; rows of `n`. The first sample starts.
    /// One after which a number would not be finite is refused, and changes nothing.
    pub fn update(&mut self, q: &[f64], v: &[f64], tau: &[f64], dt: f64) -> Result<()> {
        positive("dt", dt)?;
        if self.state.residual.is_empty() {
            self.check(&[("q", q), ("v", v), ("tau", tau)], None)?;
            return self.reset(q, v);
        }
        self.check(&[("q", q), ("v", v), ("tau", tau)], Some(self.state.residual.len()))?;
        let n = self.n();
        self.prepare(dt)?;
        self.before.clone_from(&self.state);
        for row in 0..q.len() / n {
            let at = row * n..(row + 1) * n;
            self.look(&q[at.clone()], &v[at.clone()]);
            let state = &mut self.state;
            let (residual, momentum) = (&mut state.residual[at.clone()], &mut state.momentum[at.clone()]);
            // What the momentum gained beyond what is known of.
            for (i, p) in momentum.iter_mut().enumerate() {
                let gained = self.work[i] - *p - (tau[row * n + i] + state.drift[row * n + i]) * dt;
                *p = self.work[i];
                self.work[i] = gained;
            }
            for (i, r) in residual.iter_mut().enumerate() {
                *r += if self.gain.is_diagonal() {
                    self.gain.at(i, i) * self.work[i]
                } else {
                    (0..n).map(|j| self.gain.at(i, j) * self.work[j]).sum()
                };
            }
            if self.gain.is_diagonal() {
                residual.iter_mut().zip(&self.factor).for_each(|(r, f)| *r /= f);
            } else {
                solve(n, &self.factor, residual);
            }
            self.drift(&v[at.clone()], at);
        }
        self.accept(q, v, Some((tau, dt)))
    }

    /// Refuse a sample after which a number is not finite, with the state before it. `tau`: the torques and how long they acted.
    fn accept(&mut self, q: &[f64], v: &[f64], tau: Option<(&[f64], f64)>) -> Result<()> {
        let ObserverState { residual, momentum, drift } = &self.state;
        let (n, rows) = (self.n(), residual.len() / self.n());
        let Some(bad) = (0..q.len()).find(|&i| !(residual[i].is_finite() && momentum[i].is_finite() && drift[i].is_finite())) else {
            return Ok(());
        };
        let row = bad / n * n..(bad / n + 1) * n;
        let of_state = row.clone().any(|i| !(momentum[i].is_finite() && drift[i].is_finite()));
        // The largest number of the row that bears on what overflows; of equal ones the first.
        let sizes = |i: usize| match tau {
            Some((tau, dt)) if !of_state => [((tau[i] * dt).abs(), "tau", tau[i]), (momentum[i].abs(), "v", v[i])],
            _ => [(q[i].abs(), "q", q[i]), (v[i].abs(), "v", v[i])],
        };
        let all = row.rev().flat_map(|i| sizes(i).map(|size| (i, size)));
        let largest = all.max_by(|a, b| a.1.0.total_cmp(&b.1.0));
        std::mem::swap(&mut self.state, &mut self.before);
        let Some((i, (_, argument, value))) = largest else { return Ok(()) };
        let index = if rows > 1 { format!("({}, {})", i / n, i % n) } else { format!("{i}") };
        let problem = format!("is too large: expected a finite residual, got {value:e} (first bad index {index})");
        Err(Error::input(argument, problem))
    }

    /// `I + K dt`: its diagonal, or its Cholesky factor.
    fn prepare(&mut self, dt: f64) -> Result<()> {
        if dt == self.dt {
            return Ok(());
        }
        let n = self.n();
        self.dt = f64::NAN;
        if self.gain.is_diagonal() {
            (0..n).for_each(|i| self.factor[i] = self.gain.at(i, i).mul_add(dt, 1.0));
            if self.factor[..n].iter().any(|f| !f.is_finite()) {
                return Err(self.too_large(dt));
            }
        } else {
            for k in 0..n * n {
                let one = if k / n == k % n { 1.0 } else { 0.0 };
                self.mass[k] = self.gain.at(k / n, k % n).mul_add(dt, one);
            }
            // The least pivot: that of a sum with the identity is positive but for overflow.
            if !(factor_into(n, &self.mass, &mut self.factor) > 0.0) {
                return Err(self.too_large(dt));
            }
        }
        self.dt = dt;
        Ok(())
    }

    fn too_large(&self, dt: f64) -> Error {
        Error::input("dt", format!("is too large for this gain: expected a finite I + K dt, got {dt:e}"))
    }

    /// Move the arm to `q`, with `p` in `work` and `M`, `C` at hand.
    fn look(&mut self, q: &[f64], v: &[f64]) {
        let n = self.model.n();
        if let Some(inertia) = &self.motors {
            (0..n).for_each(|i| self.work[i] = (0..n).map(|j| inertia.at(i, j) * v[j]).sum());
            return;
        }
        self.arm.move_to(q);
        self.arm.mass_matrix(&mut self.mass);
        for (p, row) in self.work.iter_mut().zip(self.mass.chunks_exact(n)) {
            *p = dot(row, v);
        }
    }

    /// `C' v - g - tau_f` where the arm is, into these places of the state.
    fn drift(&mut self, v: &[f64], at: std::ops::Range<usize>) {
        let n = self.model.n();
        let drift = &mut self.state.drift[at];
        if self.motors.is_some() {
            return drift.fill(0.0);
        }
        self.arm.gravity(drift);
        for (i, drift) in drift.iter_mut().enumerate() {
            *drift = -*drift - self.friction[0][i] * v[i] - self.friction[1][i] * sign(v[i]);
        }
        self.arm.coriolis_matrix(v, &mut self.coriolis);
        for (row, &v) in self.coriolis.chunks_exact(n).zip(v) {
            axpy(v, row, drift);
        }
    }

    /// The wrench `[f; m]` at a frame, rows of 6, and what of the residual it does not explain, rows of `n`; `eps`: see the head.
    pub fn wrench(&mut self, q: &[f64], frame: &str, eps: Option<f64>, out: &mut [f64], rest: &mut [f64]) -> Result<()> {
        if self.motors.is_some() {
            return Err(Error::input("frame", "is of no use: expected an observer of links, got one of motors"));
        }
        let frame = self.model.tree("frame")?.frame_index(frame)?;
        let n = self.n();
        if let Some(eps) = eps {
            positive("eps", eps)?;
        }
        if self.state.residual.is_empty() {
            return Err(Error::input("q", "comes too early: expected update() or reset() before"));
        }
        self.check(&[("q", q)], Some(self.state.residual.len()))?;
        for (row, q) in q.chunks_exact(n).enumerate() {
            let r = &self.state.residual[row * n..(row + 1) * n];
            self.arm.move_to(q);
            let (_, jacobian) = self.arm.jacobian(frame);
            for i in 0..n {
                for k in 0..6 {
                    self.transposed[6 * i + k] = jacobian[k * n + i];
                }
            }
            self.svd.decompose(&self.transposed, n, 6)?;
            let largest = self.transposed.chunks_exact(6).map(|row| dot(row, row).sqrt()).fold(0.0, f64::max);
            let eps = eps.unwrap_or(SHARE * largest);
            let f = &mut out[6 * row..6 * (row + 1)];
            f.fill(0.0);
            // Rounding of the Jacobian is no direction.
            let null = 1e-14 * largest;
            for j in 0..self.svd.s().len() {
                let sigma = self.svd.s()[j];
                if sigma > null {
                    axpy(clamp_gain(sigma, eps) * dot(self.svd.u(j), r), self.svd.v(j), f);
                }
            }
            for i in 0..n {
                rest[row * n + i] = r[i] - dot(&self.transposed[6 * i..6 * (i + 1)], f);
            }
        }
        Ok(())
    }

    /// The joint of the touched link of each row; `None` without contact.
    pub fn contacts(&self) -> Result<Vec<Option<usize>>> {
        let Some(thresholds) = &self.thresholds else {
            return Err(Error::input("threshold", "is missing: expected thresholds (n,) or calibrate() before"));
        };
        let parent = |i: usize| match &self.model {
            Model::Tree(arm) => arm.joints[i].parent,
            Model::PlanarPr(_) => i.checked_sub(1),
        };
        let n = self.n();
        let of_row = |r: &[f64]| {
            let above = |i: usize| r[i].abs() > thresholds[i];
            // Inwards of another one that is above, a joint carries what acts further out.
            let mut inner = vec![false; n];
            for i in (0..n).filter(|&i| above(i)) {
                let mut next = parent(i);
                while let Some(k) = next.filter(|&k| !inner[k]) {
                    inner[k] = true;
                    next = parent(k);
                }
            }
            let outermost = (0..n).filter(|&i| above(i) && !inner[i]);
            outermost.max_by(|&a, &b| (r[a].abs() / thresholds[a]).total_cmp(&(r[b].abs() / thresholds[b])))
        };
        Ok(self.state.residual.chunks_exact(n).map(of_row).collect())
    }

    /// Rows of `n` finite numbers, all of one length.
    fn check(&self, arguments: &[(&str, &[f64])], length: Option<usize>) -> Result<()> {
        let n = self.n();
        let wanted = length.unwrap_or(arguments[0].1.len());
        if wanted == 0 {
            return Err(Error::input(arguments[0].0, format!("has no rows: expected at least one row of {n}")));
        }
        for (name, values) in arguments {
            if values.len() != wanted || !values.len().is_multiple_of(n) {
                let problem = format!("has the wrong size: expected {} rows of {n}, got {} numbers", wanted / n, values.len());
                return Err(Error::input(*name, problem));
            }
            finite(name, values)?;
        }
        Ok(())
    }
}
