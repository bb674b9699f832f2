//! The state of a run as one vector, and the operations on this vector.

use super::combine::{add_slopes, advance};
use super::functions::{Call, Function, Sizes};
use super::prepared::Prepared;
use super::timeline::{Acting, Operation, Timeline};
use crate::error::{Error, Result, all_finite};
use crate::integrate::Tableau;
use crate::interrupt;
use crate::linalg::Pairs;
use crate::motion::Side;
use crate::simulate::assembly::start;
use crate::simulate::problem::sampling::CHANNELS;
use crate::status::Status;
use std::ops::Range;

/// The layout of a state: `[x, held input, outputs of the law, measurements]`. A continuous loop has only `x`.
#[derive(Clone, Copy, Debug)]
pub struct Places {
    states: usize,
    plant: usize,
    n: usize,
    torque_states: Option<usize>,
    answer: usize,
    /// The number of outputs of the law that the state stores, as a ring buffer.
    answers: usize,
    /// The number of measurements that the state stores, as a ring buffer.
    measurements: usize,
}

impl Places {
    pub fn of(sizes: &Sizes, timeline: &Timeline) -> Self {
        let Sizes { states, plant, n, torque_states, answer, .. } = *sizes;
        let continuous = Places { states, plant, n, torque_states, answer: 0, answers: 0, measurements: 0 };
        let Some(sampling) = &timeline.sampling else { return continuous };
        let waiting = (sampling.delay / sampling.period).ceil() as usize;
        Places { answer, answers: waiting + 2, measurements: sampling.sensor_delay + 1, ..continuous }
    }
    pub fn x(&self) -> Range<usize> {
        0..self.states
    }
    /// The range of the law's states.
    pub fn z(&self) -> Range<usize> {
        self.plant..self.states
    }
    pub fn acting(&self) -> Range<usize> {
        self.states..self.states + self.answer
    }
    /// The output of the law at sample `k`.
    pub fn answer(&self, k: u64) -> Range<usize> {
        let first = self.states + self.answer * (1 + (k % self.answers as u64) as usize);
        first..first + self.answer
    }
    /// The plant's input in results of the law that start at `first`.
    pub fn output(&self, first: usize) -> Range<usize> {
        first..first + self.n
    }
    /// The rates of the law's state in results of the law that start at `first`.
    pub fn rates(&self, first: usize) -> Range<usize> {
        first + self.n..first + self.answer
    }
    /// The pairs `(output, rate)` of each rate in results from `first` on that has the plant's input as a term.
    pub fn torque_rates(&self, first: usize) -> impl Iterator<Item = (usize, usize)> + use<> {
        let (n, torque_states) = (self.n, self.torque_states);
        torque_states.into_iter().flat_map(move |rate| (first..first + n).map(move |output| (output, output + n + rate)))
    }
    /// The measurement at sample `k`.
    pub fn measured(&self, k: u64) -> Range<usize> {
        let first = self.states + self.answer * (1 + self.answers) + self.plant * (k % self.measurements as u64) as usize;
        first..first + self.plant
    }
    pub fn size(&self) -> usize {
        if self.answers == 0 { self.states } else { self.states + self.answer * (1 + self.answers) + self.plant * self.measurements }
    }
}

/// Return the sample whose measurement the law receives at sample `k`. With a sensor delay, this is an earlier sample.
pub fn seen(timeline: &Timeline, k: u64) -> u64 {
    k.saturating_sub(timeline.sampling.as_ref().map_or(0, |sampling| sampling.sensor_delay as u64))
}

/// Return the side of the time of a stage at `c` step sizes after the start of a step. It is the side on which the step is.
pub fn side_of(c: f64) -> Side {
    if c < 1.0 { Side::After } else { Side::Before }
}

/// The positions whose rates are also components of the state, as pairs `(index of the position, index of its rate)`.
pub fn followers(sizes: &Sizes) -> Vec<(usize, usize)> {
    let pairs = Pairs { joints: sizes.n, count: sizes.plant / (2 * sizes.n), quadratures: 0 };
    (0..sizes.plant).filter_map(|i| pairs.rate_of(i).map(|rate| (i, rate))).collect()
}

