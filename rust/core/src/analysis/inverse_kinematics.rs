//! Inverse kinematics of positions: prioritised damped Newton steps within the joint limits (`nakamura1986inverse`,
//! `siciliano1991priority`; limits as an active set).
//!
//! `q <- clip(q + s dq)`, where `dq` solves `J_i dq = e_i` in priority by a map that is bounded at singularities, and `s <= 1`
//! keeps every joint's step below a cap. A joint at a limit that the step would cross is held: its column becomes zero, and
//! the step is solved anew. Freedom that is left over while errors are large moves joints towards the middle of their range.
//! From a start that leads nowhere the search goes on from random ones, seeded.

use crate::arm::Arm;
use crate::error::{Error, Result, finite, positive};
use crate::interrupt::look;
use crate::kinematics::TaskFunction;
use crate::law::ArmSolver;
use crate::linalg::dot;
use crate::priority::{DEFAULT_EPS, PriorityMethod, PriorityOptions};
use crate::status::Status;
use std::f64::consts::PI;

/// How to search.
#[derive(Clone, Debug)]
pub struct IkOptions {
    /// A task is reached when every entry of its error is at most this, m or rad.
    pub tolerance: f64,
    /// Steps from each start.
    pub max_iterations: usize,
    /// Random starts after the given one.
    pub restarts: usize,
    /// Seed of the random starts.
    pub seed: u64,
    /// Largest step of a joint, rad or m.
    pub step_max: f64,
    /// Keep to the joint limits of the arm.
    pub limits: bool,
    /// How the tasks share the joints.
    pub method: PriorityMethod,
    /// Threshold on singular values, one per task or one for all.
    pub eps: Option<Vec<f64>>,
}

impl Default for IkOptions {
    fn default() -> Self {
        let (method, eps) = (PriorityMethod::Clamp, None);
        IkOptions { tolerance: 1e-9, max_iterations: 100, restarts: 50, seed: 0, step_max: 0.5, limits: true, method, eps }
    }
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct IkSolution {
    /// `(n,)`
    pub q: Vec<f64>,
    /// Errors of all tasks at `q`, one after another, `(sum rows,)`.
    pub errors: Vec<f64>,
    /// Whether each task is reached.
    pub reached: Vec<bool>,
    /// Steps taken from all starts together, and random starts used.
    pub iterations: usize,
    /// Random starts used.
    pub restarts: usize,
    /// `Success`: every task is reached. `Degraded`: the first is, some lower one is not. `Infeasible`: the first is not, and the
    /// best start came to rest. `MaxSteps`: the first is not, and the best start was still moving.
    pub status: Status,
}

/// Progress of the leading unreached task below this part in `PROGRESS_STEPS` steps ends a start.
const PROGRESS: f64 = 1e-3;
const PROGRESS_STEPS: usize = 20;

/// The part of the way to the middle of its range that a joint is asked to go in a step, where errors are of order one. It fades
/// with them, so that the last steps are Newton's.
const CENTRING: f64 = 0.2;

/// Thresholds stay above this: singular values below it are rounding.
const SMALLEST_EPS: f64 = 1e-9;

/// A task with its constant target; `None` for one that needs none.
pub type Goal = (TaskFunction, Vec<f64>);

struct Attempt {
    q: Vec<f64>,
    /// Largest error of each task, zero where it is reached.
    misses: Vec<f64>,
    resting: bool,
}

/// Joint positions where the tasks `goals` are reached, the highest first, from `q0` `(n,)`.
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
    let n = arm.n();
    if q0.len() != n {
        return Err(Error::input("q0", format!("has the wrong shape: expected ({n},), got ({},)", q0.len())));
    }
    finite("q0", q0)?;
    positive("tolerance", search.tolerance)?;
    positive("step_max", search.step_max)?;
    if search.method == PriorityMethod::Sns {
        return Err(Error::input("method", "bounds velocities: expected clamp, damped, exact or chiaverini, got sns"));
    }
    for (function, target) in goals {
        function.require_target(target)?;
    }
    let bounds = limits(arm, search.limits)?;
    let options = PriorityOptions { eps: search.eps.clone(), ..PriorityOptions::new(search.method) };
    let solver = newton_solver(arm, goals, &bounds, options)?;
    let desired = goals.iter().map(|(_, target)| [target.as_slice(), &vec![0.0; 2 * target.len()]].concat()).collect();
    let total = goals.iter().map(|(function, _)| function.rows()).sum();
    let eps = vec![DEFAULT_EPS; solver.rows().len()];
    let mut newton = Newton { solver, desired, bounds, search, e: vec![0.0; total], w: vec![0.0; total], held: vec![false; n], eps };
    let mut random = search.seed;
    let (mut best, mut iterations, mut restarts) = (None::<Attempt>, 0, 0);
    loop {
        let start: Vec<f64> = if restarts == 0 { q0.to_vec() } else { newton.random_start(arm, q0, &mut random) };
        let attempt = newton.descend(start, &mut iterations)?;
        let done = attempt.misses.iter().all(|miss| *miss == 0.0);
        if best.as_ref().is_none_or(|best| better(&attempt.misses, &best.misses)) {
            best = Some(attempt);
        }
        if done || restarts == search.restarts {
            break;
        }
        restarts += 1;
    }
    let Some(best) = best else { unreachable!("the first start is always tried") };
    let errors = { newton.errors(&best.q).to_vec() };
    let reached: Vec<bool> = best.misses.iter().map(|miss| *miss == 0.0).collect();
    let status = match (reached.iter().all(|r| *r), reached[0], best.resting) {
        (true, ..) => Status::Success,
        (_, true, _) => Status::Degraded,
        (_, _, true) => Status::Infeasible,
        _ => Status::MaxSteps,
    };
    Ok(IkSolution { q: best.q, errors, reached, iterations, restarts, status })
}

