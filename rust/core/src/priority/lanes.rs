//! Many stacks of the same sizes: (5) by `regular`, one stack per lane. A lane where that route declines is left to the recursion over
//! singular values, alone, so that every row has the bits, ranks and status of a single solve, whatever its neighbours are.

use super::method::Method;
use super::metric::Metric;
use super::regular::{Asked, Lanewise, MOST_JOINTS_IN_LANES, Room, regular, regular_ranks};
use super::solver::PrioritySolver;
use crate::error::Result;
use crate::interrupt::look;
use crate::scalar::rows::{read_rows, write_rows};
use crate::scalar::{Kernel, Real, Task, run_lanes};
use crate::status::Status;

/// Where the stacks of a batch come from and where their answers go, `S::LANES` of them from row `at` on; what is read beyond the last
/// row repeats it. Both functions must be `#[inline(always)]`.
pub trait Stacks<S> {
    /// Jacobians `(sum rows, n)` and task velocities `(sum rows,)`; the relative error of the Jacobians' entries.
    fn read(&mut self, at: usize, jacobian: &mut [S], command: &mut [S]) -> S;
    /// Joint velocities `(n,)` and residuals `(sum rows,)`; of lanes that declined, anything.
    fn write(&mut self, at: usize, v: &[S], residual: &[S]);
}

/// A solver for one stack per lane.
pub struct Group<S> {
    n: usize,
    rows: Vec<usize>,
    eps: Option<Vec<f64>>,
    metric: Option<Metric>,
    exact: bool,
    jacobian: Vec<S>,
    command: Vec<S>,
    room: Room<S>,
}

impl<S: Real> Group<S> {
    /// With the sizes and options of `solver`; `None` where its method or its size has no lanes.
    pub fn new(solver: &PrioritySolver) -> Option<Self> {
        let (n, rows) = (solver.n(), solver.rows());
        if n > MOST_JOINTS_IN_LANES || matches!(solver.method(), Method::Chiaverini | Method::Sns) {
            return None;
        }
        let total = rows.iter().sum::<usize>();
        let (eps, metric) = solver.thresholds_and_metric();
        Some(Group {
            n,
            rows: rows.to_vec(),
            eps: eps.map(<[f64]>::to_vec),
            metric: metric.cloned(),
            exact: solver.method() == Method::Exact,
            jacobian: vec![S::zero(); total * n],
            command: vec![S::zero(); total],
            room: Room::new(n, rows),
        })
    }

    /// Solve rows `0..count`; the rows to be solved alone are added to `declined`.
    pub fn run(&mut self, stacks: &mut impl Stacks<S>, count: usize, declined: &mut Vec<usize>) {
        macro_rules! of_length {
            ($($n:literal)*) => {
                match self.n {
                    $(0..=$n => S::enter(Rows::<S, _, $n> { group: self, stacks, count, declined }),)*
                    _ => declined.extend(0..count),
                }
            };
        }
        of_length!(2 3 4 6 7 8)
    }
}

/// All rows, compiled for one row length.
struct Rows<'a, S, T, const N: usize> {
    group: &'a mut Group<S>,
    stacks: &'a mut T,
    count: usize,
    declined: &'a mut Vec<usize>,
}

impl<S: Real, T: Stacks<S>, const N: usize> Kernel for Rows<'_, S, T, N> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Rows { group, stacks, count, declined } = self;
        let Group { n, rows, eps, metric, exact, jacobian, command, room } = group;
        for at in (0..count).step_by(S::LANES) {
            let rounding = stacks.read(at, jacobian, command);
            let asked = Asked { n: *n, rows, eps: eps.as_deref(), metric: metric.as_ref(), exact: *exact };
            let stands = regular::<S, N>(&asked, rounding, &Lanewise { jacobian, command }, room);
            stacks.write(at, &room.v, &room.residual);
            if !S::all(stands) {
                let stands = S::select(stands, S::splat(1.0), S::zero());
                declined.extend((0..S::LANES.min(count - at)).filter(|&lane| stands.lane(lane) == 0.0).map(|lane| at + lane));
            }
        }
    }
}

/// A batch of stacks from plain matrices: per level Jacobians `(count, rows_i, n)` and velocities `(count, rows_i)`, row-major, or one of
/// them for all rows.
#[derive(Clone, Copy)]
pub struct StackRows<'a> {
    pub jacobians: &'a [&'a [f64]],
    pub velocities: &'a [&'a [f64]],
}

/// The answers of some rows: `v` `(count, n)`, per level residuals `(count, rows_i)`, `ranks` and `scales` `(count, levels)`,
/// `status` `(count,)` by code. A row that fails is NaN with `Status::Diverged` and ranks of zero.
pub struct StackAnswers<'a> {
    pub v: &'a mut [f64],
    pub residuals: Vec<&'a mut [f64]>,
    pub ranks: &'a mut [i64],
    pub scales: &'a mut [f64],
    pub status: &'a mut [i32],
}

/// Solves batches of stacks on the calling thread; its buffers last.
pub struct LaneSolver {
    engine: Option<Box<dyn Engine>>,
    single: PrioritySolver,
    declined: Vec<usize>,
}

impl LaneSolver {
    pub fn new(solver: &PrioritySolver) -> Self {
        LaneSolver { engine: run_lanes(MakeLanes(solver)), single: solver.clone(), declined: Vec::new() }
    }

