//! The declined steps of a recorded loop: the state before them, and their repetition by the loops of [`super::redo`]. A program declines a
//! step if its results are not valid.

use super::program_loop::ProgramLoop;
use super::redo::Direct;
use crate::scalar::Real;

impl<'a, S: Real> ProgramLoop<'a, S> {
    /// Set the loops that repeat declined steps, one per lane.
    pub(super) fn redo_by(&mut self, direct: Vec<Box<dyn Direct + 'a>>) {
        self.redo.direct = direct;
    }

    /// Store the state before a step that may be declined.
    pub(super) fn remember(&mut self, x: &[S]) {
        if self.redo.direct.is_empty() {
            return;
        }
        self.redo.before.copy_from_slice(x);
        for lane in 0..S::LANES {
            self.redo.reach[lane] = self.number(self.recorded.layout.reach(), lane);
            self.set_number(self.recorded.layout.stands(), lane, 1.0);
        }
    }

    /// Whether the programs declined the step of a lane. A step from a state that is not finite is never declined.
    pub(super) fn declined(&self, lane: usize) -> bool {
        !self.redo.direct.is_empty()
            && self.number(self.recorded.layout.stands(), lane) != 1.0
            && self.redo.before.iter().all(|x| x.lane(lane).is_finite())
    }

    /// For lane `lane`, copy the state before the step to `redo.row`, and restore the largest angle at that time.
    pub(super) fn back(&mut self, lane: usize) {
        self.redo.row.0.iter_mut().zip(&self.redo.before).for_each(|(to, from)| *to = from.lane(lane));
        self.set_number(self.recorded.layout.reach(), lane, self.redo.reach[lane]);
    }

    /// Repeat the step `[t, end]` of size `h` in the lanes in which it was declined.
    pub(super) fn step_again(&mut self, t: f64, h: f64, end: f64, x: &mut [S]) {
        for lane in 0..S::LANES {
            if !self.declined(lane) {
                continue;
            }
            self.back(lane);
            let (state, tau, dz) = &mut self.redo.row;
            tau.iter_mut().zip(&self.tau).for_each(|(to, from)| *to = from.lane(lane));
            dz.iter_mut().zip(&self.dz).for_each(|(to, from)| *to = from.lane(lane));
            self.redo.direct[lane].step(t, h, end, self.held.then_some((&*tau, &*dz)), state);
            for (x, &new) in x.iter_mut().zip(&self.redo.row.0) {
                let others = *x;
                *x = S::from_lanes(|i| if i == lane { new } else { others.lane(i) });
            }
        }
    }

    /// Compute the norms of error and residual of each priority level again at state `x`, in lanes where the program's norms are not valid.
    /// Lanes whose state is not finite are omitted.
    pub(super) fn norms_again(&mut self, t: f64, x: &[S]) {
        let (stands, first) = (self.recorded.layout.noted_stands(), self.recorded.layout.own_firsts() - self.redo.norms.len());
        let lanes = if self.redo.norms.is_empty() { 0 } else { S::LANES };
        for lane in 0..lanes {
            if self.number(stands, lane) == 1.0 || !x.iter().all(|x| x.lane(lane).is_finite()) {
                continue;
            }
            let (state, norms) = (&mut self.redo.row.0, &mut self.redo.norms);
            state.iter_mut().zip(x).for_each(|(to, from)| *to = from.lane(lane));
            self.redo.direct[lane].norms(t, state, norms);
            for k in 0..self.redo.norms.len() {
                self.set_number(first + k, lane, self.redo.norms[k]);
            }
        }
    }

    /// Evaluate the law again in the lanes in which the program declined its result.
    pub(super) fn answer_again(&mut self, t: f64) {
        let (first, rate) = (self.recorded.layout.tau(), self.recorded.layout.law_rate());
        for lane in 0..S::LANES {
            if !self.declined(lane) {
                continue;
            }
            self.back(lane);
            let (state, tau, dz) = &mut self.redo.row;
            self.redo.direct[lane].answer(t, state, tau, dz);
            for k in 0..self.redo.row.1.len() {
                self.set_number(first + k, lane, self.redo.row.1[k]);
            }
            for k in 0..self.redo.row.2.len() {
                self.set_number(rate + k, lane, self.redo.row.2[k]);
            }
        }
    }
}
