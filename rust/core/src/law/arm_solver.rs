//! The maps of `priority` on an arm: `v` solves `J_i(q) v = v_i` for the tasks of an arm, kinematics included.

use super::arm_batch::Kept;
use crate::arm::Arm;
use crate::error::{Error, Result, finite};
use crate::kinematics::{TaskFunction, TaskStack};
use crate::priority::{Diagnosis, Options, PrioritySolver, diagnose};
use crate::scalar::{Fused, FusedLanes, Kernel, Real, fuses};
use crate::status::Status;

/// Tasks of one arm with a solver; `solve` does not allocate.
#[derive(Clone, Debug)]
pub struct ArmSolver {
    stack: TaskStack,
    /// The same tasks on the number that this machine is quicker with.
    fused: Option<Box<FusedTasks>>,
    solver: PrioritySolver,
    /// For many rows, once it is there.
    program: Kept,
}

#[derive(Clone, Debug)]
struct FusedTasks {
    stack: TaskStack<Fused>,
    q: Vec<Fused>,
    trig: Vec<(Fused, Fused)>,
    jacobian: Vec<Fused>,
}

/// Jacobians `(sum rows, n)` at `q`, in the region of their number; the relative error of their entries.
struct Jacobians<'a>(&'a mut FusedTasks, &'a [f64], &'a mut [f64]);

impl Kernel for Jacobians<'_> {
    type Output = f64;
    #[inline(always)]
    fn run(self) -> f64 {
        let Jacobians(FusedTasks { stack, q, trig, jacobian }, angles, out) = self;
        q.iter_mut().zip(angles).for_each(|(q, &angle)| *q = Fused(angle));
        // Sines of several joints at once: the same bits, a quarter of the time.
        for (trig, angles) in trig.chunks_mut(FusedLanes::LANES).zip(angles.chunks(FusedLanes::LANES)) {
            let (sin, cos) = FusedLanes::from_lanes(|i| if i < angles.len() { angles[i] } else { 0.0 }).sin_cos();
            for (i, trig) in trig.iter_mut().enumerate() {
                *trig = (Fused(sin.lane(i)), Fused(cos.lane(i)));
            }
        }
        stack.place_at(q, trig);
        stack.jacobians(jacobian);
        out.iter_mut().zip(jacobian).for_each(|(to, from)| *to = from.0);
        stack.rounding().0
    }
}

impl ArmSolver {
    pub fn new(arm: &Arm, functions: Vec<TaskFunction>, options: &Options) -> Result<Self> {
        if functions.is_empty() {
            return Err(Error::input("tasks", "is empty: expected at least one task, got 0"));
        }
        let stack = TaskStack::new(arm, functions);
        let solver = PrioritySolver::new(arm.n(), stack.rows(), options)?;
        let fused = fuses().then(|| {
            let zeros = |k: usize| vec![Fused(0.0); k];
            let total: usize = stack.rows().iter().sum();
            let (n, none) = (arm.n(), Fused(0.0));
            Box::new(FusedTasks { stack: stack.lift(), q: zeros(n), trig: vec![(none, none); n], jacobian: zeros(total * n) })
        });
        Ok(ArmSolver { stack, fused, solver, program: Kept::default() })
    }

    pub fn n(&self) -> usize {
        self.stack.n()
    }

    /// Rows of each task.
    pub fn rows(&self) -> &[usize] {
        self.stack.rows()
    }

    pub fn tasks(&mut self) -> &mut TaskStack {
        &mut self.stack
    }

    pub(super) fn stack(&self) -> &TaskStack {
        &self.stack
    }

    pub(super) fn kept(&self) -> &Kept {
        &self.program
    }

    pub fn solver(&self) -> &PrioritySolver {
        &self.solver
    }

    pub fn solver_mut(&mut self) -> &mut PrioritySolver {
        &mut self.solver
    }

    /// Place the arm at `q` `(n,)` and fill in the Jacobians; the task velocities go into what is returned, `(sum rows,)`.
    #[inline]
    pub fn prepare(&mut self, q: &[f64]) -> Result<&mut [f64]> {
        let ArmSolver { stack, fused, solver, .. } = self;
        let rounding = jacobians(stack, fused, q, solver.inputs().0);
        solver.set_rounding(rounding)?;
        Ok(solver.inputs().1)
    }

    /// The Jacobians at `q` `(n,)` as the solver sees them, `(sum rows, n)`; the relative error of their entries.
    pub fn jacobians(&mut self, q: &[f64], out: &mut [f64]) -> f64 {
        jacobians(&mut self.stack, &mut self.fused, q, out)
    }

    /// Joint velocities for `q` `(n,)` and the stacked task velocities `(sum rows,)`; the answer is `solver().v()`.
    pub fn solve(&mut self, q: &[f64], velocities: &[f64]) -> Result<Status> {
        self.prepare(q)?.copy_from_slice(velocities);
        self.solver.run().or_else(|error| {
            // What the Jacobians lack is what q lacks.
            finite("q", q)?;
            Err(error)
        })
    }

    /// Which directions of which task can be commanded at `q`, and what is lost of `velocities` where they are given.
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

#[inline]
fn jacobians(stack: &mut TaskStack, fused: &mut Option<Box<FusedTasks>>, q: &[f64], out: &mut [f64]) -> f64 {
    match fused {
        Some(tasks) => Fused::enter(Jacobians(tasks, q, out)),
        None => {
            stack.place(q);
            stack.jacobians(out);
            stack.rounding()
        }
    }
}
