//! Levels with bounds: lexicographic least squares with inequalities (Kanoun, Lamiraux and Wieber 2011, `kanoun2011priority`; Escande,
//! Mansard and Wieber 2014, `escande2014hierarchical`). Level `k` has the rows `l_k <= A_k x <= u_k`, where `l = u` is a task. Its violation
//! is `w_k = A_k x - clip(A_k x, l_k, u_k)`. It minimises
//!
//! `|w_k|^2`  over the `x` that keep the violations of all higher levels.
//!
//! A row with `w = 0` stays within its bounds, and a row with `w != 0` keeps its value. Among the remaining `x`, the result has the smallest
//! norm. The solution is unique. Its certificate are the conditions of Karush, Kuhn and Tucker of each level,
//!
//! `A_k' w_k + sum lambda_i a_i = 0`,  `lambda_i >= 0` at an upper bound, `lambda_i <= 0` at a lower bound, and zero elsewhere.
//!
//! The sum is over the rows of the higher levels. It is restricted to the free coordinates of the frame, because rows that the higher levels
//! have fixed may have every multiplier.
//!
//! A level is solved by a primal active-set method (`search`). Rows with a positive multiplier, tasks and violated rows are then fixed, and
//! the lower levels use the remaining coordinates (`frame`). Repeated solves first try the active set of the last solve, and accept it if
//! the certificate holds (`warm`). The methods `clamp` and `damped` add penalty rows to a level, so that their steps are least-squares
//! solutions too (`damping`). With a kept direction, each command has a scale (`scale`).

mod columns;
mod damping;
mod face;
mod frame;
mod last_set;
mod outcome;
mod projected_command;
mod rows;
mod scale;
mod search;
mod slopes;
mod unbounded;
mod vertex;
mod warm;

use super::method::PriorityMethod;
use super::settings::Settings;
use super::solution::{LevelSolution, Solution};
use super::stack::Stack;
use crate::error::Result;
use crate::linalg::dot;
use crate::status::Status;
use face::{Face, RankRule};
use frame::Frame;
use last_set::LastSet;
use projected_command::Scaling;
use rows::Rows;
pub(super) use slopes::Slopes;
use unbounded::Damping;

/// The rounding error of `a x`, divided by `|a|` and the largest norm of `x` in the solve.
const NOISE: f64 = 1e-13;

/// A multiplier counts as zero if its force is below this fraction of the largest force of the level.
const ZERO_FORCE: f64 = 1e-11;

/// The part of a row in the solve of a level.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Part {
    /// It belongs to a lower level.
    Later,
    /// It belongs to the level.
    Own,
    /// It belongs to a higher level, and must stay within its bounds.
    Kept,
    /// As `Kept`, and it is held at a bound.
    Working,
    /// Its value cannot change.
    Fixed,
}

/// The quantity that a search minimises.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Goal {
    /// The violations of the level, with the penalty rows.
    Violation,
    /// The distance from the preferred `x`, which is zero for `exact`.
    Norm,
    /// The negative length `t` of a scaled command.
    Scale,
}

/// The solver of stacks with bounds, with its memory.
#[derive(Debug, Clone)]
pub(super) struct Inequalities {
    /// The present problem: its number and its goal.
    number: usize,
    goal: Goal,
    rows: Rows,
    frame: Frame,
    face: Face,
    rule: RankRule,
    /// The velocities in the coordinates of the metric. If commands are scaled, `t` is before them.
    x: Vec<f64>,
    /// The largest norm of `x` so far.
    reach: f64,
    /// The values `a x` of all rows, then `sqrt(rho) v'y` of the penalty rows.
    value: Vec<f64>,
    part: Vec<Part>,
    /// For a violated or held row, the sign of its bound: 1 for the upper, -1 for the lower.
    side: Vec<i8>,
    multiplier: Vec<f64>,
    /// Whether a row was violated when its level was fixed.
    violated: Vec<bool>,
    /// The rows of the level and the kept rows.
    watched: Vec<usize>,
    /// The rows that are held at a bound. In the frame they are the rows of a lower triangle.
    working: Vec<usize>,
    /// The tasks and violated rows of the level, then its penalty rows.
    pulled: Vec<usize>,
    /// Rows of the level that are at a bound, and that the last step would violate, with the sides of their bounds.
    tied: Vec<(usize, i8)>,
    penalties: usize,
    step: Vec<f64>,
    rate: Vec<f64>,
    right_side: Vec<f64>,
    /// The active set of each problem in the last solve. `known`: whether there is one. `warm`: whether the present solve uses it. `keeps`:
    /// whether it is kept at all.
    last: Vec<LastSet>,
    known: bool,
    warm: bool,
    keeps: bool,
    /// Whether the last solve ended before the limit of changes.
    complete: bool,
    /// Whether a bound was active so far.
    touched: bool,
    changes: usize,
    certificate: f64,
    damping: Option<Damping>,
    scaling: Option<Scaling>,
}

