//! The tangents of the quantities that parameters change: loop parameters, the initial state, and desired motions. They are the seed
//! directions of algorithmic differentiation (Griewank and Walther 2008).
//!
//! ```text
//! f_dot = df/dp = sum_i w_i (f_i - f_0)
//! ```
//!
//! `f_i` is the value of the quantity `f` in run `i`. The runs `i` and the weights `w_i` define the parameter `p` (`parameters`).

use super::parameters::{Parameters, entangled, is_shared};
use crate::error::{Error, Result};
use crate::interrupt;
use crate::memory;
use crate::motion::Side;
use crate::simulate::assembly::{assemble, start, world};
use crate::simulate::problem::Problem;
use crate::simulate::world::World;
use crate::trace::sym;
use crate::trace::tape::Moving;

/// A parameter that changes the desired motion, with the motions of its runs and their weights.
struct VaryingMotion<'a> {
    parameter: usize,
    worlds: Vec<(World<'a>, f64)>,
}

/// The tangents of the loop parameters and of the exogenous input along all parameters. [`start_rates`] returns the tangents of the initial
/// state.
pub struct Directions<'a> {
    pub count: usize,
    /// For each loop parameter, whether it varies.
    pub moving: Vec<bool>,
    /// The number of varying loop parameters.
    pub moved: usize,
    /// The tangents of the varying loop parameters, shape `(moved, count)`.
    pub set_up: Vec<f64>,
    /// Pairs `(parameter, run)`. The recorded functions of these runs are compared with the recorded functions of run 0.
    pub runs: Vec<(usize, usize)>,
    base: World<'a>,
    drives: Vec<VaryingMotion<'a>>,
    width: usize,
}

/// Compute the tangent `sum_i w_i (f_i - f_0)` of each number, and pass it to `put(index, tangent)`. The tangent is exactly zero where the
/// runs do not differ.
fn weighted_differences(base: &[f64], others: &[(&[f64], f64)], mut put: impl FnMut(usize, f64)) {
    for (k, &f_0) in base.iter().enumerate() {
        // Infinite limits are equal, but have no difference.
        put(k, others.iter().filter(|(f_i, _)| f_i[k] != f_0).map(|(f_i, w_i)| w_i * (f_i[k] - f_0)).sum());
    }
}

/// Return all loop parameters of run `run`.
fn loop_parameters(problem: &Problem, run: usize) -> Vec<f64> {
    interrupt::check();
    sym::begin_moving(Moving::All);
    drop(assemble(problem, run, false));
    sym::finish().values
}

/// Return the times within run `run` at which the velocity or the acceleration of a desired motion jumps, s.
fn jumps(problem: &Problem, run: usize) -> Vec<f64> {
    let inside = |t: &f64| *t > 0.0 && *t < problem.options.t_end;
    problem.law(run).motions().iter().flat_map(|motion| motion.jumps()).filter(inside).collect()
}

/// Return the tangents of the initial state, shape `(states, count)`.
pub fn start_rates(problem: &Problem, parameters: Parameters) -> Result<Vec<f64>> {
    let (count, starts) = (parameters.all.len(), |run: usize| start::<f64>(problem, |_| run));
    let first = starts(0);
    let mut rates = memory::zeros(first.len().saturating_mul(count))?;
    for group in parameters.shared {
        group.rates(&first, parameters.all, |run| Ok(starts(run)), |k, p, rate| rates[k * count + p] = rate)?;
    }
    for (p, parameter) in parameters.all.iter().enumerate().filter(|&(p, _)| !is_shared(parameters.shared, p)) {
        interrupt::check();
        let others: Vec<(Vec<f64>, f64)> = parameter.iter().map(|&(run, weight)| (starts(run), weight)).collect();
        let others: Vec<(&[f64], f64)> = others.iter().map(|(values, weight)| (values.as_slice(), *weight)).collect();
        weighted_differences(&first, &others, |k, rate| rates[k * count + p] = rate);
    }
    Ok(rates)
}

