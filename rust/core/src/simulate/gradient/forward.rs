//! Tangents of a run: every operation `X_(k+1) = Phi(X_k, p)` maps `S = dX/dp` by `S_(k+1) = Phi_x S_k + Phi_p`, where `Phi_x` and `Phi_p`
//! are the derivatives of `Phi`. The directions of a *group* are in the lanes of one register. A *block* is a few groups. Each block computes
//! the states of the run again.

use super::combine::{add, add_slopes, advance};
use super::mixture::Mixture;
use super::prepared::Prepared;
use super::series::Series;
use super::switch::Jump;
use super::tangent_call::TangentCall;
use super::timeline::{Acting, Operation};
use super::walk::{Walker, act, add_output, followers, seen, side_of};
use crate::error::Result;
use crate::integrate::Tableau;
use crate::memory;
use crate::motion::Side;

/// A run with its tangents along a block of directions.
pub struct Forward<'a> {
    prepared: &'a Prepared<'a>,
    mixture: &'a Mixture<'a>,
    tableau: &'a Tableau,
    walker: Walker<'a>,
    /// For each contact mode, the state rates with their tangents.
    rates: TangentCall,
    /// Memory for the modes of contacts.
    modes: Vec<f64>,
    law: TangentCall,
    lanes: usize,
    /// The number of groups in a block.
    groups: usize,
    /// The first direction of the block.
    first: usize,
    state: Vec<f64>,
    /// The tangents of the state, group after group. A group has one row per number of the state, and the row has one entry per lane.
    tangent: Vec<f64>,
    left: (Vec<f64>, Vec<f64>),
    /// The exogenous input at time `looked`, s, and on this side of a knot.
    u: Vec<f64>,
    looked: (f64, Side),
    /// The tangents of the exogenous input for all groups.
    u_rates: Vec<f64>,
    scratch: Vec<f64>,
    point: Vec<f64>,
    slopes: Vec<f64>,
    /// The tangents of the state rates at the stages, in the order group, stage, number of the state, lane.
    slope_rates: Vec<f64>,
    followers: Vec<(usize, usize)>,
}

/// Write the tangents of all records to their series.
pub fn run(prepared: &Prepared, series: &mut Series) -> Result<()> {
    if prepared.directions.count == 0 {
        return Ok(());
    }
    let mixture = Mixture::parameters(prepared);
    let mut forward = Forward::new(prepared, &mixture, &prepared.tableau)?;
    for first in (0..mixture.count).step_by(forward.directions()) {
        forward.begin(first);
        forward.run(series)?;
    }
    Ok(())
}

impl<'a> Forward<'a> {
    /// Return a run with its tangents along a block of directions of `mixture`, by steps with the stages of `tableau`.
    pub fn new(prepared: &'a Prepared<'a>, mixture: &'a Mixture<'a>, tableau: &'a Tableau) -> Result<Self> {
        let (functions, sizes) = (&prepared.functions, &prepared.functions.sizes);
        let rates = TangentCall::of(&functions.rates, prepared);
        let law = TangentCall::of(&functions.law, prepared);
        let (lanes, groups, walker, stages) = (law.call.lanes(), sizes.groups, Walker::new(prepared), tableau.b.len());
        let size = walker.places.size();
        Ok(Forward {
            prepared,
            mixture,
            tableau,
            walker,
            rates,
            modes: Vec::new(),
            law,
            lanes,
            groups,
            first: 0,
            state: vec![0.0; size],
            tangent: memory::zeros(groups * size * lanes)?,
            left: (vec![0.0; size], memory::zeros(groups * size * lanes)?),
            u: vec![0.0; sizes.width],
            looked: (f64::NAN, Side::Moving),
            u_rates: memory::zeros(groups * sizes.driven() * lanes)?,
            scratch: vec![0.0; 2 * sizes.width],
            point: vec![0.0; sizes.states],
            slopes: vec![0.0; stages * sizes.states],
            slope_rates: memory::zeros(groups * stages * sizes.states * lanes)?,
            followers: followers(sizes),
        })
    }

    /// Set the state and the tangents to their values at the start of the run, for the block of directions from `first` on.
    pub fn begin(&mut self, first: usize) {
        self.state.copy_from_slice(&self.walker.start());
        self.tangent.fill(0.0);
        self.u_rates.fill(0.0);
        (self.first, self.looked) = (first, (f64::NAN, Side::Moving));
        self.rates.set_up(self.mixture, first, self.groups);
        self.law.set_up(self.mixture, first, self.groups);
        for (number, rates) in self.mixture.start.chunks_exact(self.mixture.count).enumerate() {
            for (k, &rate) in rates[first..].iter().take(self.groups * self.lanes).enumerate() {
                self.set_tangent(k, number, rate);
            }
        }
    }

