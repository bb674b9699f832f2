//! Prioritised velocities of an arm for many rows of joint angles, in threads: every row is solved by itself, so that its bits
//! depend on nothing but its own inputs.

use crate::law::ArmSolver;
use crate::parallel;
use crate::status::Status;
use rayon::prelude::*;
use std::sync::atomic::Ordering;

/// Rows solved between two looks at whether to stop.
const CHUNK: usize = 256;

/// Rows of fewer than this many are not worth a thread.
const FEW: usize = 512;

/// Solve row by row: `q` `(rows, n)`, `velocities` `(rows, m)` or one `(m,)` for all, answers into `v` `(rows, n)` and `status`
/// `(rows,)`. A row that fails is NaN with `Status::Diverged`. Whether it was interrupted.
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
    let shared = velocities.len() == m && status.len() != 1;
    let chunk = |solver: &mut ArmSolver, first: usize, v: &mut [f64], status: &mut [Status]| {
        for (i, (v, status)) in v.chunks_exact_mut(n).zip(status).enumerate() {
            let row = first + i;
            let command = if shared { velocities } else { &velocities[row * m..(row + 1) * m] };
            match solver.solve(&q[row * n..(row + 1) * n], command) {
                Ok(ended) => {
                    *status = ended;
                    v.copy_from_slice(solver.solver().v());
                }
                Err(_) => {
                    *status = Status::Diverged;
                    v.fill(f64::NAN);
                }
            }
        }
    };
    if status.len() < FEW || threads < 2 {
        let mut own = solver.clone();
        for (k, (v, status)) in v.chunks_mut(CHUNK * n).zip(status.chunks_mut(CHUNK)).enumerate() {
            // A chunk is a few microseconds: the clock is not asked after each.
            if k % 64 == 63 && poll() {
                return true;
            }
            chunk(&mut own, k * CHUNK, v, status);
        }
        return false;
    }
    parallel::run(threads, poll, |stop| {
        v.par_chunks_mut(CHUNK * n).zip(status.par_chunks_mut(CHUNK)).enumerate().for_each_init(
            || solver.clone(),
            |own, (k, (v, status))| {
                if !stop.load(Ordering::Relaxed) {
                    chunk(own, k * CHUNK, v, status);
                }
            },
        );
        stop.load(Ordering::Relaxed)
    })
}