impl<'a> Directions<'a> {
    /// Compute the tangents along the parameters. For each name, `runs` lists one run of the first and one run of the last parameter. These
    /// runs represent all parameters of the name, which enter the recorded functions in the same form.
    ///
    /// Errors: `Input` for a parameter that changes the structure of the loop, or the time of a jump of the motion. Also `Input` if a loop
    /// parameter depends on several parameters of a group.
    pub fn of(problem: &'a Problem<'a>, Parameters { all: parameters, sizes, shared }: Parameters) -> Result<Self> {
        let base = loop_parameters(problem, 0);
        let count = parameters.len();
        let is_base = |run: usize| std::ptr::eq(problem.plant(run), problem.plant(0)) && std::ptr::eq(problem.law(run), problem.law(0));
        let mut rates = memory::zeros(base.len().saturating_mul(count))?;
        let (motions, breaks) = (problem.law(0).motions(), problem.law(0).breaks());
        let (jumps, mut drives) = (self::jumps(problem, 0), Vec::new());
        let moves = |run: usize| problem.law(run).motions().iter().zip(&motions).any(|(motion, of)| !motion.is_same(of));
        for group in shared {
            let of = |run: usize| {
                let values = loop_parameters(problem, run);
                if values.len() == base.len() && !moves(run) && problem.law(run).breaks() == breaks { Ok(values) } else { Err(entangled()) }
            };
            group.rates(&base, parameters, of, |k, p, rate| rates[k * count + p] = rate)?;
        }
        for (p, parameter) in parameters.iter().enumerate().filter(|&(p, _)| !is_shared(shared, p)) {
            let other_jumps = |run: usize| problem.law(run).breaks() != breaks || self::jumps(problem, run) != jumps;
            if parameter.iter().any(|&(run, _)| other_jumps(run)) {
                return Err(refused(p, "moves an instant at which the motion jumps"));
            }
            let differ: Vec<(Vec<f64>, f64)> =
                parameter.iter().filter(|&&(run, _)| !is_base(run)).map(|&(run, weight)| (loop_parameters(problem, run), weight)).collect();
            if differ.iter().any(|(values, _)| values.len() != base.len()) {
                return Err(refused(p, "changes what the loop computes, such as an option that is on or off"));
            }
            let differ: Vec<(&[f64], f64)> = differ.iter().map(|(values, weight)| (values.as_slice(), *weight)).collect();
            weighted_differences(&base, &differ, |k, rate| rates[k * count + p] = rate);
            if parameter.iter().any(|&(run, _)| moves(run)) {
                let worlds = parameter.iter().map(|&(run, weight)| (world(problem, 1, |_| run), weight)).collect();
                drives.push(VaryingMotion { parameter: p, worlds });
            }
        }
        let moving: Vec<bool> = rates.chunks_exact(count.max(1)).map(|row| row.iter().any(|&rate| rate != 0.0)).collect();
        let set_up = rates.chunks_exact(count.max(1)).zip(&moving).filter(|(_, moves)| **moves).flat_map(|(row, _)| row).copied().collect();
        let desired: usize = motions.iter().map(|motion| 3 * motion.dof()).sum();
        let width = desired + if problem.forces.is_empty() { 0 } else { 6 };
        let mut ends = sizes.iter().scan(0, |next, size| {
            *next += size;
            Some(*next)
        });
        let mut runs: Vec<(usize, usize)> = Vec::new();
        for (&size, end) in sizes.iter().zip(&mut ends) {
            let compared = [end - size, end.saturating_sub(1)].into_iter().take(size);
            runs.extend(compared.filter_map(|p| Some((p, parameters.get(p)?.first()?.0))).filter(|&(_, run)| !is_base(run)));
        }
        let moved = moving.iter().filter(|&&moves| moves).count();
        let base = world(problem, 1, |_| 0);
        Ok(Directions { count, moving, moved, set_up, runs, base, drives, width })
    }

    /// The size of the exogenous input at one instant.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Whether a parameter changes a desired motion.
    pub fn drives(&self) -> bool {
        !self.drives.is_empty()
    }

    /// Compute the exogenous input at time `t`.
    pub fn input(&self, t: f64, u: &mut [f64]) {
        if self.width > 0 {
            self.base.sample_each(0, &[t], [self.width; 2], u);
        }
    }

    /// Pass the tangents of the exogenous input at time `t` to `put(slot, parameter, tangent)`, for parameters that change a desired
    /// motion. `side` is the side of `t` if a motion has a knot there. `u` is the exogenous input at `t`, and `scratch` is memory for two
    /// inputs.
    pub fn input_rates(&self, (t, side): (f64, Side), u: &[f64], scratch: &mut [f64], mut put: impl FnMut(usize, usize, f64)) {
        let (row, rates) = scratch.split_at_mut(self.width);
        for VaryingMotion { parameter, worlds } in &self.drives {
            rates.fill(0.0);
            for (world, weight) in worlds {
                world.sample_with(&self.base, t, side, row);
                rates.iter_mut().zip(row.iter().zip(u)).for_each(|(rate, (u_i, u_0))| *rate += weight * (u_i - u_0));
            }
            rates.iter().enumerate().for_each(|(slot, &rate)| put(slot, *parameter, rate));
        }
    }
}

/// Return the error that parameter number `parameter` has no derivative, for the reason `why`. The Python binding adds the name of the
/// parameter.
pub fn refused(parameter: usize, why: &str) -> Error {
    Error::input("sensitivity", format!("has no derivative: it {why}")).at([parameter])
}