/// Applies the operations to a state, without derivatives.
pub struct Walker<'a> {
    pub(super) prepared: &'a Prepared<'a>,
    pub places: Places,
    /// The state rates.
    pub(super) rates: Call,
    law: Call,
    /// The adjoints of the guard functions.
    pub(super) guards: Vec<Call>,
    /// The margins of the branches, their adjoint, and the state rates with given results of all comparisons.
    pub(super) branches: Option<[Call; 3]>,
    /// Memory for the modes of contacts and the results of comparisons.
    pub(super) modes: Vec<f64>,
    pub(super) u: Vec<f64>,
    /// The states at the stages of the last step.
    pub points: Vec<f64>,
    /// The state rates at the stages of the last step.
    pub slopes: Vec<f64>,
    followers: Vec<(usize, usize)>,
    /// For each input, whether the rate limit changed it at the last sample.
    pub limited: Vec<bool>,
    /// The state that the law received at the last sample.
    pub shown: Vec<f64>,
    /// The state that the last `Leave` stored.
    left: Vec<f64>,
}

impl<'a> Walker<'a> {
    pub fn new(prepared: &'a Prepared<'a>) -> Self {
        let (sizes, stages, given) = (&prepared.functions.sizes, prepared.tableau.b.len(), prepared.given());
        let calls = |[margins, held]: &[Function; 2]| [margins.value(given), margins.adjoint(given), held.value(given)];
        Walker {
            prepared,
            places: Places::of(sizes, &prepared.timeline),
            rates: prepared.functions.rates.value(given),
            law: prepared.functions.law.value(given),
            guards: prepared.functions.guards.iter().map(|function| function.adjoint(given)).collect(),
            branches: prepared.functions.branches.as_ref().map(calls),
            modes: Vec::new(),
            u: vec![0.0; sizes.width],
            points: vec![0.0; stages * sizes.states],
            slopes: vec![0.0; stages * sizes.states],
            followers: followers(sizes),
            limited: vec![false; sizes.n],
            shown: vec![0.0; sizes.states],
            left: Vec::new(),
        }
    }

    /// Return the initial state of the run.
    pub fn start(&self) -> Vec<f64> {
        let mut state = start::<f64>(&self.prepared.single, |_| 0);
        state.resize(self.places.size(), 0.0);
        state
    }

    pub fn apply(&mut self, operation: Operation, state: &mut [f64]) -> Result<()> {
        interrupt::check();
        match operation {
            Operation::Sample { k, t } => self.sample(k, t, state),
            Operation::Act(acting) => {
                act(&self.places, acting, state, 1);
                Ok(())
            }
            Operation::Step { t, h, end, mode } => self.step((t, h, end), mode, state),
            Operation::Record { .. } | Operation::Switch { .. } | Operation::Branch { .. } => Ok(()),
            Operation::Restore(k) => {
                self.restore(k, state);
                Ok(())
            }
            Operation::Leave => {
                self.left.clear();
                self.left.extend_from_slice(state);
                Ok(())
            }
            Operation::Rejoin => {
                state.copy_from_slice(&self.left);
                Ok(())
            }
        }
    }

    /// Copy state `k` of the run after a divided step to `state`.
    pub fn restore(&self, k: usize, state: &mut [f64]) {
        let size = state.len();
        state.copy_from_slice(&self.prepared.timeline.states[k * size..(k + 1) * size]);
    }

