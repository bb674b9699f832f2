//! The search from one start: prioritised damped Newton steps with an active set of joint limits. Buffers are kept between targets,
//! so a search allocates nothing after its construction.

use super::super::uniform::within;
use super::attempt::{CENTRING, StartResult, advance, better, blocked, clip, largest, misses_of};
use super::damped::{Damped, Reach};
use super::options::{IkOptions, limits};
use crate::arm::Arm;
use crate::error::Result;
use crate::interrupt;
use crate::kinematics::TaskFunction;
use crate::kinematics::task::Posture;
use crate::law::ArmSolver;
use crate::linalg::dot;
use crate::priority::{DEFAULT_EPS, PriorityMethod, PriorityOptions};
use std::f64::consts::PI;

/// Number of Newton steps for the highest tasks alone, if lower tasks prevent their convergence.
const LAST_STEPS: usize = 10;
/// If the error of the first unreached task decreases by less than this fraction in `PROGRESS_STEPS` steps, a start ends.
const PROGRESS: f64 = 1e-3;
const PROGRESS_STEPS: usize = 20;

/// The smallest threshold `eps` of singular values. Smaller singular values are rounding errors.
const SMALLEST_EPS: f64 = 1e-9;

/// The steps of one arm and its tasks, for one target after another.
#[derive(Clone)]
pub(super) struct NewtonSearch {
    solver: ArmSolver,
    /// `[x_d, 0, 0]` of each task: its target, with zero rate and acceleration.
    pub desired: Vec<Vec<f64>>,
    /// Lower and upper limit of each joint; infinite where there is no limit.
    pub bounds: Vec<(f64, f64)>,
    /// For each joint: whether it is revolute.
    angles: Vec<bool>,
    /// For each joint: whether a full revolution returns all bodies to their places.
    turns: Vec<bool>,
    search: IkOptions,
    e: Vec<f64>,
    w: Vec<f64>,
    held: Vec<bool>,
    eps: Vec<f64>,
    q: Vec<f64>,
    misses: Vec<f64>,
    mark: Vec<f64>,
    /// Steps for all tasks together, if the options have neither a method nor thresholds.
    damped: Option<Damped>,
    /// The result of the last start.
    pub found: StartResult,
}

impl NewtonSearch {
    pub fn new(arm: &Arm, functions: &[TaskFunction], search: &IkOptions) -> Result<Self> {
        let (n, levels) = (arm.n(), functions.len());
        let bounds = limits(arm, search.limits)?;
        let options = PriorityOptions { eps: search.eps.clone(), ..PriorityOptions::new(search.method.unwrap_or(PriorityMethod::Clamp)) };
        let solver = with_centring(arm, functions, &bounds, options)?;
        let total = functions.iter().map(TaskFunction::rows).sum();
        let angles: Vec<bool> = arm.independent().map(|joint| joint.kind.is_angle()).collect();
        let damped = (search.method.is_none() && search.eps.is_none()).then(|| Damped::new(arm, functions, &bounds, &angles));
        Ok(NewtonSearch {
            desired: functions.iter().map(|function| vec![0.0; 3 * function.target_size()]).collect(),
            bounds,
            angles,
            damped,
            turns: arm.turns(),
            search: search.clone(),
            e: vec![0.0; total],
            w: vec![0.0; total],
            held: vec![false; n],
            eps: vec![DEFAULT_EPS; solver.rows().len()],
            q: vec![0.0; n],
            misses: vec![0.0; levels],
            mark: vec![0.0; levels],
            found: StartResult { q: vec![0.0; n], misses: vec![0.0; levels], resting: false },
            solver,
        })
    }

    pub fn errors(&mut self, q: &[f64]) -> &[f64] {
        self.solver.tasks().place(q);
        let mut at = 0;
        for k in 0..self.desired.len() {
            let m = self.solver.rows()[k];
            self.solver.tasks().error(k, &self.desired[k], &mut self.e[at..at + m], &mut self.w[at..at + m], None);
            at += m;
        }
        &self.e
    }

    /// Write the largest error of each task to `misses`.
    fn look_at(&mut self, q: &[f64]) {
        self.errors(q);
        misses_of(&self.e, self.solver.rows(), self.search.tolerance, &mut self.misses);
    }

