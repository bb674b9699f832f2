//! Inverse kinematics of many targets, in threads. Each row is one search, from one start to one target.
//!
//! The result of a row equals the result of a single call. It does not depend on the other rows or on the number of threads.

use super::{IkOptions, IkSolver};
use crate::arm::Arm;
use crate::error::{Error, Result};
use crate::interrupt::{self, interrupt};
use crate::kinematics::TaskFunction;
use crate::memory;
use crate::parallel;
use crate::status::Status;

/// Number of targets that a thread processes in one piece of work.
const CHUNK: usize = 32;

/// The results for `count` targets, with `k` solutions each.
///
/// ```
/// # use armlet_core::{arm::Arm, kinematics::TaskFunction, status::Status};
/// use armlet_core::analysis::inverse_kinematics::{IkBatch, IkOptions, IkRows, inverse_kinematics_batch};
/// # let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
///
/// let tip = [TaskFunction::frame(&arm, "link2", "xy")?];
/// // The second point is out of reach.
/// let batch = IkBatch { functions: &tip, targets: &[vec![0.6, 0.3, 2.0, 0.0]], q0: &[0.1, 0.2], count: 2 };
/// let IkRows { q, reached, status, .. } = inverse_kinematics_batch(&arm, &batch, 1, &IkOptions::default(), 1, &mut || false)?;
/// assert_eq!((q.len(), reached), (4, vec![true, false]));
/// assert_eq!(status, [Status::Success.code(), Status::Infeasible.code()]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct IkRows {
    /// Joint positions, `(count, k, n)`, the best first; NaN for missing solutions and for rows with the status `Diverged`.
    pub q: Vec<f64>,
    /// Errors of each task, `(count, k, rows)` each, m or rad.
    pub errors: Vec<Vec<f64>>,
    /// Whether each task is reached, `(count, k, tasks)`.
    pub reached: Vec<bool>,
    /// Number of steps from all starts together, `(count,)`.
    pub iterations: Vec<i64>,
    /// Number of random starts, `(count,)`.
    pub restarts: Vec<i64>,
    /// Codes of the status in [`super::IkSolution`], `(count, k)`. `Diverged` if a target or start is not finite, if a target is invalid,
    /// or if the search overflows. `Infeasible` for missing solutions.
    pub status: Vec<i32>,
}

/// The rows of one piece of work.
struct ThreadRows<'a> {
    first: usize,
    q: &'a mut [f64],
    errors: &'a mut [f64],
    reached: &'a mut [bool],
    iterations: &'a mut [i64],
    restarts: &'a mut [i64],
    status: &'a mut [i32],
}

/// The tasks of a batch, with `count` targets and starts.
///
/// ```
/// # use armlet_core::{arm::Arm, kinematics::TaskFunction, status::Status};
/// use armlet_core::analysis::inverse_kinematics::{IkBatch, IkOptions, inverse_kinematics_batch};
/// # let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
///
/// // One target for three starts.
/// let tip = [TaskFunction::frame(&arm, "link2", "xy")?];
/// let starts = [0.1, 0.2, 0.5, -0.4, -0.3, 1.0];
/// let batch = IkBatch { functions: &tip, targets: &[vec![0.6, 0.3]], q0: &starts, count: 3 };
/// let found = inverse_kinematics_batch(&arm, &batch, 1, &IkOptions::default(), 1, &mut || false)?;
/// assert_eq!(found.status, [Status::Success.code(); 3]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct IkBatch<'a> {
    /// The tasks.
    pub functions: &'a [TaskFunction],
    /// One array of targets per task, `(count, size)`, or `(size,)` for all rows.
    pub targets: &'a [Vec<f64>],
    /// The starts, `(count, n)` or `(n,)`, rad or m.
    pub q0: &'a [f64],
    /// Number of rows.
    pub count: usize,
}

