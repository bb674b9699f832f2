//! The search for the fastest timing: the passes of TOPP-RA (Pham and Pham 2018) on a grid, corrections of the profile, and finer grids.
//!
//! The methods in the order of the computation:
//! 1. `passes`: the backward pass over the controllable sets and the greedy forward pass.
//! 2. `follow_active_limits`: repeat the passes with the slope of the active limit as the slope of `u`.
//! 3. `iterate_friction`: repeat the passes with a line in place of the root in viscous friction (`friction`).
//! 4. `correct`: check between grid points, reduce exceeded limits, repeat the passes (`corrections`). The result is a `GridState`.
//! 5. `refinement`: halve all segments, or those with large errors, and continue with step 1 on the finer grid.

use super::check::LimitCheck;
use super::given::TimePathOptions;
use super::passes::{Infeasible, Passes, Profile, SetSlopes};
use super::problem::PathProblem;
use super::rate::limit_rate;
use super::reason::PathReason;
use super::samples::Samples;
use super::timing::TimePath;
use super::tuning::{ACCURACY_FACTOR, DURATION_CHANGE, FIRST_ACCURACY, LOSS_PER_EXCESS, MOST_GRIDS, MOST_UNIFORM_HALVINGS};
use crate::error::Result;
use crate::motion::TimedPath;
use crate::scalar::run_lanes;

/// The state of the search after the corrections on one grid.
pub(super) enum GridState {
    /// The profile satisfies all limits, also between grid points. Its path speed may be zero on a whole segment.
    Feasible(LimitCheck),
    /// Before the first correction, a segment exceeds a limit or loses time by more than the accuracy of the grid allows.
    Inaccurate(LimitCheck),
    /// The profile exceeds a limit after the last correction.
    Exceeding(LimitCheck),
    /// No profile obeys the rows of the limits.
    Infeasible(Infeasible),
}

/// The segments that the next grid halves.
enum Refinement {
    /// Segments with a large excess or a large loss of time.
    Inaccurate,
    All,
}

/// The search on a sequence of grids.
pub(super) struct Search<'a> {
    pub problem: PathProblem<'a>,
    options: &'a TimePathOptions,
    pub profile: Profile,
    pub samples: Samples,
    /// `(N,)`: the estimated loss of time on each segment before the first correction, as a fraction of the duration.
    pub time_losses: Vec<f64>,
    /// A segment is halved if its relative excess over a limit exceeds `accuracy`, or its loss of time `LOSS_PER_EXCESS * accuracy`.
    pub accuracy: f64,
    grids_left: usize,
    uniform_halvings_left: usize,
    /// The fastest timing that satisfies all limits.
    fastest: Option<TimePath>,
    /// The fastest timing of a profile that exceeded its limits and was slowed down (`slow`). It is used if there is no other timing.
    pub slowed: Option<TimePath>,
}

impl<'a> Search<'a> {
    pub fn new(problem: PathProblem<'a>, options: &'a TimePathOptions) -> Self {
        let refine = options.refine || options.grid.is_none();
        let (grids_left, uniform_halvings_left) = if refine { (MOST_GRIDS, MOST_UNIFORM_HALVINGS) } else { (1, 0) };
        Search {
            problem,
            options,
            profile: Profile::default(),
            samples: Samples::default(),
            time_losses: Vec::new(),
            accuracy: FIRST_ACCURACY,
            grids_left,
            uniform_halvings_left,
            fastest: None,
            slowed: None,
        }
    }

    /// Search on finer and finer grids, until the duration changes little or no grid is left. Return the timing, or the reason why none was
    /// found on the last grid.
    pub fn run(mut self) -> Result<TimePath> {
        loop {
            self.grids_left -= 1;
            let last_grid = self.grids_left == 0 || self.uniform_halvings_left == 0;
            let state = self.plan_on_grid(last_grid && self.fastest.is_none());
            // Slowing down changes the profile, so the reason is found before.
            let reason = self.reason(&state);
            let refinement = self.refinement(&state)?;
            match refinement.filter(|_| !last_grid) {
                Some(Refinement::Inaccurate) if self.halve_inaccurate() => {}
                Some(Refinement::Inaccurate) if self.fastest.is_some() => return self.finish(reason),
                Some(_) => self.halve_all(),
                None => return self.finish(reason),
            }
        }
    }

