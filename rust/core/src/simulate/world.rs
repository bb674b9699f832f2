//! The exogenous inputs of a loop: desired motions and external forces, of one run or of one run per lane.

use super::problem::force::{Force, Wrench};
use crate::motion::{Motion, Side, Table};
use crate::scalar::Real;
use std::borrow::Cow;

/// The time step of finite differences of the desired acceleration and of a smooth force, s. The resulting error of the time derivative is
/// proportional to this step.
const JERK_STEP: f64 = 1e-6;

/// The exogenous input of a loop at one instant.
#[derive(Clone)]
pub struct Exogenous<S> {
    pub t: f64,
    /// The desired motions, one after another. Each is `[x_d, x_d_dot, x_d_ddot]`, in the units of the task, per s and per s^2 for the
    /// derivatives.
    pub desired: Vec<S>,
    pub wrench: [S; 6],
}

/// The sources of exogenous inputs. A desired motion applies to all lanes, or each lane has a separate motion. The same rule applies to
/// forces.
pub struct World<'a> {
    motions: Vec<Vec<Cow<'a, Motion>>>,
    forces: Vec<Cow<'a, Force>>,
    /// The wrench that replaces the forces, if any.
    pushed: Option<Wrench>,
    /// Memory for the samples of one motion in all lanes.
    rows: Vec<f64>,
    lanes: usize,
    width: usize,
}

impl<'a> World<'a> {
    /// Create the sources for `lanes` lanes from `motions(lane)` and `force(lane)`.
    pub fn new(lanes: usize, motions: impl Fn(usize) -> Vec<&'a Motion>, force: impl Fn(usize) -> Option<&'a Force>) -> Self {
        let per_lane: Vec<Vec<&Motion>> = (0..lanes).map(motions).collect();
        let gather = |k: usize| {
            let column: Vec<&Motion> = per_lane.iter().map(|motions| motions[k]).collect();
            if column.iter().all(|m| m.is_same(column[0])) { vec![column[0]] } else { column }
        };
        let motions: Vec<Vec<&Motion>> = (0..per_lane[0].len()).map(gather).collect();
        let motions: Vec<Vec<Cow<Motion>>> = motions.into_iter().map(|lanes| lanes.into_iter().map(Cow::Borrowed).collect()).collect();
        let mut forces: Vec<&Force> = (0..lanes).filter_map(force).collect();
        if forces.iter().all(|&f| std::ptr::eq(f, forces[0])) {
            forces.truncate(1);
        }
        let width = motions.iter().map(|motions| 3 * motions[0].dof()).sum();
        let widest = motions.iter().map(|motions| 3 * motions[0].dof()).max().unwrap_or(0);
        let forces = forces.into_iter().map(Cow::Borrowed).collect();
        World { motions, forces, pushed: None, rows: vec![0.0; widest * lanes], lanes, width }
    }

