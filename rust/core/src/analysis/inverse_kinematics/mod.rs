//! Inverse kinematics of positions: damped Newton steps within the joint limits, with an active set of limits (`sugihara2011solvability`,
//! `nakamura1986inverse`, `siciliano1991priority`).
//!
//! A step is `q <- clip(q + s dq)`, where `s <= 1` limits the motion of every joint. There are two kinds of steps. A damped step is a
//! least-squares step for all tasks together. A prioritised step solves `J_i dq = e_i` in order of priority, by a method of `priority`. The
//! default method bounds the steps at singularities.
//!
//! The search starts with damped steps. If they do not reach all of several tasks, prioritised steps follow. If the option `method` or `eps`
//! is set, all steps are prioritised. If no start reaches all tasks, the best positions move to the nearest ones: see `nearest`.
//!
//! A joint at a limit is held if the step would cross the limit. Its column of the Jacobian becomes zero, and the step is computed again.
//! While errors are large, motions in the null space of the tasks move joints towards the middle of their range. After a start without
//! success, the search continues from pseudo-random starts. Several solutions of one target come from more starts.
//!
//! `damped` has the damped steps, `newton` the prioritised steps, `nearest` the steps to the smallest error, and `batch` the search for many
//! targets.

mod active_limits;
mod attempt;
mod batch;
mod damped;
mod nearest;
mod newton;
mod options;

pub use batch::{IkBatch, IkRows, inverse_kinematics_batch};
pub use options::IkOptions;

use crate::arm::Arm;
use crate::error::{Error, Result, finite};
use crate::kinematics::TaskFunction;
use crate::status::Status;
use attempt::{StartResult, better};
use nearest::{Nearest, Targets};
use newton::NewtonSearch;

/// The result of a search.
///
/// ```
/// # use armlet_core::{arm::Arm, kinematics::TaskFunction, status::Status};
/// use armlet_core::analysis::inverse_kinematics::{IkOptions, inverse_kinematics};
/// # let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
///
/// // The target is at 1.2 m, and the arm is 0.9 m long. The nearest point is that of the stretched arm, at a distance of 0.3 m.
/// let goal = (TaskFunction::frame(&arm, "link2", "xy")?, vec![1.2, 0.0]);
/// let solution = inverse_kinematics(&arm, &[goal], &[0.1, 0.2], &IkOptions::default())?;
/// assert_eq!((solution.status, solution.reached), (Status::Infeasible, vec![false]));
/// assert!((solution.errors[0] - 0.3).abs() < 1e-12 && solution.q.iter().all(|q| q.abs() < 1e-8));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct IkSolution {
    /// Joint positions, `(n,)`, rad or m.
    pub q: Vec<f64>,
    /// Errors of all tasks at `q`, one after another, `(sum rows,)`, m or rad.
    pub errors: Vec<f64>,
    /// Whether each task is reached, `(tasks,)`.
    pub reached: Vec<bool>,
    /// Number of steps from all starts together.
    pub iterations: usize,
    /// Number of random starts.
    pub restarts: usize,
    /// `Success`: every task is reached. `Degraded`: the first task is reached, but not all. `Infeasible`: the first task is not reached,
    /// and its squared error has a local minimum at `q`. `MaxSteps`: the first task is not reached, and the error still decreased at the
    /// last step. `Diverged`: the numbers overflow.
    pub status: Status,
}

/// Solutions whose joints differ by no more than this, rad or m, count as equal.
const SAME: f64 = 1e-3;

/// A task with its constant target. The target is empty for a task without one.
pub type Goal = (TaskFunction, Vec<f64>);

/// Search for joint positions that reach the tasks `goals`, the highest priority first, from `q0`, `(n,)`, rad or m.
///
/// An unreachable target is not an error: see [`IkSolution::status`]. Errors: `Input` for an invalid option, start or
/// target, `WrongShape` for a wrong length.
///
/// ```
/// use armlet_core::analysis::inverse_kinematics::{IkOptions, inverse_kinematics};
/// use armlet_core::arm::Arm;
/// use armlet_core::kinematics::TaskFunction;
/// use armlet_core::status::Status;
///
/// let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
/// let goal = (TaskFunction::frame(&arm, "link2", "xy")?, vec![0.6, 0.3]);
/// let solution = inverse_kinematics(&arm, &[goal], &[0.1, 0.2], &IkOptions::default())?;
/// assert_eq!(solution.status, Status::Success);
/// let (a, b) = (solution.q[0], solution.q[0] + solution.q[1]);
/// assert!((0.5 * a.cos() + 0.4 * b.cos() - 0.6).abs() < 1e-8 && (0.5 * a.sin() + 0.4 * b.sin() - 0.3).abs() < 1e-8);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub fn inverse_kinematics(arm: &Arm, goals: &[Goal], q0: &[f64], search: &IkOptions) -> Result<IkSolution> {
    let (functions, targets): (Vec<TaskFunction>, Vec<&[f64]>) =
        goals.iter().map(|(function, target)| (function.clone(), target.as_slice())).unzip();
    let n = arm.n();
    if q0.len() != n {
        return Err(Error::wrong_shape("q0", &[n], &[q0.len()]));
    }
    finite("q0", q0)?;
    search.check()?;
    functions.iter().zip(&targets).try_for_each(|(function, target)| function.require_target(target))?;
    let mut solver = IkSolver::new(arm, &functions, search)?;
    match solver.solve(&targets, q0, 1) {
        Ok(()) => Ok(solver.solution(0)),
        // The search overflows if a target is extremely far away. As in a batch, the status is then `Diverged`.
        Err(Error::Solve { .. }) => Ok(IkSolution {
            q: vec![f64::NAN; n],
            errors: vec![f64::NAN; functions.iter().map(TaskFunction::rows).sum()],
            reached: vec![false; functions.len()],
            iterations: 0,
            restarts: 0,
            status: Status::Diverged,
        }),
        Err(error) => Err(error),
    }
}

