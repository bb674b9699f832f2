//! The adjoint of a run: `l_k = Phi_x' l_(k+1) + loss_x(k)`, `grad = x0_p' l_0 + sum Phi_p' l_(k+1)`, operation by operation from the last to
//! the first. Each operation is differentiated at the state before it: states are kept at checkpoints, and those of the operations after a
//! checkpoint are computed again (Griewank and Walther 2008, chapter 12).

use super::Prepared;
use super::functions::Call;
use super::timeline::Operation;
use super::walk::{Walker, followers, seen};
use crate::error::Result;
use crate::memory;

/// How many operations lie between two checkpoints, so that states take at most `memory` bytes; of many more operations than that, the
/// square root of their number.
fn stride(operations: usize, size: usize, memory: usize) -> usize {
    let half = (memory / (16 * size.max(1))).max(1);
    let stride = operations.div_ceil(half);
    if stride <= half { stride.max(1) } else { operations.isqrt().max(1) }
}

/// A run whose weights go back.
struct Backward<'a> {
    prepared: &'a Prepared<'a>,
    walker: Walker<'a>,
    rates: Call,
    law: Call,
    /// The weights of the state.
    bar: Vec<f64>,
    aside: Vec<f64>,
    /// The weights of the numbers of the set-up that move.
    set_up: Vec<f64>,
    gradient: Vec<f64>,
    u: Vec<f64>,
    room: Vec<f64>,
    followers: Vec<(usize, usize)>,
}

/// The derivatives of the weighed records with respect to all parameters.
pub fn run(prepared: &Prepared, weights: &[f64], memory: usize) -> Result<Vec<f64>> {
    let operations = &prepared.timeline.operations;
    let mut backward = Backward::new(prepared);
    let mut state = backward.walker.start();
    let size = state.len();
    let stride = stride(operations.len(), size, memory);
    // A checkpoint stands before an operation on the path of the run.
    let (mut checkpoints, mut kept, mut on_path) = (Vec::new(), Vec::new(), true);
    for (k, &operation) in operations.iter().enumerate() {
        if on_path && checkpoints.last().is_none_or(|&last| k >= last + stride) {
            memory::append(&mut checkpoints, &[k])?;
            memory::append(&mut kept, &state)?;
        }
        on_path = match operation {
            Operation::Leave => false,
            Operation::Back => true,
            _ => on_path,
        };
        backward.walker.apply(operation, &mut state)?;
    }
    let mut end = operations.len();
    let mut states = Vec::new();
    for (&first, kept) in checkpoints.iter().zip(kept.chunks_exact(size.max(1))).rev() {
        states.clear();
        state.copy_from_slice(kept);
        for (k, &operation) in operations[first..end].iter().enumerate() {
            memory::append(&mut states, &state)?;
            if first + k + 1 < end {
                backward.walker.apply(operation, &mut state)?;
            }
        }
        for (&operation, before) in operations[first..end].iter().zip(states.chunks_exact_mut(size.max(1))).rev() {
            backward.reverse(operation, before, weights)?;
        }
        end = first;
    }
    Ok(backward.finish())
}

impl<'a> Backward<'a> {
    fn new(prepared: &'a Prepared<'a>) -> Self {
        let (functions, directions) = (&prepared.functions, &prepared.directions);
        let walker = Walker::new(prepared);
        Backward {
            rates: functions.rates.adjoint(),
            law: functions.law.adjoint(),
            bar: vec![0.0; walker.places.size()],
            aside: Vec::new(),
            set_up: vec![0.0; directions.moved],
            gradient: vec![0.0; directions.count],
            u: vec![0.0; functions.sizes.width],
            room: vec![0.0; 2 * functions.sizes.width],
            followers: followers(&functions.sizes),
            prepared,
            walker,
        }
    }

    /// The adjoint of an operation at the state before it.
    fn reverse(&mut self, operation: Operation, before: &mut [f64], weights: &[f64]) -> Result<()> {
        let places = self.walker.places;
        match operation {
            Operation::Sample { k, t } => return self.sample(k, t, before),
            Operation::Act(k) => {
                let acting = places.acting();
                if let Some(k) = k {
                    let (head, answers) = self.bar.split_at_mut(acting.end);
                    let first = places.answer(k).start - acting.end;
                    answers[first..].iter_mut().zip(&head[acting.clone()]).for_each(|(to, from)| *to += from);
                }
                self.bar[acting].fill(0.0);
            }
            Operation::Step { t, h, end } => return self.step((t, h, end), before),
            Operation::Record { i, t } => return self.record(i, t, before, weights),
            Operation::Leave => self.bar.iter_mut().zip(&self.aside).for_each(|(bar, aside)| *bar += aside),
            Operation::Back => {
                self.aside.clone_from(&self.bar);
                self.bar.fill(0.0);
            }
        }
        Ok(())
    }

    /// The weights of a record `[x, tau]`.
    fn record(&mut self, i: usize, t: f64, before: &[f64], weights: &[f64]) -> Result<()> {
        let sizes = &self.prepared.functions.sizes;
        let (places, numbers) = (self.walker.places, sizes.states + sizes.n);
        let (x, tau) = weights[i * numbers..(i + 1) * numbers].split_at(sizes.states);
        self.bar.iter_mut().zip(x).for_each(|(bar, weight)| *bar += weight);
        if sizes.sampled {
            self.bar[places.acting()].iter_mut().zip(tau).for_each(|(bar, weight)| *bar += weight);
            return Ok(());
        }
        if tau.iter().all(|&weight| weight == 0.0) {
            return Ok(());
        }
        let mut answer = vec![0.0; sizes.answer];
        answer[..sizes.n].copy_from_slice(tau);
        let (states, _) = self.pass(Of::Law, t, [&before[places.x()], &[]], &answer)?;
        self.bar.iter_mut().zip(states).for_each(|(bar, weight)| *bar += weight);
        Ok(())
    }

