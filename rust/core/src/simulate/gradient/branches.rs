//! The jumps of the state rates at branches of their recorded functions. An example is the limit that stops an integral. A branch is a
//! comparison. Its margin is the difference of the compared numbers.
//!
//! If a margin changes its sign in a step and the state rates jump there, the step of the derivatives is divided at this time. Both parts
//! use the method of the run. After them, the state is again that of the run, whose stages see either side of the jump. So the derivatives
//! belong to the states of the run, and converge to the derivatives of the exact solution.

use super::prepared::Prepared;
use super::switch::{Jump, grazed};
use super::timeline::{Crossing, Divided, Operation};
use super::walk::Walker;
use crate::error::Result;
use crate::integrate::events::crossing;
use crate::memory::{append, more};

/// The distance of the two times from which the rate of the exogenous input is computed, s.
const APART: f64 = 1e-5;

/// The name of a change in messages.
const BRANCH: &str = "a limit, a dead zone or another branch";
/// The number of evaluations of a margin in a step.
const CHECKS_PER_STEP: usize = 4;

/// Divide the steps of a run where a branch changes and the state rates jump. The result is `None` if the state rates have no branches.
pub fn divided(prepared: &Prepared) -> Result<Option<Divided>> {
    if prepared.functions.branches.is_none() {
        return Ok(None);
    }
    let mut walker = Walker::new(prepared);
    let (mut state, mut all) = (walker.start(), Divided::default());
    let (mut before, fixed) = (state.clone(), !prepared.single.options.method.is_adaptive());
    let mut points = walker.points.clone();
    for &operation in &prepared.timeline.operations {
        before.copy_from_slice(&state);
        walker.apply(operation, &mut state)?;
        match operation {
            Operation::Step { t, h, end, mode } => {
                points.clone_from(&walker.points);
                Division { walker: &mut walker, all: &mut all, mode, fixed, end }.divide((t, h), &mut before, &state, &points)?;
            }
            _ => append(&mut all.operations, &[operation])?,
        }
    }
    Ok(Some(all))
}

/// One step, while it is being divided.
struct Division<'a, 'b> {
    walker: &'a mut Walker<'b>,
    all: &'a mut Divided,
    mode: usize,
    /// Whether the method has fixed steps, which do not adapt to the changes.
    fixed: bool,
    /// The last time at which the step evaluates the exogenous input, s.
    end: f64,
}

impl Division<'_, '_> {
    fn push(&mut self, operation: Operation) -> Result<()> {
        append(&mut self.all.operations, &[operation])
    }

    fn step(&self, t: f64, h: f64) -> Operation {
        Operation::Step { t, h, end: self.end.min(t + h), mode: self.mode }
    }