/// The search for one target after another, with its buffers.
#[derive(Clone)]
struct IkSolver {
    newton: NewtonSearch,
    nearest: Nearest,
    search: IkOptions,
    start: Vec<f64>,
    /// The best results of the last target, the best result first.
    found: Vec<StartResult>,
    iterations: usize,
    restarts: usize,
}

impl IkSolver {
    fn new(arm: &Arm, functions: &[TaskFunction], search: &IkOptions) -> Result<Self> {
        let newton = NewtonSearch::new(arm, functions, search)?;
        let nearest = Nearest::new(arm, functions, search.tolerance, search.step_max, search.max_iterations);
        Ok(IkSolver { newton, nearest, search: search.clone(), start: vec![0.0; arm.n()], found: Vec::new(), iterations: 0, restarts: 0 })
    }

    /// Search from `q0`, `(n,)`, then from random starts, until `solutions` different postures reach every task or the
    /// restarts are used up.
    fn solve(&mut self, targets: &[&[f64]], q0: &[f64], solutions: usize) -> Result<()> {
        for (desired, target) in self.newton.desired.iter_mut().zip(targets) {
            desired[..target.len()].copy_from_slice(target);
        }
        let mut random = self.search.seed;
        (self.iterations, self.restarts) = (0, 0);
        self.found.clear();
        self.start.copy_from_slice(q0);
        loop {
            self.newton.descend(&self.start, &mut self.iterations)?;
            self.rank(q0, solutions);
            let done = self.found.len() >= solutions && self.found.iter().all(StartResult::reached);
            if done || self.restarts == self.search.restarts {
                break;
            }
            self.restarts += 1;
            self.newton.random_start(q0, &mut random, &mut self.start);
        }
        for mut one in std::mem::take(&mut self.found) {
            if !one.reached() {
                let targets = Targets::new(&self.newton.desired, &self.newton.bounds, &one);
                self.nearest.improve(targets, &mut one, &mut self.iterations)?;
            }
            self.newton.found = one;
            self.rank(q0, solutions);
        }
        Ok(())
    }

    /// Insert the result of the last start into the sorted results. The order is by the error of the first task with different errors.
    /// Results that reach every task are ordered by their distance from `q0`, and with equal distances by their start. Among equal postures
    /// only the better one is kept.
    fn rank(&mut self, q0: &[f64], most: usize) {
        let IkSolver { newton, found, .. } = self;
        let new = &newton.found;
        if let Some(same) = found.iter().position(|old| newton.apart(&old.q, &new.q) <= SAME) {
            if !better(&new.misses, &found[same].misses) {
                return;
            }
            found.remove(same);
        }
        let before = |old: &StartResult| match (old.misses == new.misses, new.reached()) {
            (false, _) => better(&old.misses, &new.misses),
            (true, true) => distance(&old.q, q0) <= distance(&new.q, q0),
            (true, false) => true,
        };
        let place = found.iter().position(|old| !before(old)).unwrap_or(found.len());
        if place < most {
            found.truncate(most - 1);
            found.insert(place, new.clone());
        }
    }

    /// Solution `i` of the last target.
    fn solution(&mut self, i: usize) -> IkSolution {
        let StartResult { q, misses, .. } = &self.found[i];
        let errors = self.newton.errors(q).to_vec();
        let reached = misses.iter().map(|miss| *miss == 0.0).collect();
        let (iterations, restarts, status) = (self.iterations, self.restarts, self.found[i].status());
        IkSolution { q: q.clone(), errors, reached, iterations, restarts, status }
    }
}

impl StartResult {
    fn status(&self) -> Status {
        match (self.reached(), self.misses[0] == 0.0, self.resting) {
            (true, ..) => Status::Success,
            (_, true, _) => Status::Degraded,
            (_, _, true) => Status::Infeasible,
            _ => Status::MaxSteps,
        }
    }
}

/// The squared distance of two joint positions.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}
