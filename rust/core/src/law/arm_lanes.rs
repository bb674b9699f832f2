//! The maps of `priority` on an arm for many rows of joint angles: kinematics and solution one row per lane.

use super::ArmSolver;
use crate::interrupt::look;
use crate::kinematics::TaskStack;
use crate::priority::{Group, Stacks};
use crate::scalar::rows::{read_rows, write_rows};
use crate::scalar::{Real, Task, run_lanes};
use crate::status::Status;

/// Solves many rows on the calling thread; its buffers last. Every row has the bits and the status of [`ArmSolver::solve`] of the same
/// instruction set.
pub struct ArmLanes {
    engine: Option<Box<dyn Engine>>,
    single: ArmSolver,
    declined: Vec<usize>,
}

impl ArmLanes {
    /// Of the tasks and with the options of `solver`.
    pub fn new(solver: &ArmSolver) -> Self {
        ArmLanes { engine: run_lanes(MakeLanes(solver)), single: solver.clone(), declined: Vec::new() }
    }

    /// `q` `(rows, n)`, `velocities` `(rows, m)` or one `(m,)` for all; answers into `v` `(rows, n)` and `status` `(rows,)`. A row that
    /// fails is NaN with `Status::Diverged`.
    pub fn solve(&mut self, q: &[f64], velocities: &[f64], v: &mut [f64], status: &mut [Status]) {
        let ArmLanes { engine, single, declined } = self;
        let (n, m) = (single.n(), single.rows().iter().sum::<usize>());
        declined.clear();
        match engine {
            Some(engine) => {
                status.fill(Status::Success);
                engine.solve(q, velocities, v, status.len(), declined);
            }
            None => declined.extend(0..status.len()),
        }
        for &row in declined.iter() {
            look();
            let command = if velocities.len() == m { velocities } else { &velocities[row * m..(row + 1) * m] };
            let v = &mut v[row * n..(row + 1) * n];
            match single.solve(&q[row * n..(row + 1) * n], command) {
                Ok(ended) => {
                    status[row] = ended;
                    v.copy_from_slice(single.solver().v());
                }
                Err(_) => {
                    status[row] = Status::Diverged;
                    v.fill(f64::NAN);
                }
            }
        }
    }
}

/// Lanes whose number is known at run time only.
trait Engine: Send {
    fn solve(&mut self, q: &[f64], velocities: &[f64], v: &mut [f64], count: usize, declined: &mut Vec<usize>);
}

struct MakeLanes<'a>(&'a ArmSolver);

impl Task for MakeLanes<'_> {
    type Output = Option<Box<dyn Engine>>;
    fn run<S: Real>(self) -> Option<Box<dyn Engine>> {
        let (tasks, solver) = (self.0.stack().lift::<S>(), self.0.solver());
        let q = vec![S::zero(); tasks.n()];
        Group::<S>::new(solver).map(|group| Box::new(Lanes { group, tasks, q }) as Box<dyn Engine>)
    }
}

struct Lanes<S> {
    group: Group<S>,
    tasks: TaskStack<S>,
    q: Vec<S>,
}

impl<S: Real> Engine for Lanes<S> {
    fn solve(&mut self, q: &[f64], velocities: &[f64], v: &mut [f64], count: usize, declined: &mut Vec<usize>) {
        let Lanes { group, tasks, q: angles } = self;
        group.run(&mut Rows { q, velocities, v, count, tasks, angles }, count, declined);
    }
}

/// Rows on their way through the lanes.
struct Rows<'a, S> {
    q: &'a [f64],
    velocities: &'a [f64],
    v: &'a mut [f64],
    count: usize,
    tasks: &'a mut TaskStack<S>,
    angles: &'a mut [S],
}

impl<S: Real> Stacks<S> for Rows<'_, S> {
    #[inline(always)]
    fn read(&mut self, at: usize, jacobian: &mut [S], command: &mut [S]) -> S {
        read_rows(self.q, at, self.count, self.angles.len(), self.angles);
        self.tasks.place(self.angles);
        self.tasks.jacobians(jacobian);
        if self.velocities.len() == command.len() {
            command.iter_mut().zip(self.velocities).for_each(|(to, &x)| *to = S::splat(x));
        } else {
            read_rows(self.velocities, at, self.count, command.len(), command);
        }
        self.tasks.rounding()
    }

    #[inline(always)]
    fn write(&mut self, at: usize, v: &[S], _: &[S]) {
        write_rows(v, &mut self.v[at * v.len()..]);
    }
}