    /// Return the sources with owned copies of motions and forces.
    pub fn into_owned(self) -> World<'static> {
        World {
            motions: self.motions.into_iter().map(|lanes| lanes.into_iter().map(|m| Cow::Owned(m.into_owned())).collect()).collect(),
            forces: self.forces.into_iter().map(|force| Cow::Owned(force.into_owned())).collect(),
            pushed: self.pushed,
            rows: self.rows,
            lanes: self.lanes,
            width: self.width,
        }
    }

    /// Whether a force is given as a function of time.
    pub fn has_smooth_force(&self) -> bool {
        self.forces.iter().any(|force| matches!(**force, Force::Signal(_)))
    }

    /// Whether all desired motions are constant.
    pub fn has_targets(&self) -> bool {
        !self.motions.iter().flatten().any(|motion| motion.moves())
    }

    /// Whether forces act.
    pub fn has_forces(&self) -> bool {
        !self.forces.is_empty() || self.pushed.is_some()
    }

    /// Whether all desired motions are constant and no force acts.
    pub fn is_still(&self) -> bool {
        self.has_targets() && !self.has_forces()
    }

    /// Apply `wrench` instead of the forces. `None` restores the forces.
    pub fn push(&mut self, wrench: Option<&Wrench>) {
        self.pushed = wrench.copied();
    }

    /// Return memory for the input at one instant.
    pub fn instant<S: Real>(&self) -> Exogenous<S> {
        Exogenous { t: f64::NAN, desired: vec![S::zero(); self.width], wrench: [S::zero(); 6] }
    }

    #[inline(never)]
    pub fn sample<S: Real>(&mut self, t: f64, u: &mut Exogenous<S>) {
        u.t = t;
        let mut at = 0;
        for motions in &self.motions {
            let width = 3 * motions[0].dof();
            for (motion, row) in motions.iter().zip(self.rows.chunks_exact_mut(width.max(1))) {
                motion.sample(t, row);
            }
            let first = |lane: usize| if motions.len() == 1 { 0 } else { lane * width };
            for (k, out) in u.desired[at..at + width].iter_mut().enumerate() {
                *out = S::from_lanes(|lane| self.rows[first(lane) + k]);
            }
            at += width;
        }
        match (&self.pushed, self.forces.as_slice()) {
            (Some(wrench), _) => u.wrench = wrench.map(S::splat),
            (None, []) => {}
            (None, [force]) => u.wrench = force.at(t).map(S::splat),
            (None, forces) => {
                for (lane, force) in forces.iter().enumerate().take(self.lanes) {
                    self.rows_of_wrench(lane, force.at(t), u);
                }
            }
        }
    }

    /// Compute the exogenous input at time `t`, s, and its time derivative.
    pub fn drift<S: Real>(&mut self, t: f64, u: &mut Exogenous<S>, u_dot: &mut Exogenous<S>) {
        self.sample(t, u);
        self.sample(t + JERK_STEP, u_dot);
        let slope = |from: S, to: S| (to - from) / S::splat(JERK_STEP);
        let mut at = 0;
        for motions in &self.motions {
            let m = motions[0].dof();
            for i in at..at + m {
                u_dot.desired[i + 2 * m] = slope(u.desired[i + 2 * m], u_dot.desired[i + 2 * m]);
                (u_dot.desired[i], u_dot.desired[i + m]) = (u.desired[i + m], u.desired[i + 2 * m]);
            }
            at += 3 * m;
        }
        for (rate, &from) in u_dot.wrench.iter_mut().zip(&u.wrench) {
            // A piecewise constant force has the derivative zero between its jumps.
            *rate = if self.has_smooth_force() { slope(from, *rate) } else { S::zero() };
        }
    }

    /// Return the table whose rows are the complete exogenous input. The result is `None` for other inputs.
    pub fn only_table(&self) -> Option<&Table> {
        let ([motions], []) = (self.motions.as_slice(), self.forces.as_slice()) else { return None };
        let [motion] = motions.as_slice() else { return None };
        if let Motion::Table(table) = &**motion { Some(table) } else { None }
    }

    /// Write the exogenous input of lane `lane` at each time of `times` to a row of `width` numbers. Rows of `out` are `stride` numbers apart.
    /// A row contains the desired motions. The wrench follows if `width` includes it. Values that lanes share are written only for lane 0.
    pub fn sample_each(&self, lane: usize, times: &[f64], [width, stride]: [usize; 2], out: &mut [f64]) {
        let own = |count: usize| if count > 1 { Some(lane) } else { (lane == 0).then_some(0) };
        let mut at = 0;
        for motions in &self.motions {
            if let Some(which) = own(motions.len()) {
                motions[which].sample_each(times, stride, &mut out[at..]);
            }
            at += 3 * motions[0].dof();
        }
        if let (true, Some(which)) = (at < width, own(self.forces.len())) {
            for (&t, row) in times.iter().zip(out.chunks_mut(stride)) {
                row[at..width].copy_from_slice(&self.pushed.unwrap_or_else(|| self.forces[which].at(t)));
            }
        }
    }

    /// Write the exogenous input of lane 0 at time `t` to `out`. The motions are evaluated by [`Motion::sample_with`].
    pub(super) fn sample_with(&self, base: &World, t: f64, side: Side, out: &mut [f64]) {
        let mut at = 0;
        for (motions, base) in self.motions.iter().zip(&base.motions) {
            let width = 3 * motions[0].dof();
            motions[0].sample_with(&base[0], t, side, &mut out[at..at + width]);
            at += width;
        }
        if let Some(force) = self.forces.first().filter(|_| at < out.len()) {
            out[at..].copy_from_slice(&force.at(t));
        }
    }

    fn rows_of_wrench<S: Real>(&self, lane: usize, wrench: [f64; 6], u: &mut Exogenous<S>) {
        for (to, from) in u.wrench.iter_mut().zip(wrench) {
            let before = *to;
            *to = S::from_lanes(|i| if i == lane { from } else { before.lane(i) });
        }
    }
}
