//! The steps of an adaptive run for its derivatives: the step-size controller reads the errors of the tangents too.
//!
//! The controller of a run reads only the error of the state. Where the state hardly moves, it takes steps beyond the stability limit of the
//! explicit method. The state stays there, but the tangents `S' = f_x S + f_p` of such steps grow without bound. So the derivatives have
//! their own steps. They begin and end at the samples, jumps of the input and contact changes of the run. Three errors are below their
//! limits in each step:
//!
//! - The error estimate of the state, with the tolerances of the run.
//! - The error estimate of the tangents along a few directions ([`Mixture::combinations`]), with the same tolerances.
//! - The error estimate of a *probe* `w' = f_x w`, relative to `w`. The probe limits the growth of all tangents and of the adjoint, because
//!   after each step it is replaced by `f_x w`. This is a power iteration, which converges to the fastest mode of the loop.
//!
//! The forward and the backward pass use the same steps. The estimates are those of the method. See Hairer, Norsett and Wanner, Solving
//! Ordinary Differential Equations I, sections II.4 and II.6; Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.2.

use super::branches::divided;
use super::forward::Forward;
use super::mixture::Mixture;
use super::parameters::Parameter;
use super::prepared::{Preparation, Prepared};
use super::timeline::Operation;
use crate::error::{Error, Result};
use crate::integrate::{MethodKind, Scheme, StepController, Tableau, Tolerance, WithScheme};
use crate::interrupt;
use crate::memory;
use crate::simulate::problem::sampling::gaussian;
use crate::status::Status;

/// The largest error estimate of the probe in one step, relative to the probe. The product of a real eigenvalue with the
/// step size is then at most 2.5 for `dopri5`, and 6.1 for `dop853`. The limits of stability are 3.3 and 6.4.
const PROBE_ERROR: f64 = 0.2;
/// The factor by which the probe may grow in successive steps. Beyond it, the limit of its error becomes smaller. This happens for
/// oscillations without damping, which `dopri5` amplifies from a product of 1.1 on.
const PROBE_GROWTH: f64 = 1e4;
/// The factor of this change.
const TIGHTER: f64 = 0.1;
/// The smallest limit of the error. The product is then at most 1.2 for `dopri5`.
const LEAST_ERROR: f64 = 2e-3;
/// The smallest component of the probe whose error counts, relative to the largest component.
const PROBE_FLOOR: f64 = 1e-6;
/// The smallest absolute tolerance of a tangent, in the unit of the state, for a parameter that changes by its magnitude. Smaller tangents
/// of a loop at rest are rounding errors.
const ROUNDING: f64 = 1e-14;
/// The seed of the probe.
const SEED: u64 = 1;

/// Complete the timeline of a run: controlled steps and records of an adaptive run, and divisions of the steps at branches. Error: `Solve` if
/// the tangents would require steps below the resolution of the time.
pub fn completed<'a>((mut prepared, path): Preparation<'a>, parameters: &[Parameter]) -> Result<Prepared<'a>> {
    if let (Some(path), MethodKind::ExplicitAdaptive(method)) = (path, prepared.single.options.method.kind()) {
        let divisions = method.scheme(Divide { prepared: &prepared, parameters, steps: &path.steps })?;
        prepared.timeline = path.divided(&divisions)?.timeline(&prepared.single)?;
    }
    if let Some(found) = divided(&prepared)? {
        prepared.timeline.divide(found);
    }
    Ok(prepared)
}

/// Divide the steps of `prepared`, whose timeline has no records, and return the times of the divisions, s, increasing.
struct Divide<'a> {
    prepared: &'a Prepared<'a>,
    parameters: &'a [Parameter],
    /// The ends of the steps of the run, s.
    steps: &'a [f64],
}

impl WithScheme for Divide<'_> {
    type Output = Result<Vec<f64>>;

    fn with<C: Scheme>(self) -> Self::Output {
        let mixture = Mixture::combinations(self.prepared, self.parameters)?;
        let tableau = Tableau::with_last_stage::<C>();
        let mut run = ControlledRun::new::<C>(self.prepared, &mixture, &tableau, self.steps)?;
        for &operation in &self.prepared.timeline.operations {
            interrupt::check();
            match operation {
                Operation::Step { t, h, end, mode } => run.divide::<C>((t, h, end), mode)?,
                other => run.blocks.iter_mut().try_for_each(|block| block.jump(other))?,
            }
        }
        Ok(run.times)
    }
}

/// A run by controlled steps, with its tangents along all directions of a mixture. The last direction is the probe.
struct ControlledRun<'a> {
    blocks: Vec<Forward<'a>>,
    /// The number of directions.
    count: usize,
    tolerance: Tolerance,
    controller: StepController<Tolerance>,
    /// The state, or the tangent along one direction, before and after a step.
    before: Vec<f64>,
    after: Vec<f64>,
    /// Its error estimates, divided by the step size.
    estimates: Vec<Vec<f64>>,
    /// The estimates of the tangents along all directions of a block, divided by the step size.
    combined: Vec<Vec<f64>>,
    /// The limit of the error of the probe.
    probe_error: f64,
    /// The logarithm of the growth of the probe in successive steps, at least zero.
    growth: f64,
    /// The ends of the steps of the run, s. A step that begins in a step of the run is at most as long as this step. So functions of time
    /// limit the steps, as in the run.
    steps: &'a [f64],
    times: Vec<f64>,
}