    /// The number of directions of a block.
    pub fn directions(&self) -> usize {
        self.groups * self.lanes
    }

    /// Set the tangent of state number `number` along direction `k` of the block.
    pub fn set_tangent(&mut self, k: usize, number: usize, rate: f64) {
        let at = self.place(k, number);
        self.tangent[at] = rate;
    }

    /// Write the rate of the tangent along direction `k` of the block, at a stage of the last step, to `out`.
    pub fn slope(&self, k: usize, stage: usize, out: &mut [f64]) {
        let (rows, stages) = (self.point.len() * self.lanes, self.tableau.b.len());
        self.direction(&self.slope_rates[stage * rows..], k, stages * rows, out);
    }

    /// Compute `sum_j w_j k_j` for the rates `k_j` of the tangents along all directions, at the stages of the last step.
    pub fn combined_slopes(&self, weights: &[f64], out: &mut [f64]) {
        let rows = self.point.len() * self.lanes;
        for (slopes, out) in self.slope_rates.chunks_exact(self.tableau.b.len() * rows).zip(out.chunks_exact_mut(rows)) {
            out.fill(0.0);
            weights.iter().zip(slopes.chunks_exact(rows)).for_each(|(&weight, slopes)| add(out, weight, slopes));
        }
    }

    /// Write the tangent along direction `k` of the block before and after the last step, and its rows of `combined`, to `out`.
    pub fn change(&self, k: usize, combined: &[Vec<f64>], [before, after]: [&mut [f64]; 2], estimates: &mut [Vec<f64>]) {
        let (all, rows) = (self.state.len() * self.lanes, self.point.len() * self.lanes);
        self.direction(&self.left.1, k, all, before);
        self.direction(&self.tangent, k, all, after);
        combined.iter().zip(estimates).for_each(|(combined, estimate)| self.direction(combined, k, rows, estimate));
    }

    /// Write the state before and after the last step, and its weighted sums of slopes, to `estimates`.
    pub fn state_change(&self, weights: &[&[f64]], [before, after]: [&mut [f64]; 2], estimates: &mut [Vec<f64>]) {
        let size = self.point.len();
        before.copy_from_slice(&self.left.0[..size]);
        after.copy_from_slice(&self.state[..size]);
        for (weights, out) in weights.iter().zip(estimates) {
            out.fill(0.0);
            weights.iter().zip(self.slopes.chunks_exact(size)).for_each(|(&weight, slope)| add(out, weight, slope));
        }
    }

    /// Copy the numbers of direction `k` of the block from `rates`. A group has `width` numbers.
    fn direction(&self, rates: &[f64], k: usize, width: usize, out: &mut [f64]) {
        let rows = rates[k / self.lanes * width..].chunks_exact(self.lanes);
        rows.zip(out).for_each(|(row, out)| *out = row[k % self.lanes]);
    }

    /// The index of the tangent of state number `number` along direction `k` of the block.
    fn place(&self, k: usize, number: usize) -> usize {
        (k / self.lanes * self.state.len() + number) * self.lanes + k % self.lanes
    }

    fn run(&mut self, series: &mut Series) -> Result<()> {
        let timeline = &self.prepared.timeline;
        // A record that is not yet complete. The first stage of the next step computes its input.
        let mut open = None;
        for (k, &operation) in timeline.operations.iter().enumerate() {
            match operation {
                Operation::Record { i, .. } if timeline.steps_on(k) => open = Some(i),
                Operation::Record { i, t } => self.record(i, t, series)?,
                Operation::Step { t, h, end, mode } => self.step((t, h, end), mode, open.take().map(|i| (i, &mut *series)))?,
                Operation::Switch { .. } | Operation::Branch { .. } | Operation::Sample { .. } | Operation::Act(_) => {
                    self.jump(operation)?
                }
                Operation::Restore(k) => self.walker.restore(k, &mut self.state),
                Operation::Leave => self.leave(),
                Operation::Rejoin => self.restore(),
            }
        }
        Ok(())
    }

    /// Apply a sample, or a change at one time.
    pub fn jump(&mut self, operation: Operation) -> Result<()> {
        match operation {
            Operation::Switch { k, t } => {
                let jump = self.walker.jump(k, t, &self.state)?;
                self.switch(t, jump);
            }
            Operation::Branch { k, t } => {
                let jump = self.walker.branch_jump(&self.prepared.timeline.crossings[k], t, &self.state)?;
                self.switch(t, jump);
            }
            Operation::Sample { k, t } => self.sample(k, t)?,
            Operation::Act(acting) => self.act(acting),
            Operation::Step { .. } | Operation::Restore(_) | Operation::Record { .. } | Operation::Leave | Operation::Rejoin => {}
        }
        Ok(())
    }