impl Inequalities {
    /// Allocate memory for a stack.
    pub fn new(stack: &Stack, settings: &Settings) -> Self {
        let rows = Rows::new(stack, settings.bounds.is_some(), settings.scales);
        let (n, count, problems) = (stack.n + rows.offset, rows.len(), (2 + rows.offset) * rows.levels.len());
        let zeros = |size| vec![0.0; size];
        let most = stack.rows.iter().copied().max().unwrap_or(0).max(rows.levels[0].len()) + n;
        let frame = Frame::new(n, count, settings.method.damps());
        Inequalities {
            number: 0,
            goal: Goal::Violation,
            rate: zeros(frame.width()),
            frame,
            face: Face::new(n, most),
            rule: RankRule { norm: 0.0, rounding: 0.0, condition: 1.0 },
            x: zeros(n),
            reach: 0.0,
            value: zeros(rows.columns.width() + n),
            part: vec![Part::Later; count],
            side: vec![0; count + n],
            multiplier: zeros(count),
            violated: vec![false; count],
            watched: Vec::with_capacity(count),
            working: Vec::with_capacity(n),
            pulled: Vec::with_capacity(most),
            tied: Vec::with_capacity(count),
            penalties: 0,
            step: zeros(n),
            right_side: zeros(most),
            last: (0..problems).map(|_| LastSet::new(count)).collect(),
            known: false,
            warm: false,
            keeps: false,
            complete: false,
            touched: false,
            changes: 0,
            certificate: 0.0,
            damping: settings.method.damps().then(|| Damping::new(stack)),
            scaling: settings.scales.then(|| Scaling::new(stack)),
            rows,
        }
    }

    /// Solve a stack. Errors: `Input` for numbers that are not finite and for bounds out of order, `Solve` without convergence of a singular
    /// value decomposition.
    pub fn solve(&mut self, given: &Stack, settings: &Settings, solution: &mut Solution) -> Result<()> {
        self.complete = false;
        self.rows.load(given, settings)?;
        self.warm = std::mem::replace(&mut self.known, false);
        let accepted = self.warm && self.solve_levels(given, settings, solution)?;
        if !accepted {
            self.warm = false;
        }
        let complete = accepted || self.solve_levels(given, settings, solution)?;
        (self.complete, self.known) = (complete, complete && self.keeps);
        self.check_bounds();
        self.write(settings, solution);
        solution.status = match solution.levels.iter().any(|level| level.singular || level.scale < 1.0) || self.is_limited() {
            _ if !complete => Status::MaxSteps,
            true => Status::Degraded,
            false => Status::Success,
        };
        Ok(())
    }

    /// Start each solve with the active set of the last. A damped solve starts without one, because its steps depend on each other.
    pub fn keep_active_set(&mut self) {
        self.keeps = self.damping.is_none();
    }

    /// Forget the active set of the last solve.
    pub fn clear_active_set(&mut self) {
        self.known = false;
    }

    /// Whether the last solve damped a direction.
    pub fn damps_a_direction(&self) -> bool {
        self.damping.is_some() && self.last.iter().any(|set| set.damps)
    }

    /// Solve all levels. Return false at the limit of the number of changes, or if the active set of the last solve is not accepted.
    fn solve_levels(&mut self, given: &Stack, settings: &Settings, solution: &mut Solution) -> Result<bool> {
        self.begin(settings);
        solution.levels.fill(LevelSolution { rank: 0, singular: true, scale: if settings.scales { 0.0 } else { 1.0 } });
        for level in 0..self.rows.levels.len() {
            let Some(outcome) = self.solve_level(level, given, settings)? else { return Ok(false) };
            if level > 0 {
                solution.levels[level - 1] = outcome;
            }
        }
        self.prefer(self.rows.levels.len(), given, settings)
    }

    /// Start at the velocities within the bounds of level 0 that are nearest to zero.
    fn begin(&mut self, settings: &Settings) {
        self.frame.start(&self.rows.columns);
        self.frame.used = self.rows.offset;
        self.x.fill(0.0);
        let velocities = &mut self.x[self.rows.offset..];
        if !self.rows.levels[0].is_empty() {
            let bounds = self.rows.lower.iter().zip(&self.rows.upper);
            velocities.iter_mut().zip(bounds).for_each(|(x, (l, u))| *x = 0.0f64.max(*l).min(*u));
            settings.metric.iter().for_each(|metric| metric.coordinates(velocities));
        }
        self.reach = dot(&self.x, &self.x).sqrt();
        self.part.fill(Part::Later);
        self.side.fill(0);
        self.multiplier.fill(0.0);
        self.violated.fill(false);
        self.working.clear();
        self.rule = RankRule { norm: 0.0, rounding: settings.rounding, condition: 1.0 };
        (self.changes, self.certificate, self.penalties, self.touched) = (0, 0.0, 0, self.x.iter().any(|x| *x != 0.0));
        self.damping.iter_mut().for_each(Damping::begin);
        self.scaling.iter_mut().for_each(|scaling| scaling.begin(settings));
    }