/// Run [`super::inverse_kinematics`] for each row of `batch`.
///
/// `solutions` is the number of different postures per target, the best first. `poll` is called every 20 ms. If it returns true, the call
/// unwinds to the enclosing `interruptible`. Errors: `Input` for an invalid option or wrong sizes, `Memory` if the memory does not suffice.
///
/// A row whose target or start is invalid ends as `Diverged`, and does not change any other row.
///
/// ```
/// use armlet_core::analysis::inverse_kinematics::{IkBatch, IkOptions, inverse_kinematics_batch};
/// use armlet_core::{arm::Arm, kinematics::TaskFunction};
///
/// let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
/// let tip = [TaskFunction::frame(&arm, "link2", "xy")?];
/// let points = vec![0.6, 0.3, 0.2, 0.7];
/// let batch = IkBatch { functions: &tip, targets: &[points], q0: &[0.1, 0.2], count: 2 };
/// let found = inverse_kinematics_batch(&arm, &batch, 2, &IkOptions::default(), 1, &mut || false)?;
/// assert_eq!((found.q.len(), found.reached.as_slice()), (8, &[true; 4][..]));
/// // The two solutions have the elbow on different sides.
/// assert!(found.q[1] * found.q[3] < 0.0);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub fn inverse_kinematics_batch(
    arm: &Arm,
    batch: &IkBatch<'_>,
    solutions: usize,
    search: &IkOptions,
    threads: usize,
    poll: &mut dyn FnMut() -> bool,
) -> Result<IkRows> {
    let IkBatch { functions, targets, q0, count } = *batch;
    let n = arm.n();
    search.check()?;
    if solutions == 0 {
        return Err(Error::input("solutions", "is not positive: expected at least 1, got 0"));
    }
    let widths: Vec<usize> = functions.iter().map(TaskFunction::target_size).collect();
    let sized = |len: usize, width: usize| len == width || count.checked_mul(width) == Some(len);
    if !sized(q0.len(), n) || targets.len() != widths.len() || !targets.iter().zip(&widths).all(|(t, &w)| sized(t.len(), w)) {
        return Err(Error::input("targets", format!("have the wrong shape: expected one row or {count} of each task and of q0")));
    }
    let solver = IkSolver::new(arm, functions, search)?;
    let total: usize = functions.iter().map(TaskFunction::rows).sum();
    let levels = functions.len();
    let slots = count.saturating_mul(solutions);
    memory::require(slots.saturating_mul(8 * (n + 2 * total + 1)).saturating_add(count.saturating_mul(16)))?;
    let mut rows = IkRows {
        q: memory::filled(slots * n, f64::NAN)?,
        errors: Vec::new(),
        reached: memory::filled(slots * levels, false)?,
        iterations: memory::filled(count, 0)?,
        restarts: memory::filled(count, 0)?,
        status: memory::filled(slots, Status::Infeasible.code())?,
    };
    let mut stacked = memory::filled(slots * total, f64::NAN)?;
    let mut parts = Vec::with_capacity(count.div_ceil(CHUNK));
    let (mut q, mut errors, mut reached) = (&mut rows.q[..], &mut stacked[..], &mut rows.reached[..]);
    let (mut iterations, mut restarts, mut status) = (&mut rows.iterations[..], &mut rows.restarts[..], &mut rows.status[..]);
    for first in (0..count).step_by(CHUNK) {
        let (size, slots) = (CHUNK.min(count - first), CHUNK.min(count - first) * solutions);
        parts.push(ThreadRows {
            first,
            q: cut(&mut q, slots * n),
            errors: cut(&mut errors, slots * total),
            reached: cut(&mut reached, slots * levels),
            iterations: cut(&mut iterations, size),
            restarts: cut(&mut restarts, size),
            status: cut(&mut status, slots),
        });
    }
    let ended = parallel::pieces(threads, poll, parts, |part| solve_part(&mut solver.clone(), batch, &widths, part, solutions));
    if ended.is_err() {
        interrupt();
    }
    rows.errors = by_task(&stacked, functions, slots, total)?;
    Ok(rows)
}

/// Solve the rows of one piece of work. `widths` has the size of each task's target.
fn solve_part(solver: &mut IkSolver, batch: &IkBatch, widths: &[usize], part: ThreadRows, solutions: usize) {
    let slots = part.status.len();
    let (n, levels, total) = (part.q.len() / slots, widths.len(), part.errors.len() / slots);
    let mut targets: Vec<&[f64]> = Vec::with_capacity(levels);
    for i in 0..part.iterations.len() {
        let q0 = row(batch.q0, n, part.first + i);
        targets.clear();
        targets.extend(batch.targets.iter().zip(widths).map(|(values, &width)| row(values, width, part.first + i)));
        let fit = batch.functions.iter().zip(&targets).all(|(function, target)| function.require_target(target).is_ok());
        if !fit || q0.iter().any(|q| !q.is_finite()) || solver.solve(&targets, q0, solutions).is_err() {
            part.status[i * solutions..(i + 1) * solutions].fill(Status::Diverged.code());
            continue;
        }
        (part.iterations[i], part.restarts[i]) = (solver.iterations as i64, solver.restarts as i64);
        for k in 0..solver.found.len() {
            let at = i * solutions + k;
            let IkSolver { newton, found, .. } = &mut *solver;
            part.q[at * n..(at + 1) * n].copy_from_slice(&found[k].q);
            part.errors[at * total..(at + 1) * total].copy_from_slice(newton.errors(&found[k].q));
            part.status[at] = found[k].status().code();
            let reached = &mut part.reached[at * levels..(at + 1) * levels];
            reached.iter_mut().zip(&found[k].misses).for_each(|(to, miss)| *to = *miss == 0.0);
        }
    }
}

/// Row `i` of `values` with `width` numbers per row, or the only row of `values`.
fn row(values: &[f64], width: usize, i: usize) -> &[f64] {
    let i = if values.len() == width { 0 } else { i };
    &values[i * width..(i + 1) * width]
}

/// Split off the first `size` entries, and return them.
fn cut<'a, T>(all: &mut &'a mut [T], size: usize) -> &'a mut [T] {
    let (head, tail) = std::mem::take(all).split_at_mut(size);
    *all = tail;
    head
}

/// Divide the stacked errors, `(slots, total)`, into one array per task.
fn by_task(stacked: &[f64], functions: &[TaskFunction], slots: usize, total: usize) -> Result<Vec<Vec<f64>>> {
    let (mut at, mut errors) = (0, Vec::with_capacity(functions.len()));
    for function in functions {
        let m = function.rows();
        let mut own = memory::reserved(slots * m)?;
        for (i, row) in stacked.chunks_exact(total.max(1)).enumerate() {
            if i % (1 << 12) == 0 {
                interrupt::check();
            }
            own.extend_from_slice(&row[at..at + m]);
        }
        errors.push(own);
        at += m;
    }
    Ok(errors)
}