/// The tasks, and below them the joints that have a range.
fn newton_solver(arm: &Arm, goals: &[Goal], bounds: &[(f64, f64)], mut options: PriorityOptions) -> Result<ArmSolver> {
    let mut functions: Vec<TaskFunction> = goals.iter().map(|(function, _)| function.clone()).collect();
    let joints: Vec<usize> = (0..bounds.len()).filter(|&i| (bounds[i].1 - bounds[i].0).is_finite()).collect();
    if !joints.is_empty() && !goals.is_empty() {
        functions.push(TaskFunction::Posture { joints });
        if let Some(eps) = options.eps.as_mut().filter(|eps| eps.len() == goals.len() && eps.len() > 1) {
            eps.push(crate::priority::DEFAULT_EPS);
        }
    }
    ArmSolver::new(arm, functions, &options)
}

/// Whether `a` is better than `b` at the first task in which they differ.
fn better(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).find(|(a, b)| a != b).is_some_and(|(a, b)| a < b)
}

/// Lower and upper limit of each joint, infinite where there are none.
fn limits(arm: &Arm, keep: bool) -> Result<Vec<(f64, f64)>> {
    let free = (f64::NEG_INFINITY, f64::INFINITY);
    let of = |joint: &crate::arm::Joint| if keep { (joint.limits.lower, joint.limits.upper) } else { free };
    let bounds: Vec<(f64, f64)> = arm.joints.iter().map(of).collect();
    match bounds.iter().position(|(lower, upper)| !(lower <= upper)) {
        None => Ok(bounds),
        Some(i) => Err(Error::input(
            "arm",
            format!("has limits out of order: expected lower <= upper, got {} > {} (first bad index {i})", bounds[i].0, bounds[i].1),
        )),
    }
}

struct Newton<'a> {
    solver: ArmSolver,
    desired: Vec<Vec<f64>>,
    bounds: Vec<(f64, f64)>,
    search: &'a IkOptions,
    e: Vec<f64>,
    w: Vec<f64>,
    held: Vec<bool>,
    eps: Vec<f64>,
}

