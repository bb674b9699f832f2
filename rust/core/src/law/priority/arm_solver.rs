//! Joint velocities `v` for the tasks of an arm in order of priority, by a method of [`crate::priority`]. Task `i` requires
//! `J_i(q) v = v_i`, where `v_i` is its commanded velocity. The Jacobians `J_i` are computed from the joint positions `q`.

use crate::arm::Arm;
use crate::error::{Error, Result, finite};
use crate::kinematics::{TaskFunction, TaskStack};
use crate::priority::{Diagnosis, PriorityOptions, PrioritySolver, Solution, diagnose};
use crate::trace::Evaluation;
use std::sync::{Arc, Mutex};

/// The settings of a program, which is a recorded and compiled computation: thresholds `eps`, and bounds.
type ProgramSettings = (Option<Vec<f64>>, Option<(Vec<f64>, Vec<f64>)>);

/// The program of a solver with its settings, shared by copies of the solver. The outer `None` means that it was not made yet, the inner
/// `None` that it cannot be made.
type SharedProgram = Arc<Mutex<Option<(ProgramSettings, Option<Evaluation>)>>>;

/// A solver for tasks of one arm. `solve` does not allocate.
///
/// ```
/// # use armlet_core::{arm::Arm, kinematics::TaskFunction, priority::PriorityOptions};
/// use armlet_core::law::ArmSolver;
/// # let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
///
/// let tip = TaskFunction::frame(&arm, "link2", "xy")?;
/// let mut solver = ArmSolver::new(&arm, vec![tip], &PriorityOptions::default())?;
/// let q = [0.3, 0.4];
/// let v = solver.solve(&q, &[0.1, 0.0])?.v.clone();
/// let mut j = [0.0; 4];
/// solver.jacobians(&q, &mut j);
/// // J v is the commanded velocity of the tip, m/s.
/// assert!((j[0] * v[0] + j[1] * v[1] - 0.1).abs() < 1e-12 && (j[2] * v[0] + j[3] * v[1]).abs() < 1e-12);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct ArmSolver {
    stack: TaskStack,
    solver: PrioritySolver,
    /// The program for many rows of joint positions, if it was made.
    program: SharedProgram,
}

impl ArmSolver {
    /// Create a solver for the tasks `functions` of an arm, the highest priority first. Errors: `Input` without a task; also as for
    /// [`PrioritySolver::new`].
    pub fn new(arm: &Arm, functions: Vec<TaskFunction>, options: &PriorityOptions) -> Result<Self> {
        if functions.is_empty() {
            return Err(Error::input("tasks", "is empty: expected at least one task, got 0"));
        }
        let stack = TaskStack::new(arm, functions);
        let solver = PrioritySolver::new(arm.n(), stack.rows(), options)?;
        Ok(ArmSolver { stack, solver, program: SharedProgram::default() })
    }

    /// Number of joints.
    pub fn n(&self) -> usize {
        self.stack.n()
    }

    /// Number of rows of each task.
    pub fn rows(&self) -> &[usize] {
        self.stack.rows()
    }

    /// The tasks of the solver. [`ArmSolver::solve`] evaluates a copy of them.
    pub fn tasks(&mut self) -> &mut TaskStack {
        &mut self.stack
    }

    pub(super) fn stack(&self) -> &TaskStack {
        &self.stack
    }

    pub(super) fn shared_program(&self) -> &SharedProgram {
        &self.program
    }

    /// The solver of the task priorities.
    pub fn solver(&self) -> &PrioritySolver {
        &self.solver
    }

    /// The solver of the task priorities, mutable.
    pub fn solver_mut(&mut self) -> &mut PrioritySolver {
        &mut self.solver
    }

    /// Place the arm at `q`, `(n,)`, and compute the Jacobians. The caller writes the task velocities to the returned slice, `(sum rows,)`.
    #[inline]
    pub fn prepare(&mut self, q: &[f64]) -> &mut [f64] {
        let rounding = jacobians(&mut self.stack, q, self.solver.inputs().0);
        let solver = &mut self.solver;
        solver.set_arm_rounding(rounding);
        solver.inputs().1
    }

    /// Write the Jacobians at `q`, `(n,)`, to `out`, `(sum rows, n)`, with the same bits as in [`ArmSolver::solve`]. Return the relative
    /// error that the solver assumes in their entries.
    pub fn jacobians(&mut self, q: &[f64], out: &mut [f64]) -> f64 {
        jacobians(&mut self.stack, q, out)
    }

    /// Solve at `q`, `(n,)`, for the stacked task velocities, `(sum rows,)`.
    ///
    /// Errors: `Input` for numbers that are not finite, `Solve` if the result overflows.
    pub fn solve(&mut self, q: &[f64], velocities: &[f64]) -> Result<&Solution> {
        self.prepare(q).copy_from_slice(velocities);
        self.solver.run().or_else(|error| {
            // If a Jacobian is not finite because `q` is not finite, the error names `q`.
            finite("q", q)?;
            Err(error)
        })
    }

    /// Diagnose singularities of the tasks at `q`, `(n,)`. If `velocities`, `(sum rows,)`, is `Some`, also report which part of these
    /// commands is lost. Errors: `Input` for numbers that are not finite.
    pub fn diagnose(&mut self, q: &[f64], velocities: Option<&[f64]>) -> Result<Diagnosis> {
        finite("q", q)?;
        let (n, rows) = (self.n(), self.rows().to_vec());
        let mut jacobian = vec![0.0; rows.iter().sum::<usize>() * n];
        let rounding = self.jacobians(q, &mut jacobian);
        let mut blocks = Vec::with_capacity(rows.len());
        let mut commands = Vec::with_capacity(rows.len());
        let mut at = 0;
        for m in &rows {
            blocks.push(&jacobian[at * n..(at + m) * n]);
            if let Some(velocities) = velocities {
                commands.push(&velocities[at..at + m]);
            }
            at += m;
        }
        diagnose(n, &rows, &blocks, velocities.map(|_| commands.as_slice()), Some(rounding))
    }
}

/// Write the Jacobians at `q`, `(n,)`, to `out`, `(sum rows, n)`. Return the assumed relative error of their entries.
fn jacobians(stack: &mut TaskStack, q: &[f64], out: &mut [f64]) -> f64 {
    stack.place(q);
    stack.jacobians(out);
    stack.rounding()
}