    /// Append the step of size `h` from `t` and the state `x` to the operations, divided if necessary. `last` is the state of the run after
    /// the step, and `points` are its states at the stages.
    fn divide(&mut self, (mut t, mut h): (f64, f64), x: &mut Vec<f64>, last: &[f64], points: &[f64]) -> Result<()> {
        let (begun, mut masks) = (t, self.walker.margins(self.mode, t, x)?);
        let then = self.walker.margins(self.mode, self.end, last)?;
        let differs = |k: usize, margins: &[f64]| masks[k] != 0.0 && (masks[k] < 0.0) != (margins[k] < 0.0);
        let ends: Vec<bool> = (0..masks.len()).map(|k| differs(k, &then)).collect();
        // The margins at a stage on another side than both ends. A state that slides has such stages.
        let (mut passed, mut aside) = (ends.clone(), masks.clone());
        let mut there = x.clone();
        if self.fixed {
            for (i, point) in points.chunks_exact(self.walker.places.x().end).enumerate().skip(1) {
                let instant = (t + self.walker.prepared.tableau.c[i] * h).min(self.end);
                there[..point.len()].copy_from_slice(point);
                let margins = self.walker.margins(self.mode, instant, &there)?;
                for k in (0..masks.len()).filter(|&k| differs(k, &margins)) {
                    passed[k] = true;
                    aside.clone_from(&margins);
                }
            }
        }
        let mut open: Vec<usize> = (0..masks.len()).filter(|&k| passed[k]).collect();
        let undivided = Operation::Step { t, h, end: self.end, mode: self.mode };
        if open.is_empty() {
            return self.push(undivided);
        }
        let (start, operations) = (x.clone(), self.all.operations.len());
        // A part from `t` on. Its margins at the start have the signs in `masks`.
        while let Some((k, size)) = self.first_of(&mut open, (t, h), x, &masks)? {
            there.copy_from_slice(x);
            let part = Operation::Step { t, h: size, end: self.end.min(t + size), mode: self.mode };
            if size > 0.0 {
                self.walker.apply(part, &mut there)?;
            }
            let mut change = Crossing { mode: self.mode, branch: k, masks: masks.clone(), then: masks.clone() };
            if ends[k] {
                change.then[k] = -masks[k];
            } else {
                change.then.clone_from(&aside);
            }
            open.retain(|&other| other != k);
            let jump = self.walker.branch_jump(&change, t + size, &there)?;
            if !ends[k] && !jump.as_ref().is_some_and(|jump| jump.slides) {
                continue;
            }
            if let Some(jump) = jump {
                if self.fixed && self.bends(&change, (begun, &start), last)? > jump.speed.abs() {
                    return Err(grazed(BRANCH, t + size));
                }
                if size > 0.0 {
                    self.push(part)?;
                }
                self.push(Operation::Branch { k: self.all.crossings.len(), t: t + size })?;
                let crossings = &mut self.all.crossings;
                if crossings.len() == crossings.capacity() {
                    more(crossings, crossings.len().max(1))?;
                }
                crossings.push(change);
                (t, h) = (t + size, h - size);
                x.clone_from(&there);
            }
            if ends[k] {
                masks[k] = -masks[k];
            }
        }
        if self.all.operations.len() == operations {
            return self.push(undivided);
        }
        if h > 0.0 {
            let rest = self.step(t, h);
            self.push(rest)?;
        }
        let k = self.all.states.len() / last.len();
        append(&mut self.all.states, last)?;
        self.push(Operation::Restore(k))
    }

    /// The change of the rate of a margin in the step from time `t` and state `x` to the state `last`. If it exceeds the rate at the zero,
    /// steps of this size do not resolve this zero.
    fn bends(&mut self, change: &Crossing, (t, x): (f64, &[f64]), last: &[f64]) -> Result<f64> {
        let (first, then) = (self.walker.margin_rate(change, t, x)?.rate, self.walker.margin_rate(change, self.end, last)?.rate);
        Ok((then - first).abs())
    }

    /// Return the branch of `open` that changes first in a step from state `x`, and the step size up to this change. Branches that do not
    /// change in this step are removed from `open`.
    fn first_of(&mut self, open: &mut Vec<usize>, (t, h): (f64, f64), x: &[f64], masks: &[f64]) -> Result<Option<(usize, f64)>> {
        let (mut failed, mut first): (Result<()>, Option<(usize, f64)>) = (Ok(()), None);
        let mut there = x.to_vec();
        let mut margin = |k: usize, size: f64| {
            there.copy_from_slice(x);
            let part = Operation::Step { t, h: size, end: self.end.min(t + size), mode: self.mode };
            let walked = self.walker.apply(part, &mut there);
            let margins = walked.and_then(|()| self.walker.margins(self.mode, self.end.min(t + size), &there));
            margins.map_or_else(
                |error| {
                    failed = Err(error);
                    f64::NAN
                },
                |margins| margins[k],
            )
        };
        open.retain(|&k| {
            let other = |margin: f64| (margin < 0.0) != (masks[k] < 0.0);
            let now = margin(k, 0.0);
            let mut checks = (1..=CHECKS_PER_STEP).map(|i| i as f64 / CHECKS_PER_STEP as f64 * h);
            let Some((part, then)) = checks.find_map(|part| Some((part, margin(k, part))).filter(|(_, then)| other(*then))) else {
                return false;
            };
            let inside = !other(now) && now != 0.0;
            let size = if inside { crossing(|size| margin(k, size), (0.0, now), (part, then)) } else { 0.0 };
            if first.is_none_or(|(_, least)| size < least) {
                first = Some((k, size));
            }
            true
        });
        failed.map(|()| first)
    }
}