    /// Compute the profile on the present grid, and correct it. On the last attempt, no grid follows.
    fn plan_on_grid(&mut self, last_attempt: bool) -> GridState {
        self.problem.remove_reductions();
        self.profile.recompute_all = true;
        self.samples = Samples::new(&self.problem);
        match self.first_profile() {
            Ok(()) => self.correct(last_attempt),
            Err(infeasible) => GridState::Infeasible(infeasible),
        }
    }

    /// Compute the profile before any limit is reduced.
    fn first_profile(&mut self) -> std::result::Result<(), Infeasible> {
        self.passes()?;
        self.follow_active_limits()?;
        self.profile.store_least_exceeding();
        self.iterate_friction()
    }

    /// The backward pass and the forward pass of TOPP-RA.
    pub fn passes(&mut self) -> std::result::Result<(), Infeasible> {
        run_lanes(Passes(&self.problem.rows, &mut self.profile))
    }

    /// Repeat the passes with the slope of `u` of the active limits. If no profile is feasible then, `u` is constant on each segment.
    fn follow_active_limits(&mut self) -> std::result::Result<(), Infeasible> {
        let cap_slopes = self.problem.cap_slopes(&self.profile);
        run_lanes(SetSlopes(&mut self.problem.rows, &mut self.profile, &cap_slopes));
        self.passes().or_else(|_| {
            self.problem.rows.u_slope.fill(0.0);
            self.profile.recompute_all = true;
            self.passes()
        })
    }

    /// Store a feasible timing or a slowed one. Return the segments to halve, or `None` if the fastest timing is accurate enough.
    fn refinement(&mut self, state: &GridState) -> Result<Option<Refinement>> {
        match state {
            GridState::Feasible(check) => {
                let timing = TimePath { motion: self.motion()?, margin: check.margin, reason: None };
                // Where `x` is zero at both ends of a segment, the motion does not end.
                if timing.motion.duration().is_finite() {
                    return Ok(if self.accept(timing) { None } else { Some(Refinement::Inaccurate) });
                }
            }
            GridState::Inaccurate(_) => return Ok(Some(Refinement::Inaccurate)),
            GridState::Exceeding(_) | GridState::Infeasible(_) => {}
        }
        if self.fastest.is_none() {
            self.slow_down()?;
        }
        Ok(Some(Refinement::All))
    }

    /// Store the timing if it is the fastest so far. Return whether it is accurate enough. If not, the next grid has a smaller `accuracy`.
    fn accept(&mut self, timing: TimePath) -> bool {
        let duration = timing.motion.duration();
        let earlier = self.fastest.as_ref().map(|fastest| fastest.motion.duration());
        if earlier.is_none_or(|earlier| duration < earlier) {
            self.fastest = Some(timing);
        }
        self.accuracy *= ACCURACY_FACTOR;
        earlier.map_or(self.options.grid.is_some(), |earlier| (earlier - duration).abs() <= DURATION_CHANGE * duration)
    }

    /// The motion of the present profile.
    pub fn motion(&self) -> Result<TimedPath> {
        let PathProblem { path, rows, .. } = &self.problem;
        TimedPath::new(path.clone(), rows.s.clone(), self.profile.x.clone(), rows.u_slope.clone())
    }

    /// Halve the segments with large errors. Return whether there is one.
    fn halve_inaccurate(&mut self) -> bool {
        let Search { problem, samples, time_losses, accuracy, .. } = self;
        problem.refine(|i| {
            let excess = samples.first_excess[i] / *accuracy;
            halvings(excess).max(halvings(time_losses[i] / (LOSS_PER_EXCESS * *accuracy)))
        })
    }

    fn halve_all(&mut self) {
        self.uniform_halvings_left -= 1;
        self.problem.refine(|_| 1);
    }

    /// The result of the search: the fastest timing, with its torque rate limited if this is required.
    fn finish(self, reason: PathReason) -> Result<TimePath> {
        let Search { problem, options, fastest, slowed, .. } = self;
        match (fastest.or(slowed), &options.torque_rate) {
            (None, _) => problem.refuse(reason),
            (Some(timing), None) => Ok(timing),
            (Some(timing), Some(rates)) => limit_rate(&problem, timing, rates, options),
        }
    }
}

/// The number of halvings of a segment whose error is `ratio` times the allowed error. The error is proportional to the square of the
/// segment's length.
fn halvings(ratio: f64) -> u32 {
    if ratio > 1.0 { (0.5 * ratio.log2()).ceil() as u32 } else { 0 }
}
