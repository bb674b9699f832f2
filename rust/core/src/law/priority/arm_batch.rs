//! Joint velocities for tasks in order of priority, for many rows of joint positions. One program (a recorded and compiled computation)
//! contains the kinematics and the solution, and computes one row per SIMD lane. Few rows are solved without a program.

use super::ArmSolver;
use crate::interrupt;
use crate::priority::FEWEST_ROWS;
use crate::status::Status;
use crate::trace::rows::Rows;
use crate::trace::{Evaluation, Sym};

/// A solver for many rows on the calling thread. Its buffers are kept between calls. Every row has the bits and the status of
/// [`ArmSolver::solve`] on the same instruction set.
///
/// ```
/// # use armlet_core::{arm::Arm, error::Result, kinematics::TaskFunction, priority::PriorityOptions, status::Status};
/// use armlet_core::law::{ArmBatch, ArmSolver};
/// # let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
///
/// let tip = TaskFunction::frame(&arm, "link2", "xy")?;
/// let mut solver = ArmSolver::new(&arm, vec![tip], &PriorityOptions::default())?;
/// let mut batch = ArmBatch::new(&solver, 2);
/// let (mut v, mut status) = ([0.0; 4], [Status::Diverged; 2]);
/// // Two rows of joint angles, and one velocity of the tip for both.
/// batch.solve(&[0.3, 0.4, 0.5, 0.6], &[0.1, 0.0], &mut v, &mut status);
/// assert_eq!(status, [Status::Success; 2]);
/// let solution = solver.solve(&[0.5, 0.6], &[0.1, 0.0])?;
/// assert!(v[2..].iter().zip(&solution.v).all(|(row, single)| (row - single).abs() < 1e-12));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone)]
pub struct ArmBatch {
    program: Option<Evaluation>,
    single: ArmSolver,
    declined: Vec<usize>,
}

/// Return the program that the solver has already made, or make a new one. This function never waits for the lock. If the process is forked
/// while another thread holds the lock, a waiting call in the forked process would never end.
fn program(solver: &ArmSolver) -> Option<Evaluation> {
    let (eps, bounds) = (solver.solver().eps(), solver.solver().bounds());
    let mut shared = solver.shared_program().try_lock().ok();
    if let Some(Some((settings, program))) = shared.as_deref()
        && (settings.0.as_deref(), settings.1.as_ref()) == (eps, bounds)
    {
        return program.clone();
    }
    let program = recorded(solver);
    if let Some(shared) = &mut shared {
        **shared = Some(((eps.map(<[f64]>::to_vec), bounds.cloned()), program.clone()));
    }
    program
}

/// Record the program that computes joint velocities from joint positions and task velocities.
fn recorded(solver: &ArmSolver) -> Option<Evaluation> {
    let (n, total) = (solver.n(), solver.rows().iter().sum::<usize>());
    solver.solver().recorded(
        n + total,
        || solver.stack().lift::<Sym>(),
        |mut tasks, inputs| {
            let (q, command) = inputs.split_at(n);
            let mut jacobian = vec![Sym::default(); total * n];
            tasks.place(q);
            tasks.jacobians(&mut jacobian);
            (tasks.rounding(), jacobian, command.to_vec())
        },
    )
}

impl ArmBatch {
    /// Create a batch for the tasks and options of `solver`, and for `rows` rows.
    pub fn new(solver: &ArmSolver, rows: usize) -> Self {
        let program = if rows < FEWEST_ROWS { None } else { program(solver) };
        ArmBatch { program, single: solver.clone(), declined: Vec::new() }
    }

    /// Solve for `q`, `(rows, n)`, and `velocities`, `(rows, m)`, or `(m,)` for all rows. `m` is the sum of the rows of all tasks.
    ///
    /// The results are written to `v`, `(rows, n)`, and `status`, `(rows,)`. A row that fails is NaN with `Status::Diverged`.
    pub fn solve(&mut self, q: &[f64], velocities: &[f64], v: &mut [f64], status: &mut [Status]) {
        let ArmBatch { program, single, declined } = self;
        let (n, m) = (single.n(), single.rows().iter().sum::<usize>());
        declined.clear();
        if let Some(program) = program {
            status.fill(Status::Success);
            let lanes = program.lanes();
            let inputs = [Rows { numbers: q, width: n }, Rows { numbers: velocities, width: m }];
            for at in (0..status.len()).step_by(lanes) {
                program.read(&inputs, at);
                program.run();
                let end = (at + lanes).min(status.len());
                program.write(1, n, &mut v[at * n..end * n]);
                let valid = program.output(0);
                declined.extend((at..end).filter(|row| !(valid[row - at] == 1.0 && program.is_near(row - at))));
            }
        } else {
            declined.extend(0..status.len());
        }
        for &row in declined.iter() {
            interrupt::check();
            single.solver_mut().clear_active_set();
            let command = if velocities.len() == m { velocities } else { &velocities[row * m..(row + 1) * m] };
            let v = &mut v[row * n..(row + 1) * n];
            match single.solve(&q[row * n..(row + 1) * n], command) {
                Ok(solution) => {
                    status[row] = solution.status;
                    v.copy_from_slice(&solution.v);
                }
                Err(_) => {
                    status[row] = Status::Diverged;
                    v.fill(f64::NAN);
                }
            }
        }
    }
}