impl Walker<'_> {
    /// Return the margins of the branches at time `t` and state `state`.
    pub fn margins(&mut self, mode: usize, t: f64, state: &[f64]) -> Result<Vec<f64>> {
        self.hold(mode);
        let Some([margins, _, _]) = &mut self.branches else { return Ok(Vec::new()) };
        self.prepared.directions.input(t, &mut self.u);
        margins.give([&self.u, &state[self.places.x()], &state[self.places.acting()], &self.modes]);
        margins.run(t)?;
        Ok(margins.answers().to_vec())
    }

    /// Return the state rates at time `t` with given results of all comparisons.
    fn held_rates(&mut self, mode: usize, t: f64, state: &[f64], masks: &[f64]) -> Result<Vec<f64>> {
        self.hold(mode);
        self.modes.extend(masks);
        let Some([_, _, rates]) = &mut self.branches else { return Ok(Vec::new()) };
        self.prepared.directions.input(t, &mut self.u);
        rates.give([&self.u, &state[self.places.x()], &state[self.places.acting()], &self.modes]);
        rates.run(t)?;
        Ok(rates.answers().to_vec())
    }

    /// The rate of the exogenous input at time `t`.
    fn input_rate(&self, t: f64) -> Vec<f64> {
        let at = |t: f64| {
            let mut u = vec![0.0; self.u.len()];
            self.prepared.directions.input(t, &mut u);
            u
        };
        let (before, after) = (at(t - 0.5 * APART), at(t + 0.5 * APART));
        before.iter().zip(after).map(|(before, after)| (after - before) / APART).collect()
    }

    /// Return the rate of the margin of a branch at time `t` before its change, and the terms of this rate.
    fn margin_rate(&mut self, change: &Crossing, t: f64, state: &[f64]) -> Result<MarginRate> {
        let Crossing { mode, branch, ref masks, .. } = *change;
        let (rates, u_dot) = (self.held_rates(mode, t, state, masks)?, self.input_rate(t));
        let (sizes, acting) = (&self.prepared.functions.sizes, self.places.acting());
        let mut found = MarginRate { rates, ..MarginRate::default() };
        self.hold(mode);
        let Some([_, margins, _]) = &mut self.branches else { return Ok(found) };
        self.prepared.directions.input(t, &mut self.u);
        margins.give([&self.u, &state[self.places.x()], &state[acting.clone()], &self.modes]);
        let weights = margins.more(0, masks.len());
        weights.fill(0.0);
        weights[branch] = 1.0;
        margins.run(t)?;
        let (of_set_up, rest) = margins.behind(0, sizes.moved + sizes.width + sizes.states + acting.len()).split_at(sizes.moved);
        let (of_input, of_state) = rest.split_at(sizes.width);
        found.drift = dot(of_input, &u_dot);
        found.rate = dot(of_state, &found.rates) + found.drift;
        found.slopes = [of_state, of_input, of_set_up].map(<[f64]>::to_vec);
        Ok(found)
    }

    /// Compute the jump where a branch changes. The result is `None` if the state rates do not jump. Error: `Solve` if the zero is grazed.
    pub fn branch_jump(&mut self, change: &Crossing, t: f64, state: &[f64]) -> Result<Option<Jump>> {
        let MarginRate { rates, slopes: [of_state, of_input, of_set_up], drift, .. } = self.margin_rate(change, t, state)?;
        let after = self.held_rates(change.mode, t, state, &change.then)?;
        Jump::between([&rates, &after], [&of_state, &of_input, &of_set_up], drift, (BRANCH, t))
    }
}

/// The rate of a margin, and the terms from which it is computed.
#[derive(Default)]
struct MarginRate {
    rate: f64,
    /// The partial derivative of the margin with respect to time.
    drift: f64,
    /// The derivatives of the margin with respect to the state with the held input, the exogenous input, and the loop parameters.
    slopes: [Vec<f64>; 3],
    rates: Vec<f64>,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