    /// Solve one level, and fix its directions. The result is `None` if the number of changes reached its limit.
    fn solve_level(&mut self, level: usize, given: &Stack, settings: &Settings) -> Result<Option<LevelSolution>> {
        let own = self.rows.levels[level].clone();
        if own.is_empty() {
            return Ok(Some(LevelSolution::new(0, 0)));
        }
        let damps = level > settings.limit_levels && settings.method.damps();
        // A damped step depends on the velocity at its start.
        if damps && self.touched && !self.prefer(level, given, settings)? {
            return Ok(None);
        }
        self.clear_working();
        if level > 0 && self.scaling.is_some() && !given.is_interval(level - 1) {
            return self.solve_scaled_level(level);
        }
        self.part[own].fill(Part::Own);
        self.rule.norm = self.rows.frobenius[level];
        self.watch();
        if damps {
            self.add_penalties(level, settings.method == PriorityMethod::Damped)?;
        }
        if !self.minimise(level, Goal::Violation)? {
            return Ok(None);
        }
        let outcome = self.fix(level, damps)?;
        self.penalties = 0;
        self.use_fixed_rows(level)?;
        Ok(Some(outcome))
    }

    /// Minimise the norm, or the distance from the preferred velocity, before a level or after the last. Return false at the limit of the
    /// number of changes.
    fn prefer(&mut self, level: usize, given: &Stack, settings: &Settings) -> Result<bool> {
        if let Some(damping) = &mut self.damping {
            // Without an active bound, the velocity is the preferred one.
            if !self.touched {
                return Ok(!self.warm || self.is_consistent());
            }
            damping.prefer(level.checked_sub(2), given, settings)?;
        }
        let count = self.rows.levels.len();
        self.watch();
        self.start_units();
        let mut complete = self.minimise(count + level - 1, Goal::Norm)?;
        if self.warm {
            complete &= self.is_consistent();
        } else {
            self.keep_set();
        }
        if level < count {
            self.pulled.clear();
            self.clear_working();
            self.attenuate(level)?;
        }
        Ok(complete)
    }

    /// List the rows of the level and the kept rows.
    fn watch(&mut self) {
        let Inequalities { part, watched, .. } = self;
        watched.clear();
        watched.extend((0..part.len()).filter(|i| !matches!(part[*i], Part::Fixed | Part::Later)));
    }

    /// Minimise a goal: by the active set of the last solve, or by the search.
    fn minimise(&mut self, number: usize, goal: Goal) -> Result<bool> {
        (self.number, self.goal) = (number, goal);
        self.refresh();
        let complete = if self.warm { self.try_last()? } else { self.search()? };
        self.certificate = self.certificate.max(self.stationarity());
        Ok(complete)
    }

    /// Fix the rows with a positive multiplier, the tasks and the violated rows. The directions of the other coordinates remain for the
    /// lower levels.
    fn fix(&mut self, level: usize, damps: bool) -> Result<LevelSolution> {
        self.release_idle();
        self.keep_violated();
        let limited = !self.working.is_empty();
        self.fix_working(|rows, multiplier| rows.unscaled(level, multiplier, 2));
        for i in self.rows.levels[level].clone() {
            self.part[i] = Part::Kept;
        }
        for i in &self.pulled {
            (self.part[*i], self.violated[*i]) = (Part::Fixed, !self.rows.is_task(*i));
        }
        let used = self.frame.used;
        let possible = self.pulled.len().min(self.frame.n() - used);
        let rank = if damps { self.attenuate(level)? } else { self.remove()? };
        let mut outcome = LevelSolution::new(rank, possible);
        outcome.singular |= limited;
        Ok(outcome)
    }

    /// Release the working rows without a force.
    fn release_idle(&mut self) {
        for j in (0..self.working.len()).rev() {
            if self.multiplier[self.working[j]] == 0.0 {
                self.release(j);
            }
        }
    }

    /// Fix the working rows. `unscaled` returns a multiplier in the unit of the caller.
    fn fix_working(&mut self, unscaled: impl Fn(&Rows, f64) -> f64) {
        if !self.working.is_empty() {
            self.rule.condition /= self.face.triangle_bound(&self.frame, &self.working, &self.rows.size, self.frame.used).min(1.0);
        }
        self.frame.used += self.working.len();
        for i in self.working.drain(..) {
            (self.part[i], self.multiplier[i]) = (Part::Fixed, unscaled(&self.rows, self.multiplier[i]));
        }
    }

    /// Keep only the tasks and the violated rows in the list of pulled rows. Store the active set of the level.
    fn keep_violated(&mut self) {
        if !self.warm {
            self.penalties = 0;
            self.tied.clear();
            self.pull();
            self.keep_set();
        }
        let rows = self.rows.len();
        self.pulled.retain(|i| *i < rows);
    }

    /// Remove the directions of the pulled rows. Return their number.
    fn remove(&mut self) -> Result<usize> {
        let Inequalities { frame, face, pulled, rule, .. } = self;
        face.factor(frame, pulled, &self.rows.size, frame.used, *rule)?;
        frame.used += face.taken;
        if face.rank > 0 {
            rule.condition *= face.condition.max(1.0);
        }
        Ok(face.rank)
    }
}