    /// Store the state and its tangents.
    pub fn leave(&mut self) {
        self.left.0.copy_from_slice(&self.state);
        self.left.1.copy_from_slice(&self.tangent);
    }

    /// Restore the state and the tangents that [`Forward::leave`] stored.
    pub fn restore(&mut self) {
        self.state.copy_from_slice(&self.left.0);
        self.tangent.copy_from_slice(&self.left.1);
    }

    /// Evaluate the exogenous input and its tangents at time `t`. `side` is the side of `t` if a motion has a knot there.
    fn look_outside(&mut self, t: f64, side: Side) {
        if t == self.looked.0 && (side == self.looked.1 || !self.prepared.directions.drives()) {
            return;
        }
        self.looked = (t, side);
        let (directions, lanes, all) = (&self.prepared.directions, self.lanes, self.groups * self.lanes);
        directions.input(t, &mut self.u);
        if directions.drives() {
            let (rates, width, first, mixture) = (&mut self.u_rates, self.u.len(), self.first, self.mixture);
            rates.fill(0.0);
            directions.input_rates((t, side), &self.u, &mut self.scratch, |slot, parameter, rate| {
                for (direction, weight) in mixture.parts(parameter) {
                    if let Some(k) = direction.checked_sub(first).filter(|&k| k < all) {
                        rates[(k / lanes * width + slot) * lanes + k % lanes] += weight * rate;
                    }
                }
            });
        }
    }

    fn act(&mut self, acting: Acting) {
        let (places, lanes) = (self.walker.places, self.lanes);
        act(&places, acting, &mut self.state, 1);
        self.tangent.chunks_exact_mut(places.size() * lanes).for_each(|tangent| act(&places, acting, tangent, lanes));
    }

    fn sample(&mut self, k: u64, t: f64) -> Result<()> {
        let (places, lanes, n) = (self.walker.places, self.lanes, self.prepared.functions.sizes.n);
        let (size, driven) = (places.size() * lanes, self.prepared.functions.sizes.driven() * lanes);
        self.walker.sample(k, t, &mut self.state)?;
        self.look_outside(t, Side::Moving);
        self.law.call.give([&self.u, &self.walker.shown, &[], &[]]);
        let (from, z) = (places.measured(seen(&self.prepared.timeline, k)), places.z());
        for (g, tangent) in self.tangent.chunks_exact_mut(size).enumerate() {
            // A derivative ignores the rounding of a measurement, and noise does not depend on the state. So the tangent of a measurement
            // is the tangent of the state.
            tangent.copy_within(0..z.start * lanes, places.measured(k).start * lanes);
            let (shown, _) = self.law.rates_of(g, &self.u_rates[g * driven..(g + 1) * driven], z.end);
            let (plant, law) = shown.split_at_mut(z.start * lanes);
            plant.copy_from_slice(&tangent[from.start * lanes..from.end * lanes]);
            law.copy_from_slice(&tangent[z.start * lanes..z.end * lanes]);
        }
        self.law.call.run(t)?;
        for (g, tangent) in self.tangent.chunks_exact_mut(size).enumerate() {
            let answer = places.answer(k);
            tangent[answer.start * lanes..answer.end * lanes].copy_from_slice(self.law.answers(g));
            add_output(&places, answer.start, -1.0, tangent, lanes);
            for i in (0..n).filter(|&i| self.walker.limited[i]) {
                let to = (answer.start + i) * lanes;
                match k.checked_sub(1).map(|before| (places.answer(before).start + i) * lanes) {
                    Some(last) => tangent.copy_within(last..last + lanes, to),
                    None => tangent[to..to + lanes].fill(0.0),
                }
            }
        }
        Ok(())
    }

    /// Add a jump of the tangents at time `t`.
    fn switch(&mut self, t: f64, jump: Option<Jump>) {
        let Some(jump) = jump else { return };
        self.look_outside(t, Side::Moving);
        let (mixture, lanes, all) = (self.mixture, self.lanes, self.walker.places.size() * self.lanes);
        let driven = self.prepared.functions.sizes.driven() * lanes;
        for (g, tangent) in self.tangent.chunks_exact_mut(all).enumerate() {
            let first = self.first + g * lanes;
            for (lane, direction) in (first..mixture.count.min(first + lanes)).enumerate() {
                let set_up = jump.of_set_up.iter().zip(mixture.set_up.chunks_exact(mixture.count)).map(|(w, row)| w * row[direction]);
                let state = jump.of_state.iter().zip(tangent.chunks_exact(lanes)).map(|(w, row)| w * row[lane]);
                let outside = jump.of_input.iter().zip(self.u_rates[g * driven..].chunks_exact(lanes)).map(|(w, row)| w * row[lane]);
                let delay: f64 = set_up.chain(state).chain(outside.take(driven / lanes)).sum();
                tangent.chunks_exact_mut(lanes).zip(&jump.along).for_each(|(row, along)| row[lane] += along * delay);
            }
        }
    }