    /// Take steps from `start` until all tasks are reached, until progress ends, or up to the largest number of steps. The best result is
    /// written to `found`.
    ///
    /// If the options have neither a method nor thresholds, the steps are for all tasks together. If there are several tasks and these
    /// steps do not reach all of them, prioritised steps follow.
    pub fn descend(&mut self, start: &[f64], iterations: &mut usize) -> Result<()> {
        // `q` is moved out of `self` during the search.
        let mut q = std::mem::take(&mut self.q);
        q.copy_from_slice(start);
        clip(&mut q, &self.bounds);
        self.found.q.copy_from_slice(&q);
        self.found.misses.fill(f64::INFINITY);
        let mut done = Ok(true);
        if let Some(damped) = &mut self.damped {
            let IkOptions { tolerance, step_max, max_iterations, .. } = self.search;
            let reach = Reach { bounds: &self.bounds, tolerance, step_max, max_iterations };
            done = Ok(damped.descend(&mut q, &self.desired, &reach, &mut self.found, iterations));
            q.copy_from_slice(start);
        }
        if self.damped.is_none() || (self.desired.len() > 1 && !self.found.reached()) {
            done = self.in_priority(&mut q, iterations);
        }
        self.q = q;
        self.found.resting = done?;
        Ok(())
    }

    /// Take prioritised steps from `q`. Return whether they reached a goal or ended without progress.
    fn in_priority(&mut self, q: &mut [f64], iterations: &mut usize) -> Result<bool> {
        let resting = self.descend_from(q, iterations)?;
        Ok(self.without_lower_tasks(q, iterations)? || resting)
    }

