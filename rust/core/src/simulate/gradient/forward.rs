//! Tangents of a run: `S = dX/dp` goes through every operation, `S_(k+1) = Phi_x S_k + Phi_p`. A direction per lane of the programs.

use super::Prepared;
use super::functions::Call;
use super::timeline::Operation;
use super::walk::{Walker, act, add_slopes, advance, followers, seen};
use crate::error::Result;
use crate::memory;

/// A function with its tangent, of all groups of directions.
struct Tangent {
    groups: Vec<Call>,
    /// Numbers that move: of the set-up, and from outside.
    moved: usize,
    answers: usize,
}

impl Tangent {
    /// Each group has the rates of its set-up for good.
    fn new(call: &Call, groups: usize, answers: usize, prepared: &Prepared) -> Self {
        let (lanes, directions) = (call.lanes(), &prepared.directions);
        let group = |g: usize| {
            let mut call = call.clone();
            for (to, rates) in call.more(0, directions.moved).chunks_exact_mut(lanes).zip(directions.set_up.chunks_exact(directions.count))
            {
                let own = &rates[g * lanes..((g + 1) * lanes).min(rates.len())];
                to.fill(0.0);
                to[..own.len()].copy_from_slice(own);
            }
            call
        };
        Tangent { groups: (0..groups).map(group).collect(), moved: directions.moved, answers }
    }

    /// The values at `parts`, and the rates of them along `rates` (rows of `total` directions), at time `t`.
    fn call(&mut self, t: f64, parts: [&[f64]; 3], rates: [&[f64]; 3], value: &mut [f64], out: &mut [f64]) -> Result<()> {
        let (moved, answers, groups) = (self.moved, self.answers, self.groups.len());
        for (g, call) in self.groups.iter_mut().enumerate() {
            let lanes = call.lanes();
            let total = groups * lanes;
            call.give(parts);
            let rows = rates.iter().flat_map(|rates| rates.chunks_exact(total));
            let count = rates.iter().map(|rates| rates.len() / total).sum();
            for (to, from) in call.more(moved, count).chunks_exact_mut(lanes).zip(rows) {
                to.copy_from_slice(&from[g * lanes..(g + 1) * lanes]);
            }
            call.run(t)?;
            value.iter_mut().zip(call.answers().chunks_exact(lanes)).for_each(|(value, lanes)| *value = lanes[0]);
            for (to, from) in out.chunks_exact_mut(total).zip(call.behind(0, answers).chunks_exact(lanes)) {
                to[g * lanes..(g + 1) * lanes].copy_from_slice(from);
            }
        }
        Ok(())
    }
}

/// A run with its tangents.
struct Forward<'a> {
    prepared: &'a Prepared<'a>,
    walker: Walker<'a>,
    rates: Tangent,
    law: Tangent,
    /// Directions with those that fill the last group.
    total: usize,
    state: Vec<f64>,
    /// The rates of the state, a row of directions per number.
    tangent: Vec<f64>,
    left: (Vec<f64>, Vec<f64>),
    u: Vec<f64>,
    u_rates: Vec<f64>,
    room: Vec<f64>,
    followers: Vec<(usize, usize)>,
}

/// The rates of all records.
pub fn run(prepared: &Prepared) -> Result<Vec<f64>> {
    let (sizes, directions, timeline) = (&prepared.functions.sizes, &prepared.directions, &prepared.timeline);
    let numbers = sizes.states + sizes.n;
    let mut out = memory::zeros(timeline.records.saturating_mul(numbers).saturating_mul(directions.count))?;
    if directions.count == 0 {
        return Ok(out);
    }
    let mut forward = Forward::new(prepared)?;
    for &operation in &timeline.operations {
        if let Operation::Record { i, t } = operation {
            let to = &mut out[i * numbers * directions.count..(i + 1) * numbers * directions.count];
            forward.record(t, to)?;
        } else {
            forward.apply(operation)?;
        }
    }
    Ok(out)
}

impl<'a> Forward<'a> {
    fn new(prepared: &'a Prepared<'a>) -> Result<Self> {
        let (functions, directions) = (&prepared.functions, &prepared.directions);
        let (rates, law) = (functions.rates.tangent(), functions.law.tangent());
        let lanes = rates.lanes();
        let groups = directions.count.div_ceil(lanes);
        let total = groups * lanes;
        let walker = Walker::new(prepared);
        let state = walker.start();
        let mut tangent = memory::zeros(state.len().saturating_mul(total))?;
        for (to, from) in tangent.chunks_exact_mut(total).zip(directions.start.chunks_exact(directions.count)) {
            to[..directions.count].copy_from_slice(from);
        }
        let sizes = &functions.sizes;
        Ok(Forward {
            rates: Tangent::new(&rates, groups, functions.rates.answers(), prepared),
            law: Tangent::new(&law, groups, functions.law.answers(), prepared),
            prepared,
            walker,
            total,
            state,
            tangent,
            left: Default::default(),
            u: vec![0.0; sizes.width],
            u_rates: memory::zeros(sizes.driven().saturating_mul(total))?,
            room: vec![0.0; 2 * sizes.width],
            followers: followers(sizes),
        })
    }