    /// Solve rows `first..last` of the batch.
    pub fn solve(&mut self, given: &StackRows, first: usize, last: usize, answers: &mut StackAnswers) {
        let count = last - first;
        let LaneSolver { engine, single, declined } = self;
        let (n, levels) = (single.n(), single.rows().len());
        declined.clear();
        match engine {
            Some(engine) => engine.solve(given, first, last, answers, declined),
            None => declined.extend(0..count),
        }
        if declined.len() < count {
            answers.ranks.chunks_exact_mut(levels).for_each(|ranks| {
                ranks.iter_mut().zip(regular_ranks(n, single.rows())).for_each(|(to, rank)| *to = rank as i64);
            });
            answers.scales.fill(1.0);
            answers.status.fill(Status::Success.code());
        }
        for &i in declined.iter() {
            look();
            let ended = solve_one(single, given, first + i);
            let sound = ended.is_ok();
            let or_nan = |x: f64| if sound { x } else { f64::NAN };
            answers.status[i] = ended.unwrap_or(Status::Diverged).code();
            answers.v[i * n..(i + 1) * n].iter_mut().zip(single.v()).for_each(|(to, x)| *to = or_nan(*x));
            for (level, residual) in answers.residuals.iter_mut().enumerate() {
                let m = single.rows()[level];
                residual[i * m..(i + 1) * m].iter_mut().zip(single.residual(level)).for_each(|(to, x)| *to = or_nan(*x));
                answers.ranks[i * levels + level] = if sound { single.ranks()[level] as i64 } else { 0 };
                answers.scales[i * levels + level] = or_nan(single.scales()[level]);
            }
        }
    }
}

/// Row `i` of the batch by itself.
fn solve_one(solver: &mut PrioritySolver, given: &StackRows, i: usize) -> Result<Status> {
    let (n, levels) = (solver.n(), solver.rows().len());
    let (mut at, mut to) = (0, 0);
    for level in 0..levels {
        let m = solver.rows()[level];
        let (jacobian, command) = solver.inputs();
        jacobian[at..at + m * n].copy_from_slice(row(given.jacobians[level], m * n, i));
        command[to..to + m].copy_from_slice(row(given.velocities[level], m, i));
        at += m * n;
        to += m;
    }
    solver.run()
}

/// Row `i` of values with rows of this width, or the only one.
fn row(values: &[f64], width: usize, i: usize) -> &[f64] {
    let i = if values.len() == width { 0 } else { i };
    &values[i * width..(i + 1) * width]
}

/// A group whose number is known at run time only.
trait Engine: Send {
    fn solve(&mut self, given: &StackRows, first: usize, last: usize, answers: &mut StackAnswers, declined: &mut Vec<usize>);
}

struct MakeLanes<'a>(&'a PrioritySolver);

impl Task for MakeLanes<'_> {
    type Output = Option<Box<dyn Engine>>;
    fn run<S: Real>(self) -> Option<Box<dyn Engine>> {
        let rounding = S::splat(self.0.rounding());
        Group::<S>::new(self.0).map(|group| Box::new(Matrices { group, rounding }) as Box<dyn Engine>)
    }
}

struct Matrices<S> {
    group: Group<S>,
    rounding: S,
}

impl<S: Real> Engine for Matrices<S> {
    fn solve(&mut self, given: &StackRows, first: usize, last: usize, answers: &mut StackAnswers, declined: &mut Vec<usize>) {
        let (n, rows) = (self.group.n, self.group.rows.clone());
        let mut batch = Batch { given, first, last, answers, n, rows: &rows, rounding: self.rounding };
        self.group.run(&mut batch, last - first, declined);
    }
}

/// Rows `first..last` on their way through the lanes.
struct Batch<'a, 'b, S> {
    given: &'a StackRows<'a>,
    first: usize,
    last: usize,
    answers: &'a mut StackAnswers<'b>,
    n: usize,
    rows: &'a [usize],
    rounding: S,
}

impl<S: Real> Batch<'_, '_, S> {
    /// The part of one level, or the only one for all lanes. Not a closure, which would not be inlined into the region.
    #[inline(always)]
    fn read_part(&self, given: &[f64], at: usize, width: usize, to: &mut [S]) {
        if given.len() == width {
            to.iter_mut().zip(given).for_each(|(to, &x)| *to = S::splat(x));
        } else {
            read_rows(&given[self.first * width..self.last * width], at, self.last - self.first, width, to);
        }
    }
}

impl<S: Real> Stacks<S> for Batch<'_, '_, S> {
    #[inline(always)]
    fn read(&mut self, at: usize, jacobian: &mut [S], command: &mut [S]) -> S {
        let (mut start, n) = (0, self.n);
        for (level, &m) in self.rows.iter().enumerate() {
            self.read_part(self.given.jacobians[level], at, m * n, &mut jacobian[start * n..(start + m) * n]);
            self.read_part(self.given.velocities[level], at, m, &mut command[start..start + m]);
            start += m;
        }
        self.rounding
    }

    #[inline(always)]
    fn write(&mut self, at: usize, v: &[S], residual: &[S]) {
        write_rows(v, &mut self.answers.v[at * self.n..]);
        let mut start = 0;
        for (level, &m) in self.rows.iter().enumerate() {
            write_rows(&residual[start..start + m], &mut self.answers.residuals[level][at * m..]);
            start += m;
        }
    }
}
