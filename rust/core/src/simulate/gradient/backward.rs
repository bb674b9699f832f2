//! The adjoint of a run: `l_k = Phi_x' l_(k+1) + loss_x(k)`, `grad = x0_p' l_0 + sum Phi_p' l_(k+1)`, for the operations
//! `X_(k+1) = Phi(X_k, p)` from the last to the first. `'` is the transpose. `Phi_x` and `Phi_p` are the derivatives of `Phi` with respect
//! to the state `X` and the parameters `p`. `x0_p` are the derivatives of the initial state. `l_k` are the weights of `X_k`: the
//! derivatives of the weighted sum of the records with respect to `X_k`. `loss_x(k)` are the weights of a record at `X_k`.
//!
//! Each operation is differentiated at the state before it. Checkpoints store some of these states. The states after a checkpoint are
//! computed again (Griewank and Walther 2008, chapter 12).

use super::combine::add;
use super::functions::Call;
use super::prepared::Prepared;
use super::switch::Jump;
use super::timeline::{Acting, Operation};
use super::walk::{Walker, followers, seen, side_of};
use crate::error::Result;
use crate::memory;
use crate::motion::Side;
use std::ops::Range;

/// The number of operations between two checkpoints for which all stored states take at most `memory` bytes. A checkpoint stores `size`
/// numbers, and each operation after it stores `record` numbers. If `memory` is too small, the result is the square root of `operations`.
fn stride(operations: usize, size: usize, record: usize, memory: usize) -> usize {
    let (numbers, record) = (memory / 8, record.max(1));
    if operations <= numbers / record {
        return operations.max(1);
    }
    let stride = numbers / (2 * record);
    let fits = stride > 0 && operations.div_ceil(stride) <= numbers / (2 * size.max(1));
    if fits { stride } else { operations.isqrt().max(1) }
}

/// The backward pass of a run.
struct Backward<'a> {
    prepared: &'a Prepared<'a>,
    walker: Walker<'a>,
    /// For each contact mode, the adjoint of the state rates.
    rates: Call,
    /// Memory for the modes of contacts.
    modes: Vec<f64>,
    law: Call,
    /// The weights of the present state.
    bar: Vec<f64>,
    aside: Vec<f64>,
    /// The weights of the varying loop parameters.
    set_up: Vec<f64>,
    gradient: Vec<f64>,
    u: Vec<f64>,
    looked: f64,
    scratch: Vec<f64>,
    /// The weights of the results of a function.
    answer: Vec<f64>,
    /// The weights of the slopes of a step.
    slopes: Vec<f64>,
    /// The weights of the state and of the held input that the last call of `pass` computed.
    passed: Vec<f64>,
    followers: Vec<(usize, usize)>,
}

/// Return the derivatives of the weighted sum of the records with respect to all parameters.
pub fn run(prepared: &Prepared, weights: &[f64], memory: usize) -> Result<Vec<f64>> {
    let operations = &prepared.timeline.operations;
    let mut backward = Backward::new(prepared);
    let mut state = backward.walker.start();
    let size = state.len();
    let record = size + backward.walker.points.len();
    let stride = stride(operations.len(), size, record, memory);
    // The operations between `Leave` and `Rejoin` compute a record between two steps. No checkpoint stores their states.
    let mut on_path = true;
    let (mut checkpoints, mut stored) = (Vec::new(), Vec::new());
    for (k, &operation) in operations.iter().enumerate() {
        if on_path && checkpoints.last().is_none_or(|&last| k >= last + stride) {
            memory::append(&mut checkpoints, &[k])?;
            memory::append(&mut stored, &state)?;
            // The states after the last checkpoint are computed only once, below.
            if operations.len() - k <= stride {
                break;
            }
        }
        on_path = match operation {
            Operation::Leave => false,
            Operation::Rejoin => true,
            _ => on_path,
        };
        backward.walker.apply(operation, &mut state)?;
    }
    let mut end = operations.len();
    let mut states = Vec::new();
    for (&first, stored) in checkpoints.iter().zip(stored.chunks_exact(size.max(1))).rev() {
        states.clear();
        state.copy_from_slice(stored);
        for &operation in &operations[first..end] {
            memory::append(&mut states, &state)?;
            backward.walker.apply(operation, &mut state)?;
            memory::append(&mut states, &backward.walker.points)?;
        }
        for (k, states) in (first..end).zip(states.chunks_exact_mut(record.max(1))).rev() {
            let (before, points) = states.split_at_mut(size);
            backward.reverse(k, before, points, weights)?;
        }
        end = first;
    }
    Ok(backward.finish())
}

