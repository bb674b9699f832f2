//! Joint velocities of prioritised tasks for many rows, on several threads. A row is one configuration or one stack of tasks. The result of
//! a row has the same bits as a single solve, and does not depend on other rows.

use crate::interrupt::{Watch, interruptible};
use crate::law::{ArmBatch, ArmSolver};
use crate::parallel;
use crate::priority::{PrioritySolver, StackAnswers, StackBatch, StackRows};
use crate::status::Status;
use std::sync::atomic::Ordering;

/// The number of rows between two checks for a stop. It is a multiple of every number of lanes, so that it does not change the groups of
/// lanes.
const CHUNK: usize = 1024;

/// The number of rows is rounded up to a multiple of `CHUNK`. Several threads are used only if it is then at least this limit.
const FEW: usize = 2 * CHUNK;

/// Solve the rows for an arm. `q`: positions, shape `(rows, n)`, rad or m. `velocities`: task velocities, shape `(rows, m)`, or `(m,)` for
/// all rows. Results: joint velocities `v`, shape `(rows, n)`, rad/s or m/s, and `status`, shape `(rows,)`. A row that fails is NaN and has
/// the status `Status::Diverged`. Return whether the work was interrupted.
pub fn solve_rows(
    solver: &ArmSolver,
    q: &[f64],
    velocities: &[f64],
    v: &mut [f64],
    status: &mut [Status],
    threads: usize,
    poll: &mut dyn FnMut() -> bool,
) -> bool {
    let (n, m) = (solver.n(), solver.rows().iter().sum::<usize>());
    let (shared, batch) = (velocities.len() == m, ArmBatch::new(solver, status.len()));
    let parts = v.chunks_mut(CHUNK * n).zip(status.chunks_mut(CHUNK)).enumerate().collect::<Vec<_>>();
    each(
        parts,
        threads,
        poll,
        || batch.clone(),
        |batch, (k, (v, status))| {
            let (first, last) = (k * CHUNK, k * CHUNK + status.len());
            let command = if shared { velocities } else { &velocities[first * m..last * m] };
            batch.solve(&q[first * n..last * n], command, v, status);
        },
    )
}

/// Solve a batch of stacks of tasks, given as matrices. Return whether the work was interrupted.
pub fn solve_stacks(
    solver: &PrioritySolver,
    given: &StackRows,
    answers: StackAnswers,
    threads: usize,
    poll: &mut dyn FnMut() -> bool,
) -> bool {
    solve_stacks_by(&StackBatch::new(solver, answers.status.len()), given, answers, threads, poll)
}

/// Solve a batch like [`solve_stacks`], with copies of the solver `batch`. Callers that solve a batch in several parts reuse `batch`.
pub fn solve_stacks_by(
    batch: &StackBatch,
    given: &StackRows,
    mut answers: StackAnswers,
    threads: usize,
    poll: &mut dyn FnMut() -> bool,
) -> bool {
    let solver = batch.solver();
    let count = answers.status.len();
    let parts = |first: usize| (first, answers.first(CHUNK.min(count - first), solver.n(), solver.rows()));
    let parts = (0..count).step_by(CHUNK).map(parts).collect();
    each(
        parts,
        threads,
        poll,
        || batch.clone(),
        |batch, (first, mut part)| {
            batch.solve(given, first, first + part.status.len(), &mut part);
        },
    )
}

/// Call `work` on every part. On several threads, each share of the parts has its own solver. Return whether the work was interrupted.
fn each<P: Send, L>(
    parts: Vec<P>,
    threads: usize,
    poll: &mut dyn FnMut() -> bool,
    solver: impl Fn() -> L + Sync,
    work: impl Fn(&mut L, P) + Sync,
) -> bool {
    if parts.len() * CHUNK < FEW || threads < 2 {
        let mut own = solver();
        for (k, part) in parts.into_iter().enumerate() {
            if k > 0 && poll() {
                return true;
            }
            work(&mut own, part);
        }
        return false;
    }
    parallel::run(threads, parts.len(), poll, |stop| {
        // Each share has contiguous parts, and a thread computes about four shares. A share has a separate solver. Different shares mostly
        // write to different pages of memory.
        let share = parts.len().div_ceil(4 * threads).max(1);
        let mut shares: Vec<Vec<P>> = Vec::new();
        for (k, part) in parts.into_iter().enumerate() {
            if k % share == 0 {
                shares.push(Vec::with_capacity(share));
            }
            if let Some(last) = shares.last_mut() {
                last.push(part);
            }
        }
        parallel::each_with(shares, &solver, |own, share| {
            for part in share {
                // A solver that was interrupted is not used again. The other threads stop, too.
                if stop.load(Ordering::Relaxed) || interruptible(Watch::Flag(stop.clone()), || work(own, part)).is_err() {
                    break;
                }
            }
        });
        stop.load(Ordering::Relaxed)
    })
}