impl Newton<'_> {
    /// Errors of all tasks at `q`.
    fn errors(&mut self, q: &[f64]) -> &[f64] {
        self.solver.tasks().place(q);
        let mut at = 0;
        for k in 0..self.desired.len() {
            let m = self.solver.rows()[k];
            self.solver.tasks().error(k, &self.desired[k], &mut self.e[at..at + m], &mut self.w[at..at + m], None);
            at += m;
        }
        &self.e
    }

    fn misses(&self) -> Vec<f64> {
        let mut at = 0;
        let miss = |&m: &usize| {
            let most = self.e[at..at + m].iter().fold(0.0f64, |most, e| most.max(e.abs()));
            at += m;
            if most <= self.search.tolerance { 0.0 } else { most }
        };
        self.solver.rows()[..self.desired.len()].iter().map(miss).collect()
    }

    /// Newton steps from `q` until all is reached, nothing moves any more, or the steps are used up.
    fn descend(&mut self, mut q: Vec<f64>, iterations: &mut usize) -> Result<Attempt> {
        clip(&mut q, &self.bounds);
        let mut best = (q.clone(), vec![f64::INFINITY; self.desired.len()]);
        let (mut mark, mut since) = (best.1.clone(), 0);
        for _ in 0..self.search.max_iterations.max(1) {
            look();
            self.solver.prepare(&q)?;
            self.errors(&q);
            let misses = self.misses();
            if better(&misses, &best.1) {
                best = (q.clone(), misses.clone());
            }
            if misses.iter().all(|miss| *miss == 0.0) {
                return Ok(Attempt { q, misses, resting: true });
            }
            // A start is given up when its leading unreached task makes no progress worth a step.
            let ahead =
                misses.iter().zip(&mark).find(|(now, before)| now != before).is_some_and(|(now, before)| *now < (1.0 - PROGRESS) * before);
            if ahead {
                (mark, since) = (misses, 0);
            } else {
                since += 1;
            }
            let far = misses_most(&self.e);
            self.set_thresholds()?;
            let moved = self.step(&mut q, CENTRING * far.min(1.0))?;
            *iterations += 1;
            if moved <= 1e-3 * self.search.tolerance || since >= PROGRESS_STEPS {
                return Ok(Attempt { q: best.0, misses: best.1, resting: true });
            }
        }
        // The last step has not been looked at.
        self.errors(&q);
        let misses = self.misses();
        if better(&misses, &best.1) {
            best = (q, misses);
        }
        Ok(Attempt { q: best.0, misses: best.1, resting: false })
    }

    /// `eps = |e| / step_max`, which bounds a step by `step_max` at any singular value, and at most the threshold of control: near
    /// the goal a step is Newton's even where singular values are small.
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

    /// One step of `q`, its Jacobians filled in; returns the largest motion of a joint.
    fn step(&mut self, q: &mut [f64], centring: f64) -> Result<f64> {
        let n = q.len();
        self.held.fill(false);
        // Every round holds one joint more, so that there are at most n + 1.
        loop {
            let (jacobian, command) = self.solver.solver_mut().inputs();
            let (tasks, rest) = command.split_at_mut(self.e.len());
            tasks.copy_from_slice(&self.e);
            let ranges = self.bounds.iter().zip(&*q).filter(|((lower, upper), _)| (upper - lower).is_finite());
            rest.iter_mut().zip(ranges).for_each(|(to, ((lower, upper), q))| *to = centring * (0.5 * (lower + upper) - q));
            for (i, _) in self.held.iter().enumerate().filter(|(_, held)| **held) {
                jacobian.chunks_exact_mut(n).for_each(|row| row[i] = 0.0);
            }
            self.solver.solver_mut().run()?;
            let (v, mut more) = (self.solver.solver().v(), false);
            for i in 0..n {
                let (lower, upper) = self.bounds[i];
                if !self.held[i] && ((q[i] <= lower && v[i] < 0.0) || (q[i] >= upper && v[i] > 0.0)) {
                    self.held[i] = true;
                    more = true;
                }
            }
            if !more {
                break;
            }
        }
        let v = self.solver.solver().v();
        let most = v.iter().fold(0.0f64, |most, v| most.max(v.abs()));
        let scale = if most > self.search.step_max { self.search.step_max / most } else { 1.0 };
        let mut moved = 0.0f64;
        for (i, q) in q.iter_mut().enumerate() {
            let next = (*q + scale * v[i]).max(self.bounds[i].0).min(self.bounds[i].1);
            moved = moved.max((next - *q).abs());
            *q = next;
        }
        Ok(moved)
    }

    /// Uniform within the limits; a joint without them within a turn, or a metre about the given start.
    fn random_start(&self, arm: &Arm, q0: &[f64], state: &mut u64) -> Vec<f64> {
        let draw = |(i, &(lower, upper)): (usize, &(f64, f64))| {
            let (around, half) = if arm.joints[i].kind.is_angle() { (0.0, PI) } else { (q0[i], 1.0) };
            let low = if lower.is_finite() { lower } else { (around - half).min(upper - 2.0 * half) };
            let high = if upper.is_finite() { upper } else { low + 2.0 * half };
            low + (high - low) * uniform(state)
        };
        self.bounds.iter().enumerate().map(draw).collect()
    }
}

/// The largest error of any task.
fn misses_most(e: &[f64]) -> f64 {
    e.iter().fold(0.0, |most, e| most.max(e.abs()))
}

fn clip(q: &mut [f64], bounds: &[(f64, f64)]) {
    for (q, (lower, upper)) in q.iter_mut().zip(bounds) {
        *q = q.max(*lower).min(*upper);
    }
}

/// A number in [0, 1) of the sequence that `state` stands for (SplitMix64, `steele2014splittable`).
fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^= z >> 31;
    (z >> 11) as f64 / (1u64 << 53) as f64
}