impl<'a> Backward<'a> {
    fn new(prepared: &'a Prepared<'a>) -> Self {
        let (functions, directions) = (&prepared.functions, &prepared.directions);
        let (walker, sizes) = (Walker::new(prepared), &functions.sizes);
        Backward {
            rates: functions.rates.adjoint(prepared.given()),
            modes: Vec::new(),
            law: functions.law.adjoint(prepared.given()),
            bar: vec![0.0; walker.places.size()],
            aside: vec![0.0; walker.places.size()],
            set_up: vec![0.0; directions.moved],
            gradient: vec![0.0; directions.count],
            u: vec![0.0; sizes.width],
            looked: f64::NAN,
            scratch: vec![0.0; 2 * sizes.width],
            answer: vec![0.0; functions.rates.answers().max(functions.law.answers())],
            slopes: vec![0.0; prepared.tableau.b.len() * sizes.states],
            passed: vec![0.0; sizes.states + sizes.answer],
            followers: followers(sizes),
            prepared,
            walker,
        }
    }

    /// Apply the adjoint of operation `k` at the state `before`. `points` are the states at the stages of a step.
    fn reverse(&mut self, k: usize, before: &mut [f64], points: &[f64], weights: &[f64]) -> Result<()> {
        let timeline = &self.prepared.timeline;
        match timeline.operations[k] {
            Operation::Sample { k, t } => return self.sample(k, t, before),
            Operation::Act(acting) => self.act(acting),
            Operation::Switch { k, t } => {
                let jump = self.walker.jump(k, t, before)?;
                self.switch(t, jump);
            }
            Operation::Branch { k, t } => {
                let jump = self.walker.branch_jump(&timeline.crossings[k], t, before)?;
                self.switch(t, jump);
            }
            // The state of the run does not depend on the divided step, but their tangents are equal.
            Operation::Restore(_) => {}
            Operation::Step { t, h, end, mode } => {
                let record = k.checked_sub(1).filter(|&k| timeline.steps_on(k)).map(|k| timeline.operations[k]);
                let tau = if let Some(Operation::Record { i, .. }) = record { self.record_of(i, weights).1 } else { &[] };
                return self.step((t, h, end), mode, before, points, tau);
            }
            Operation::Record { i, t } => return self.record(i, t, before, weights, timeline.steps_on(k)),
            Operation::Leave => self.bar.iter_mut().zip(&self.aside).for_each(|(bar, aside)| *bar += aside),
            Operation::Rejoin => {
                self.aside.copy_from_slice(&self.bar);
                self.bar.fill(0.0);
            }
        }
        Ok(())
    }