    /// Compute a step, and write the record at its start if one exists.
    pub fn step(&mut self, (t, h, end): (f64, f64, f64), mode: usize, mut record: Option<(usize, &mut Series)>) -> Result<()> {
        let (tableau, places, lanes, size) = (self.tableau, self.walker.places, self.lanes, self.prepared.functions.sizes.states);
        let (rows, acting) = (size * lanes, places.acting());
        let (all, stages, driven) = (places.size() * lanes, tableau.b.len() * rows, self.prepared.functions.sizes.driven() * lanes);
        self.modes.clear();
        self.modes.extend(self.prepared.timeline.contacts.numbers(mode));
        for i in 0..tableau.b.len() {
            let (a, instant) = (&tableau.a[i], (t + tableau.c[i] * h).min(end));
            add_slopes(&self.state[places.x()], h, a, &self.slopes[..i * size], &mut self.point);
            self.look_outside(instant, side_of(tableau.c[i]));
            let rates = &mut self.rates;
            rates.call.give([&self.u, &self.point, &self.state[acting.clone()], &self.modes]);
            for (g, (tangent, slopes)) in self.tangent.chunks_exact(all).zip(self.slope_rates.chunks_exact(stages)).enumerate() {
                let (x, held) = rates.rates_of(g, &self.u_rates[g * driven..(g + 1) * driven], size);
                add_slopes(&tangent[..rows], h, a, &slopes[..i * rows], x);
                held.copy_from_slice(&tangent[acting.start * lanes..acting.end * lanes]);
            }
            rates.call.run(instant)?;
            let slope = self.slopes[i * size..(i + 1) * size].iter_mut();
            slope.zip(rates.call.answers().chunks_exact(lanes)).for_each(|(slope, lanes)| *slope = lanes[0]);
            for (g, slopes) in self.slope_rates.chunks_exact_mut(stages).enumerate() {
                slopes[i * rows..(i + 1) * rows].copy_from_slice(&rates.answers(g)[..rows]);
            }
            if let Some((i, series)) = record.take() {
                for (g, tangent) in self.tangent.chunks_exact(all).enumerate() {
                    let first = self.first + g * lanes;
                    series.put(i, first, lanes, 0, &tangent[..rows]);
                    series.put(i, first, lanes, size, &rates.answers(g)[rows..]);
                }
            }
        }
        advance(tableau, h, &mut self.slopes, &self.followers, &mut self.state[places.x()], 1);
        for (tangent, slopes) in self.tangent.chunks_exact_mut(all).zip(self.slope_rates.chunks_exact_mut(stages)) {
            advance(tableau, h, slopes, &self.followers, &mut tangent[..rows], lanes);
        }
        Ok(())
    }

    /// Write the tangents of a record `[x, tau]`.
    fn record(&mut self, i: usize, t: f64, series: &mut Series) -> Result<()> {
        let sizes = &self.prepared.functions.sizes;
        let (places, lanes, rows) = (self.walker.places, self.lanes, sizes.states * self.lanes);
        let (all, driven, acting) = (places.size() * lanes, sizes.driven() * lanes, places.acting().start * lanes);
        if !sizes.sampled {
            self.look_outside(t, Side::Moving);
            self.law.call.give([&self.u, &self.state[places.x()], &[], &[]]);
            for (g, tangent) in self.tangent.chunks_exact(all).enumerate() {
                let (x, _) = self.law.rates_of(g, &self.u_rates[g * driven..(g + 1) * driven], sizes.states);
                x.copy_from_slice(&tangent[..rows]);
            }
            self.law.call.run(t)?;
        }
        for (g, tangent) in self.tangent.chunks_exact(all).enumerate() {
            let first = self.first + g * lanes;
            let tau = if sizes.sampled { &tangent[acting..] } else { self.law.answers(g) };
            series.put(i, first, lanes, 0, &tangent[..rows]);
            series.put(i, first, lanes, sizes.states, &tau[..sizes.n * lanes]);
        }
        Ok(())
    }
}