impl<'a> ControlledRun<'a> {
    fn new<C: Scheme>(prepared: &'a Prepared<'a>, mixture: &'a Mixture<'a>, tableau: &'a Tableau, steps: &'a [f64]) -> Result<Self> {
        let (o, size) = (&prepared.single.options, prepared.functions.sizes.states);
        let tolerance = Tolerance { rtol: o.rtol, atol: o.atol.max(ROUNDING), controlled: size };
        let mut blocks = vec![Forward::new(prepared, mixture, tableau)?];
        for _ in 1..mixture.count.div_ceil(blocks[0].directions()) {
            blocks.push(Forward::new(prepared, mixture, tableau)?);
        }
        for (b, block) in blocks.iter_mut().enumerate() {
            block.begin(b * block.directions());
        }
        let combined = vec![memory::zeros(size * blocks[0].directions())?; C::E.len()];
        let mut run = ControlledRun {
            blocks,
            count: mixture.count,
            tolerance,
            controller: StepController::new(tolerance),
            before: vec![0.0; size],
            after: vec![0.0; size],
            estimates: vec![vec![0.0; size]; C::E.len()],
            combined,
            probe_error: PROBE_ERROR,
            growth: 0.0,
            steps,
            times: Vec::new(),
        };
        run.controller.h = f64::INFINITY;
        run.reset_probe();
        Ok(run)
    }

    /// The index of the block of the probe, and the direction of the probe in this block.
    fn probe(&self) -> (usize, usize) {
        let own = self.blocks[0].directions();
        ((self.count - 1) / own, (self.count - 1) % own)
    }

    fn set_probe(&mut self, of: impl Fn(usize, f64) -> f64) {
        let (b, k) = self.probe();
        let block = &mut self.blocks[b];
        self.after.iter().enumerate().for_each(|(number, &x)| block.set_tangent(k, number, of(number, x)));
    }

    fn reset_probe(&mut self) {
        self.set_probe(|number, _| gaussian(SEED, number as u64, 0));
    }

    /// Limit the growth of the probe, whose values `before` and `after` the last step has computed. Then replace the probe `w` by `f_x w`,
    /// divided by its largest component.
    fn iterate_probe(&mut self, last_stage: usize) {
        self.growth = (self.growth + (magnitude(&self.after) / magnitude(&self.before)).ln()).max(0.0);
        if self.growth > PROBE_GROWTH.ln() {
            (self.growth, self.probe_error) = (0.0, (TIGHTER * self.probe_error).max(LEAST_ERROR));
        }
        let (b, k) = self.probe();
        self.blocks[b].slope(k, last_stage, &mut self.after);
        let largest = magnitude(&self.after);
        if largest > 0.0 {
            self.set_probe(|_, x| x / largest);
        } else {
            self.reset_probe();
        }
    }

    /// Return the largest error of the last step, of size `h`, divided by the allowed error.
    fn error<C: Scheme>(&mut self, h: f64) -> f64 {
        self.controller.tolerance = self.tolerance;
        self.blocks[0].state_change(C::E, [&mut self.before, &mut self.after], &mut self.estimates);
        let mut largest = C::error_within(&self.controller.tolerance, h, &self.before, &self.after, &self.estimates);
        if largest.is_nan() {
            return largest;
        }
        for (b, block) in self.blocks.iter().enumerate() {
            let first = b * block.directions();
            self.combined.iter_mut().zip(C::E).for_each(|(out, weights)| block.combined_slopes(weights, out));
            for k in 0..block.directions().min(self.count - first) {
                block.change(k, &self.combined, [&mut self.before, &mut self.after], &mut self.estimates);
                self.controller.tolerance = if first + k + 1 < self.count {
                    self.tolerance
                } else {
                    let floor = PROBE_FLOOR * magnitude(&self.after).max(f64::MIN_POSITIVE);
                    Tolerance { rtol: self.probe_error, atol: self.probe_error * floor, ..self.tolerance }
                };
                let error = C::error_within(&self.controller.tolerance, h, &self.before, &self.after, &self.estimates);
                if error.is_nan() {
                    return error;
                }
                largest = largest.max(error);
            }
        }
        largest
    }

    /// Compute the step of size `h` from `t` by controlled steps, and append the times between them to `times`.
    fn divide<C: Scheme>(&mut self, (t, h, end): (f64, f64, f64), mode: usize) -> Result<()> {
        self.controller.begin(t, t + h, end);
        while !self.controller.done() {
            self.controller.open();
            loop {
                let (from, left) = (self.controller.t, self.controller.t_end - self.controller.t);
                while let [_, next, _, ..] = self.steps
                    && *next <= from
                {
                    self.steps = &self.steps[1..];
                }
                if let [start, next, ..] = self.steps {
                    self.controller.h = self.controller.h.min(next - start);
                }
                // Steps of equal size, so that the last one is not much shorter than necessary.
                self.controller.h = left / (left / self.controller.h).ceil().max(1.0);
                let (h, to) = self.controller.propose().map_err(|status| unresolved(status, from))?;
                let end = if to < self.controller.t_end { to } else { end };
                for block in &mut self.blocks {
                    block.leave();
                    block.step((from, h, end), mode, None)?;
                }
                let error = self.error::<C>(h);
                if self.controller.judge(error, h, to, &C::CONTROL) {
                    break;
                }
                self.blocks.iter_mut().for_each(Forward::restore);
            }
            self.iterate_probe(C::STAGES);
            if !self.controller.done() {
                memory::append(&mut self.times, &[self.controller.t])?;
            }
        }
        Ok(())
    }
}

/// The largest magnitude of the numbers.
fn magnitude(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |most, x| most.max(x.abs()))
}

/// The error for tangents that no step resolves.
fn unresolved(status: Status, t: f64) -> Error {
    let problem = format!("the derivatives cannot be resolved at t = {t} s, where the loop's equations are not smooth: {}", status.name());
    Error::Solve { status, t, problem }
}