    /// The weights of the state and of the input of record `i`.
    fn record_of<'w>(&self, i: usize, weights: &'w [f64]) -> (&'w [f64], &'w [f64]) {
        let sizes = &self.prepared.functions.sizes;
        let numbers = sizes.states + sizes.n;
        weights[i * numbers..(i + 1) * numbers].split_at(sizes.states)
    }

    /// Add the weights of a record `[x, tau]`. If `passed_on` is true, the next step adds the weights of `tau`, because its first stage
    /// evaluates the law.
    fn record(&mut self, i: usize, t: f64, before: &[f64], weights: &[f64], passed_on: bool) -> Result<()> {
        let (sizes, places) = (&self.prepared.functions.sizes, self.walker.places);
        let (x, tau) = self.record_of(i, weights);
        self.bar.iter_mut().zip(x).for_each(|(bar, weight)| *bar += weight);
        if sizes.sampled {
            self.bar[places.acting()].iter_mut().zip(tau).for_each(|(bar, weight)| *bar += weight);
        } else if !passed_on && tau.iter().any(|&weight| weight != 0.0) {
            self.answer.fill(0.0);
            self.answer[..tau.len()].copy_from_slice(tau);
            self.pass(AdjointOf::Law, (t, Side::Moving), [&before[places.x()], &[]])?;
            add(&mut self.bar[places.x()], 1.0, &self.passed);
        }
        Ok(())
    }

    /// Evaluate the exogenous input at time `t`.
    fn look_outside(&mut self, t: f64) {
        if t != self.looked {
            self.prepared.directions.input(t, &mut self.u);
            self.looked = t;
        }
    }

    /// Compute the weights of the state and of the held input from the weights of a function's results. Add the weights of the loop
    /// parameters to `set_up`, and the weights of the exogenous input to `gradient`.
    fn pass(&mut self, of: AdjointOf, (t, side): (f64, Side), [x, held]: [&[f64]; 2]) -> Result<()> {
        self.look_outside(t);
        let (directions, sizes) = (&self.prepared.directions, &self.prepared.functions.sizes);
        let call = match of {
            AdjointOf::Law => &mut self.law,
            AdjointOf::Rates => &mut self.rates,
        };
        let modes = if let AdjointOf::Rates = of { &self.modes[..] } else { &[] };
        call.give([&self.u, x, held, modes]);
        let answers = call.answers().len();
        call.more(0, answers).copy_from_slice(&self.answer[..answers]);
        call.run(t)?;
        let (driven, read) = (sizes.driven(), x.len() + held.len());
        let (set_up, rest) = call.behind(0, sizes.moved + driven + read).split_at(sizes.moved);
        let (outside, rest) = rest.split_at(driven);
        add(&mut self.set_up, 1.0, set_up);
        if driven > 0 {
            let gradient = &mut self.gradient;
            directions
                .input_rates((t, side), &self.u, &mut self.scratch, |slot, parameter, rate| gradient[parameter] += outside[slot] * rate);
        }
        self.passed[..read].copy_from_slice(rest);
        Ok(())
    }

    fn act(&mut self, acting: Acting) {
        let places = self.walker.places;
        let held = places.acting();
        for (output, rate) in places.torque_rates(held.start) {
            self.bar[output] += self.bar[rate];
        }
        let (head, answers) = self.bar.split_at_mut(held.end);
        let mut pass = |from: Range<usize>, to: Range<usize>| {
            answers[to.start - held.end..].iter_mut().zip(&head[from]).for_each(|(to, from)| *to += from);
        };
        if let Some(k) = acting.output {
            pass(places.output(held.start), places.output(places.answer(k).start));
        }
        pass(places.rates(held.start), places.rates(places.answer(acting.rates).start));
        self.bar[held].fill(0.0);
    }

    fn sample(&mut self, k: u64, t: f64, before: &mut [f64]) -> Result<()> {
        let (places, n) = (self.walker.places, self.prepared.functions.sizes.n);
        self.walker.sample(k, t, before)?;
        let answer = places.answer(k);
        self.answer[..answer.len()].copy_from_slice(&self.bar[answer.clone()]);
        self.bar[answer].fill(0.0);
        for i in (0..n).filter(|&i| self.walker.limited[i]) {
            let weight = std::mem::take(&mut self.answer[i]);
            if let Some(last) = k.checked_sub(1) {
                self.bar[places.answer(last).start + i] += weight;
            }
        }
        for (output, rate) in places.torque_rates(0) {
            self.answer[output] -= self.answer[rate];
        }
        let shown = std::mem::take(&mut self.walker.shown);
        self.pass(AdjointOf::Law, (t, Side::Moving), [&shown, &[]])?;
        self.walker.shown = shown;
        let (plant, law) = self.passed.split_at(places.z().start);
        let from = places.measured(seen(&self.prepared.timeline, k));
        self.bar[from].iter_mut().zip(plant).for_each(|(bar, weight)| *bar += weight);
        self.bar[places.z()].iter_mut().zip(law).for_each(|(bar, weight)| *bar += weight);
        // A derivative ignores the rounding of a measurement, and noise does not depend on the state. So the weight of a measurement is
        // added to the weight of the measured state.
        let own = places.measured(k);
        for i in 0..own.len() {
            self.bar[i] += std::mem::take(&mut self.bar[own.start + i]);
        }
        Ok(())
    }

    /// Compute the weights of the state before a jump of the tangents at time `t` from the weights after the jump.
    fn switch(&mut self, t: f64, jump: Option<Jump>) {
        let Some(jump) = jump else { return };
        let weight: f64 = jump.along.iter().zip(&self.bar).map(|(along, bar)| along * bar).sum();
        add(&mut self.bar[..jump.of_state.len()], weight, &jump.of_state);
        add(&mut self.set_up, weight, &jump.of_set_up);
        if self.prepared.functions.sizes.drives && !jump.of_input.is_empty() {
            self.look_outside(t);
            let gradient = &mut self.gradient;
            let rate_of = |slot: usize, parameter: usize, rate: f64| gradient[parameter] += weight * jump.of_input[slot] * rate;
            self.prepared.directions.input_rates((t, Side::Moving), &self.u, &mut self.scratch, rate_of);
        }
    }

    /// Apply the adjoint of a step whose stages have the states `points`. `tau` are the weights of the input recorded at its start.
    fn step(&mut self, (t, h, end): (f64, f64, f64), mode: usize, before: &[f64], points: &[f64], tau: &[f64]) -> Result<()> {
        let (tableau, size, places) = (&self.prepared.tableau, self.prepared.functions.sizes.states, self.walker.places);
        self.modes.clear();
        self.modes.extend(self.prepared.timeline.contacts.numbers(mode));
        if tableau.follows {
            for &(position, rate) in &self.followers {
                self.bar[rate] += h * self.bar[position];
            }
        }
        // First compute the weights of the slopes, then the weights of the stage states.
        for (slopes, b) in self.slopes.chunks_exact_mut(size).zip(&tableau.b) {
            slopes.fill(0.0);
            add(slopes, h * b, &self.bar[..size]);
            if tableau.follows {
                self.followers.iter().for_each(|&(position, _)| slopes[position] = 0.0);
            }
        }
        self.answer.fill(0.0);
        for (i, point) in points.chunks_exact(size).enumerate().rev() {
            let instant = (t + tableau.c[i] * h).min(end);
            self.answer[..size].copy_from_slice(&self.slopes[i * size..(i + 1) * size]);
            if i == 0 {
                self.answer[size..size + tau.len()].copy_from_slice(tau);
            }
            self.pass(AdjointOf::Rates, (instant, side_of(tableau.c[i])), [point, &before[places.acting()]])?;
            let (x, held) = self.passed.split_at(size);
            for (j, &a) in tableau.a[i].iter().enumerate().filter(|(_, a)| **a != 0.0) {
                add(&mut self.slopes[j * size..(j + 1) * size], h * a, x);
            }
            add(&mut self.bar[..size], 1.0, x);
            add(&mut self.bar[places.acting()], 1.0, held);
        }
        Ok(())
    }

    fn finish(self) -> Vec<f64> {
        let (mut gradient, directions) = (self.gradient, &self.prepared.directions);
        let count = directions.count.max(1);
        for (weights, rates) in [(&self.set_up, &directions.set_up), (&self.bar, &self.prepared.start)] {
            for (weight, row) in weights.iter().zip(rates.chunks_exact(count)) {
                gradient.iter_mut().zip(row).for_each(|(sum, rate)| *sum += weight * rate);
            }
        }
        gradient
    }
}

/// Selects the function whose adjoint is computed.
#[derive(Clone, Copy)]
enum AdjointOf {
    Law,
    /// The state rates.
    Rates,
}

#[cfg(test)]
mod tests {
    use super::stride;

    #[test]
    fn checkpoints_keep_to_the_memory() {
        for (operations, size, memory) in [(0, 4, 1 << 20), (10_000, 30, 1 << 26), (1_000_000, 30, 1 << 20), (1_000_000, 100, 1 << 28)] {
            let record = 5 * size;
            let stride = stride(operations, size, record, memory);
            let numbers = size * operations.div_ceil(stride) + record * stride.min(operations);
            // If the memory is too small, the distance between checkpoints is the square root of the number of operations.
            let most = (memory / 8 + size).max((size + record) * (operations.isqrt() + 2));
            assert!(numbers <= most, "{operations} {size} {memory}: {numbers} of {most}");
        }
        assert_eq!(stride(1000, 10, 50, 1 << 26), 1000);
    }
}