    /// The weights of the state and of what is held, from those of an answer; those of the set-up and from outside are added up.
    fn pass(&mut self, of: Of, t: f64, [x, held]: [&[f64]; 2], weights: &[f64]) -> Result<(Vec<f64>, Vec<f64>)> {
        let (directions, sizes) = (&self.prepared.directions, &self.prepared.functions.sizes);
        directions.input(t, &mut self.u);
        let call = match of {
            Of::Law => &mut self.law,
            Of::Rates => &mut self.rates,
        };
        call.give([&self.u, x, held]);
        call.more(0, weights.len()).copy_from_slice(weights);
        call.run(t)?;
        let driven = sizes.driven();
        let all = call.behind(0, sizes.moved + driven + x.len() + held.len());
        let (set_up, rest) = all.split_at(sizes.moved);
        let (outside, rest) = rest.split_at(driven);
        self.set_up.iter_mut().zip(set_up).for_each(|(sum, weight)| *sum += weight);
        if driven > 0 {
            let gradient = &mut self.gradient;
            directions.input_rates(t, &self.u, &mut self.room, |slot, parameter, rate| gradient[parameter] += outside[slot] * rate);
        }
        let (x, held) = rest.split_at(x.len());
        Ok((x.to_vec(), held.to_vec()))
    }

    fn sample(&mut self, k: u64, t: f64, before: &mut [f64]) -> Result<()> {
        let (places, n) = (self.walker.places, self.prepared.functions.sizes.n);
        self.walker.sample(k, t, before)?;
        let mut weights = self.bar[places.answer(k)].to_vec();
        self.bar[places.answer(k)].fill(0.0);
        for i in (0..n).filter(|&i| self.walker.limited[i]) {
            if let Some(last) = k.checked_sub(1) {
                self.bar[places.answer(last).start + i] += weights[i];
            }
            weights[i] = 0.0;
        }
        let shown = self.walker.shown.clone();
        let (states, _) = self.pass(Of::Law, t, [&shown, &[]], &weights)?;
        let (plant, law) = states.split_at(places.z().start);
        let from = places.measured(seen(&self.prepared.timeline, k));
        self.bar[from].iter_mut().zip(plant).for_each(|(bar, weight)| *bar += weight);
        self.bar[places.z()].iter_mut().zip(law).for_each(|(bar, weight)| *bar += weight);
        // Noise and quantisation pass weights on as they are.
        let own = places.measured(k);
        for i in 0..own.len() {
            self.bar[i] += std::mem::take(&mut self.bar[own.start + i]);
        }
        Ok(())
    }

    fn step(&mut self, (t, h, end): (f64, f64, f64), before: &[f64]) -> Result<()> {
        let (tableau, size, places) = (&self.prepared.tableau, self.prepared.functions.sizes.states, self.walker.places);
        self.walker.stages((t, h, end), before)?;
        let points = std::mem::take(&mut self.walker.points);
        if tableau.follows {
            for &(position, rate) in &self.followers {
                self.bar[rate] += h * self.bar[position];
            }
        }
        let stages = tableau.b.len();
        // The weights of the slopes, then of the points.
        let mut slopes: Vec<f64> = tableau.b.iter().flat_map(|b| self.bar[..size].iter().map(move |bar| h * b * bar)).collect();
        if tableau.follows {
            self.followers.iter().for_each(|&(position, _)| slopes[position] = 0.0);
        }
        for i in (0..stages).rev() {
            let instant = (t + tableau.c[i] * h).min(end);
            let parts = [&points[i * size..(i + 1) * size], &before[places.acting()]];
            let weights = slopes[i * size..(i + 1) * size].to_vec();
            let (point, held) = self.pass(Of::Rates, instant, parts, &weights)?;
            for (j, &a) in tableau.a[i].iter().enumerate().filter(|(_, a)| **a != 0.0) {
                slopes[j * size..(j + 1) * size].iter_mut().zip(&point).for_each(|(slope, weight)| *slope += h * a * weight);
            }
            self.bar.iter_mut().zip(&point).for_each(|(bar, weight)| *bar += weight);
            self.bar[places.acting()].iter_mut().zip(&held).for_each(|(bar, weight)| *bar += weight);
        }
        self.walker.points = points;
        Ok(())
    }

    fn finish(self) -> Vec<f64> {
        let (mut gradient, directions) = (self.gradient, &self.prepared.directions);
        let count = directions.count.max(1);
        for (weights, rates) in [(&self.set_up, &directions.set_up), (&self.bar, &directions.start)] {
            for (weight, row) in weights.iter().zip(rates.chunks_exact(count)) {
                gradient.iter_mut().zip(row).for_each(|(sum, rate)| *sum += weight * rate);
            }
        }
        gradient
    }
}

/// Whose adjoint.
#[derive(Clone, Copy)]
enum Of {
    Law,
    Rates,
}

#[cfg(test)]
mod tests {
    use super::stride;

    #[test]
    fn checkpoints_keep_to_the_memory() {
        for (operations, size, memory) in [(0, 4, 1 << 20), (10_000, 30, 1 << 26), (1_000_000, 30, 1 << 20), (1_000_000, 100, 1 << 28)] {
            let stride = stride(operations, size, memory);
            let states = operations.div_ceil(stride) + stride;
            let most = (memory / (8 * size)).max(2 * operations.isqrt() + 3);
            assert!(states <= most, "{operations} {size} {memory}: {states} of {most}");
        }
        assert_eq!(stride(1000, 10, 1 << 26), 1);
    }
}