    /// Store the measurement of sample `k`, evaluate the law, and limit the rate of the law's output.
    pub fn sample(&mut self, k: u64, t: f64, state: &mut [f64]) -> Result<()> {
        let (places, n) = (self.places, self.prepared.functions.sizes.n);
        let Some(sampling) = &self.prepared.timeline.sampling else { return Ok(()) };
        let measured = places.measured(k);
        for i in 0..measured.len() {
            let channel = i / n;
            let x = state[i];
            state[measured.start + i] = if channel < CHANNELS.len() { sampling.measure(sampling.seed, k, channel, i % n, x) } else { x };
        }
        let (plant, law) = self.shown.split_at_mut(places.z().start);
        plant.copy_from_slice(&state[places.measured(seen(&self.prepared.timeline, k))]);
        law.copy_from_slice(&state[places.z()]);
        self.prepared.directions.input(t, &mut self.u);
        self.law.give([&self.u, &self.shown, &[], &[]]);
        self.law.run(t)?;
        state[places.answer(k)].copy_from_slice(self.law.answers());
        add_output(&places, places.answer(k).start, -1.0, state, 1);
        self.limited.fill(false);
        if sampling.rate_limit.is_finite() {
            let instant = |k: u64| sampling.instant(sampling.seed, k, self.prepared.timeline.grid);
            let since = k.checked_sub(1).map_or(sampling.period, |before| instant(k) - instant(before));
            let most = sampling.rate_limit * since;
            for i in 0..n {
                let last = k.checked_sub(1).map_or(0.0, |before| state[places.answer(before).start + i]);
                let tau = &mut state[places.answer(k).start + i];
                self.limited[i] = (*tau - last).abs() > most;
                *tau = tau.clamp(last - most, last + most);
            }
        }
        Ok(())
    }

    /// Hold the contacts in mode `mode` of the timeline.
    pub fn hold(&mut self, mode: usize) {
        self.modes.clear();
        self.modes.extend(self.prepared.timeline.contacts.numbers(mode));
    }

    /// Compute the states and the state rates at the stages of a step.
    pub fn stages(&mut self, (t, h, end): (f64, f64, f64), mode: usize, state: &[f64]) -> Result<()> {
        let Tableau { c, a, b, .. } = &self.prepared.tableau;
        let (x, size) = (&state[self.places.x()], self.places.states);
        self.hold(mode);
        for i in 0..b.len() {
            let (earlier, later) = self.slopes.split_at_mut(i * size);
            let point = &mut self.points[i * size..(i + 1) * size];
            add_slopes(x, h, &a[i], earlier, point);
            let instant = (t + c[i] * h).min(end);
            self.prepared.directions.input(instant, &mut self.u);
            self.rates.give([&self.u, point, &state[self.places.acting()], &self.modes]);
            self.rates.run(instant)?;
            later[..size].copy_from_slice(&self.rates.answers()[..size]);
        }
        Ok(())
    }

    fn step(&mut self, (t, h, end): (f64, f64, f64), mode: usize, state: &mut [f64]) -> Result<()> {
        self.stages((t, h, end), mode, state)?;
        advance(&self.prepared.tableau, h, &mut self.slopes, &self.followers, &mut state[self.places.x()], 1);
        if !all_finite(&state[self.places.x()]) {
            let problem = format!("the run diverged at t = {end} s");
            return Err(Error::Solve { status: Status::Diverged, t: end, problem });
        }
        Ok(())
    }
}

/// Copy the results of the law that act to the held input. `state` has `lanes` numbers for each component.
pub fn act(places: &Places, acting: Acting, state: &mut [f64], lanes: usize) {
    let all = |range: Range<usize>| range.start * lanes..range.end * lanes;
    let to = places.acting().start;
    match acting.output {
        Some(k) => state.copy_within(all(places.output(places.answer(k).start)), to * lanes),
        None => state[all(places.output(to))].fill(0.0),
    }
    state.copy_within(all(places.rates(places.answer(acting.rates).start)), places.rates(to).start * lanes);
    add_output(places, to, 1.0, state, lanes);
}

/// In results of the law from `first` on, add `sign` times the plant's input to each rate that has this input as a term.
pub fn add_output(places: &Places, first: usize, sign: f64, state: &mut [f64], lanes: usize) {
    for (output, rate) in places.torque_rates(first) {
        (0..lanes).for_each(|lane| state[rate * lanes + lane] += sign * state[output * lanes + lane]);
    }
}