    /// What comes from outside at `t`, and its rates.
    fn look_outside(&mut self, t: f64) {
        let (directions, total) = (&self.prepared.directions, self.total);
        directions.input(t, &mut self.u);
        if directions.drives() {
            let rates = &mut self.u_rates;
            directions.input_rates(t, &self.u, &mut self.room, |slot, parameter, rate| rates[slot * total + parameter] = rate);
        }
    }

    fn apply(&mut self, operation: Operation) -> Result<()> {
        let (places, total) = (self.walker.places, self.total);
        match operation {
            Operation::Sample { k, t } => return self.sample(k, t),
            Operation::Act(k) => {
                act(&places, k, &mut self.state);
                match k {
                    Some(k) => {
                        let (from, to) = (places.answer(k), places.acting().start);
                        self.tangent.copy_within(from.start * total..from.end * total, to * total);
                    }
                    None => self.tangent[places.acting().start * total..places.acting().end * total].fill(0.0),
                }
            }
            Operation::Step { t, h, end } => return self.step(t, h, end),
            Operation::Record { .. } => {}
            Operation::Leave => self.left = (self.state.clone(), self.tangent.clone()),
            Operation::Back => {
                self.state.copy_from_slice(&self.left.0);
                self.tangent.copy_from_slice(&self.left.1);
            }
        }
        Ok(())
    }

    fn sample(&mut self, k: u64, t: f64) -> Result<()> {
        let (places, total, n) = (self.walker.places, self.total, self.prepared.functions.sizes.n);
        self.walker.sample(k, t, &mut self.state)?;
        self.look_outside(t);
        // Noise and quantisation pass rates on as they are.
        self.tangent.copy_within(0..places.z().start * total, places.measured(k).start * total);
        let (from, z) = (places.measured(seen(&self.prepared.timeline, k)), places.z());
        let shown = [&self.tangent[from.start * total..from.end * total], &self.tangent[z.start * total..z.end * total]].concat();
        let mut rates = vec![0.0; places.answer(k).len() * total];
        let mut value = vec![0.0; places.answer(k).len()];
        self.law.call(t, [&self.u, &self.walker.shown, &[]], [&self.u_rates, &shown, &[]], &mut value, &mut rates)?;
        for i in (0..n).filter(|&i| self.walker.limited[i]) {
            let row = &mut rates[i * total..(i + 1) * total];
            match k.checked_sub(1) {
                Some(before) => {
                    let last = places.answer(before).start + i;
                    row.copy_from_slice(&self.tangent[last * total..(last + 1) * total]);
                }
                None => row.fill(0.0),
            }
        }
        self.tangent[places.answer(k).start * total..places.answer(k).end * total].copy_from_slice(&rates);
        Ok(())
    }

    fn step(&mut self, t: f64, h: f64, end: f64) -> Result<()> {
        let tableau = &self.prepared.tableau;
        let (places, total, size) = (self.walker.places, self.total, self.prepared.functions.sizes.states);
        let stages = tableau.b.len();
        let (mut slopes, mut slope_rates) = (vec![0.0; stages * size], vec![0.0; stages * size * total]);
        let (mut point, mut point_rates) = (vec![0.0; size], vec![0.0; size * total]);
        for i in 0..stages {
            add_slopes(&self.state[places.x()], h, &tableau.a[i], &slopes[..i * size], &mut point);
            add_slopes(&self.tangent[..size * total], h, &tableau.a[i], &slope_rates[..i * size * total], &mut point_rates);
            let instant = (t + tableau.c[i] * h).min(end);
            self.look_outside(instant);
            let acting = places.acting();
            let held = &self.tangent[acting.start * total..acting.end * total];
            let parts = [&self.u, point.as_slice(), &self.state[acting.clone()]];
            let (value, rate) = (&mut slopes[i * size..(i + 1) * size], &mut slope_rates[i * size * total..(i + 1) * size * total]);
            self.rates.call(instant, parts, [&self.u_rates, &point_rates, held], value, rate)?;
        }
        advance(tableau, h, &slopes, &self.followers, &mut self.state[places.x()], 1);
        advance(tableau, h, &slope_rates, &self.followers, &mut self.tangent[..size * total], total);
        Ok(())
    }

    /// The rates of a record `[x, tau]`.
    fn record(&mut self, t: f64, out: &mut [f64]) -> Result<()> {
        let sizes = &self.prepared.functions.sizes;
        let (places, total, count, size, n) = (self.walker.places, self.total, self.prepared.directions.count, sizes.states, sizes.n);
        let tau = if sizes.sampled {
            let first = places.acting().start;
            self.tangent[first * total..(first + n) * total].to_vec()
        } else {
            self.look_outside(t);
            let (mut value, mut rates) = (vec![0.0; sizes.answer], vec![0.0; sizes.answer * total]);
            let parts = [&self.u, &self.state[places.x()], &[]];
            self.law.call(t, parts, [&self.u_rates, &self.tangent[..size * total], &[]], &mut value, &mut rates)?;
            rates.truncate(n * total);
            rates
        };
        let rows = self.tangent[..size * total].chunks_exact(total).chain(tau.chunks_exact(total));
        out.chunks_exact_mut(count).zip(rows).for_each(|(to, from)| to.copy_from_slice(&from[..count]));
        Ok(())
    }
}