    /// Take Newton steps from the best result, for the first unreached task and the tasks above it. Lower tasks command no motion.
    ///
    /// Far from their targets, lower tasks move the joints so much that the nonlinearity of a higher task prevents its convergence. Return
    /// whether the first unreached task is then reached.
    fn without_lower_tasks(&mut self, q: &mut [f64], iterations: &mut usize) -> Result<bool> {
        let Some(missed) = self.found.misses.iter().position(|miss| *miss > 0.0).filter(|k| k + 1 < self.desired.len()) else {
            return Ok(false);
        };
        let rows = self.solver.rows()[..=missed].iter().sum();
        q.copy_from_slice(&self.found.q);
        self.look_at(q);
        for _ in 0..LAST_STEPS {
            interrupt::check();
            self.solver.prepare(q);
            self.e[rows..].fill(0.0);
            self.set_thresholds()?;
            self.step(q, 0.0)?;
            *iterations += 1;
            self.look_at(q);
            self.keep_best(q);
            if self.misses[missed] == 0.0 {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Take steps from `q`. Return false after the largest number of steps, otherwise true.
    fn descend_from(&mut self, q: &mut [f64], iterations: &mut usize) -> Result<bool> {
        clip(q, &self.bounds);
        self.mark.fill(f64::INFINITY);
        let mut since = 0;
        for _ in 0..self.search.max_iterations.max(1) {
            interrupt::check();
            self.look_at(q);
            self.keep_best(q);
            if self.misses.iter().all(|miss| *miss == 0.0) {
                return Ok(true);
            }
            self.solver.prepare(q);
            // The search from a start ends if its first unreached task makes too little progress.
            let ahead = self.misses.iter().zip(&self.mark).find(|(now, before)| now != before);
            if ahead.is_some_and(|(now, before)| *now < (1.0 - PROGRESS) * before) {
                self.mark.copy_from_slice(&self.misses);
                since = 0;
            } else {
                since += 1;
            }
            let far = largest(&self.e);
            self.set_thresholds()?;
            let moved = self.step(q, CENTRING * far.min(1.0))?;
            *iterations += 1;
            if moved <= 1e-3 * self.search.tolerance || since >= PROGRESS_STEPS {
                return Ok(true);
            }
        }
        // The loop does not compute the errors after its last step.
        self.look_at(q);
        self.keep_best(q);
        Ok(false)
    }

    fn keep_best(&mut self, q: &[f64]) {
        if better(&self.misses, &self.found.misses) {
            self.found.q.copy_from_slice(q);
            self.found.misses.copy_from_slice(&self.misses);
        }
    }

    /// Set `eps = |e| / step_max`, at most the threshold of the options or the default threshold. With `eps = |e| / step_max`, a step is at
    /// most `step_max` for every singular value. Near the goal a step is a Newton step, even with small singular values.
    fn set_thresholds(&mut self) -> Result<()> {
        let (n, levels) = (self.held.len(), self.solver.rows().len());
        let mut at = 0;
        for k in 0..levels {
            let m = self.solver.rows()[k];
            let most = match &self.search.eps {
                Some(eps) if eps.len() == 1 => eps[0],
                Some(eps) if k < eps.len() => eps[k],
                _ => {
                    let (jacobian, _) = self.solver.solver_mut().inputs();
                    let rows = jacobian[at * n..(at + m) * n].chunks_exact(n);
                    DEFAULT_EPS * rows.map(|row| dot(row, row)).fold(0.0, f64::max).sqrt()
                }
            };
            if k < self.desired.len() {
                let e = &self.e[at..at + m];
                self.eps[k] = (dot(e, e).sqrt() / self.search.step_max).min(most).max(SMALLEST_EPS);
            } else {
                self.eps[k] = most.max(SMALLEST_EPS);
            }
            at += m;
        }
        self.solver.solver_mut().set_eps(&self.eps)
    }

    /// Take one step from `q`, with the Jacobians of the solver at `q`. Return the largest motion of a joint.
    fn step(&mut self, q: &mut [f64], centring: f64) -> Result<f64> {
        let n = q.len();
        self.held.fill(false);
        // Every pass holds at least one more joint, so at most n + 1 passes are necessary.
        loop {
            let (jacobian, command) = self.solver.solver_mut().inputs();
            let (tasks, joints) = command.split_at_mut(self.e.len());
            tasks.copy_from_slice(&self.e);
            let ranges = self.bounds.iter().zip(&*q).filter(|((lower, upper), _)| (upper - lower).is_finite());
            joints.iter_mut().zip(ranges).for_each(|(to, ((lower, upper), q))| *to = centring * (0.5 * (lower + upper) - q));
            for (i, _) in self.held.iter().enumerate().filter(|(_, held)| **held) {
                jacobian.chunks_exact_mut(n).for_each(|row| row[i] = 0.0);
            }
            let v = &self.solver.solver_mut().run()?.v;
            if !blocked(q, v, &self.bounds, &mut self.held) {
                break;
            }
        }
        Ok(advance(q, &self.solver.solver().solution().v, &self.bounds, self.search.step_max))
    }

    /// Draw a random start, uniform within the limits. A revolute joint without limits has a range of one revolution. A prismatic joint
    /// without limits has a range of one metre on both sides of `q0`.
    pub fn random_start(&self, q0: &[f64], state: &mut u64, start: &mut [f64]) {
        within(&self.bounds, &self.angles, q0, state, start);
    }

    /// The largest difference between `a` and `b` in a joint, rad or m. Full revolutions that return all bodies to their
    /// places do not count.
    pub fn apart(&self, a: &[f64], b: &[f64]) -> f64 {
        let gap = |(turns, (a, b)): (&bool, (&f64, &f64))| {
            let gap = b - a;
            (if *turns { gap - 2.0 * PI * (gap / (2.0 * PI)).round() } else { gap }).abs()
        };
        self.turns.iter().zip(a.iter().zip(b)).map(gap).fold(0.0, f64::max)
    }
}

/// Create a solver for the tasks. If joints have a finite range, their positions are an additional task of the lowest priority.
fn with_centring(arm: &Arm, tasks: &[TaskFunction], bounds: &[(f64, f64)], mut options: PriorityOptions) -> Result<ArmSolver> {
    let mut functions = tasks.to_vec();
    let joints: Vec<usize> = (0..bounds.len()).filter(|&i| (bounds[i].1 - bounds[i].0).is_finite()).collect();
    if !joints.is_empty() && !tasks.is_empty() {
        functions.push(Posture { joints }.into());
        if let Some(eps) = options.eps.as_mut().filter(|eps| eps.len() == tasks.len() && eps.len() > 1) {
            eps.push(DEFAULT_EPS);
        }
    }
    ArmSolver::new(arm, functions, &options)
}
