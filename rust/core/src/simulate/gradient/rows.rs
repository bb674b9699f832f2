//! Derivatives of the runs of a batch. A *row* is one run of the batch. Threads compute different rows. A row has the same bits as a single
//! run. Rows with the same plants, laws and forces share a loop, and loops with the same structure share their recorded functions.

use super::controlled_steps::completed;
use super::parameters::{Parameter, Parameters};
use super::prepared::{Loop, Prepared};
use super::structure::FunctionStore;
use super::{backward, forward, record_parts};
use crate::error::{Error, Result};
use crate::interrupt::{Interrupted, interrupt};
use crate::memory;
use crate::parallel;
use crate::simulate::problem::Problem;
use crate::simulate::problem::times::Times;
use crate::trace::cache::Cache;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};

/// The runs to be differentiated: run 0 of each problem, with its parameters.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// # use nalgebra::dvector;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 2.0)?, Gain::not_negative("kd", vec![0.0])?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{Options, Problem, Rows, Times, sensitivities_of_rows};
/// # let stiffer = LawSpec::from(PdGravitySpec::new(model, vec![0.0], Gain::scalar("kp", 1, 3.0)?, Gain::not_negative("kd", vec![0.0])?)?);
/// # let options = Options { times: Times::At(vec![1.0]), monitors: false, ..Options::fixed(1.0, 0.01) };
/// # let mut problem = Problem::from_rest(&plant, &law, &dvector![1.0], options)?;
///
/// // Two rows, from 1 rad and from 2 rad. Each row has a run with kp and a run with kp + 1.
/// problem.laws = vec![&law, &stiffer, &law, &stiffer];
/// problem.x0 = vec![1.0, 0.0, 1.0, 0.0, 2.0, 0.0, 2.0, 0.0];
/// let parameters = [vec![vec![(0, -1.0), (1, 1.0)]], vec![vec![(0, -1.0), (1, 1.0)]]];
/// let rows = Rows::of(&problem, &parameters, &[1])?;
/// let q = &sensitivities_of_rows(&rows, 1, &mut || false)?[0];
/// // q = q0 cos(sqrt(kp / 2) t), with kp = 2 and t = 1 s.
/// assert!((q[0] + 1f64.sin() / 4.0).abs() < 1e-8 && (q[1] + 1f64.sin() / 2.0).abs() < 1e-8);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct Rows<'a> {
    problems: Vec<Problem<'a>>,
    parameters: &'a [Vec<Parameter>],
    sizes: &'a [usize],
}

/// Return the `each` elements of the list `all` for row `row`. A list with one element applies to all rows.
fn part<T: Clone>(all: &[T], row: usize, each: usize) -> Vec<T> {
    if all.len() == 1 { all.to_vec() } else { all.get(row * each..(row + 1) * each).unwrap_or(&[]).to_vec() }
}

impl<'a> Rows<'a> {
    /// Divide a problem into rows with the same number of runs. The problem has one plant or one per run, and one law or one per run. It
    /// has no force, one force, or one per row. `parameters` has one list per row, whose run numbers count from the first run of the row.
    /// `sizes` lists the number of parameters of each name. Errors: [`Error::WrongShape`] for another number of plants, laws or forces.
    pub fn of(problem: &Problem<'a>, parameters: &'a [Vec<Parameter>], sizes: &'a [usize]) -> Result<Self> {
        let (rows, runs) = (parameters.len(), problem.runs());
        let width = runs.checked_div(rows).unwrap_or(0);
        for (argument, count) in [("plant", problem.plants.len()), ("law", problem.laws.len())] {
            if count != 1 && count != runs {
                return Err(Error::wrong(argument, "number of entries", runs, count));
            }
        }
        if problem.forces.len() > 1 && problem.forces.len() != rows {
            return Err(Error::wrong("force", "number of entries", rows, problem.forces.len()));
        }
        let states = width * problem.plant(0).states();
        let row = |r: usize| {
            let mut options = problem.options.clone();
            if let Some(sampling) = &mut options.sampling {
                sampling.seed = sampling.seed.wrapping_add(r as u64);
            }
            Problem {
                plants: part(&problem.plants, r, width),
                laws: part(&problem.laws, r, width),
                x0: problem.x0[r * states..(r + 1) * states].to_vec(),
                forces: part(&problem.forces, r, 1),
                force_frame: problem.force_frame,
                options,
                measures: None,
            }
        };
        Ok(Rows { problems: memory::collected((0..rows).map(row))?, parameters, sizes })
    }

    /// Whether two rows have the same plants, laws and forces.
    fn is_same_loop(&self, a: usize, b: usize) -> bool {
        let (one, other) = (&self.problems[a], &self.problems[b]);
        let plants = one.plants.iter().zip(&other.plants).all(|(a, b)| std::ptr::eq(*a, *b));
        let laws = one.laws.iter().zip(&other.laws).all(|(a, b)| std::ptr::eq(*a, *b));
        plants && laws && one.forces.iter().zip(&other.forces).all(|(a, b)| std::ptr::eq(*a, *b))
    }

    fn parameters(&self, row: usize) -> Parameters<'_> {
        Parameters { all: &self.parameters[row], sizes: self.sizes, shared: &[] }
    }

    /// Call `work` with each row and its part of the output. A row without a derivative (the error `Solve`) is NaN.
    fn each<'b, T: Fill + Send>(
        &'b self,
        threads: usize,
        poll: &mut dyn FnMut() -> bool,
        outs: Vec<T>,
        work: impl Fn(&Prepared<'b>, usize, &mut T) -> Result<()> + Sync,
    ) -> Result<()> {
        let known = KnownLoops::default();
        let row = |(r, mut out): (usize, T)| -> Result<()> {
            self.problems[r].validate()?;
            match known.prepare(self, r).and_then(|prepared| work(&prepared, r, &mut out)) {
                Err(Error::Solve { .. }) => {
                    out.fill_nan();
                    Ok(())
                }
                other => other,
            }
        };
        match parallel::pieces(threads, poll, outs.into_iter().enumerate().collect(), row) {
            Ok(rows) => rows.into_iter().collect(),
            Err(Interrupted) => interrupt(),
        }
    }
}

/// The loop of the rows that have the same plants, laws and forces as row `row`.
struct KnownLoop<'b> {
    row: usize,
    /// The loop, made for the first row that requires it. Other threads wait for it.
    made: OnceLock<Result<Loop<'b>>>,
}

/// The loops of the rows that were computed last, and the recorded functions of these loops.
#[derive(Default)]
pub(super) struct KnownLoops<'b> {
    loops: Cache<Arc<KnownLoop<'b>>>,
    functions: FunctionStore,
}

impl<'b> KnownLoops<'b> {
    /// Prepare row `r`.
    pub(super) fn prepare(&self, rows: &'b Rows, r: usize) -> Result<Prepared<'b>> {
        let (problem, parameters) = (&rows.problems[r], rows.parameters(r));
        let new = || Arc::new(KnownLoop { row: r, made: OnceLock::new() });
        let known = self.loops.find_or_store(|known| rows.is_same_loop(known.row, r), new, |_| true);
        let own = known.made.get_or_init(|| Loop::of(problem, parameters)).as_ref().map_err(Clone::clone)?;
        completed(own.prepare(problem, parameters, &self.functions, &AtomicBool::new(false))?, parameters.all)
    }
}

/// The output of a row.
trait Fill {
    fn fill_nan(&mut self);
}

impl Fill for Vec<&mut [f64]> {
    fn fill_nan(&mut self) {
        self.iter_mut().for_each(|part| part.fill(f64::NAN));
    }
}

impl Fill for &mut [f64] {
    fn fill_nan(&mut self) {
        self.fill(f64::NAN);
    }
}

/// Return the derivatives of the records of each row, at the times of the options. Each part that [`record_parts`] names has an array of
/// shape `(rows, records, numbers, parameters)`. The numbers of a row are NaN where [`super::sensitivities`] has the error `Solve`, such as
/// for a run that ends early. Errors: `Input` for a parameter, method, law or plant without a derivative, `Memory` if the result exceeds
/// the memory.
pub fn sensitivities_of_rows(rows: &Rows, threads: usize, poll: &mut dyn FnMut() -> bool) -> Result<Vec<Vec<f64>>> {
    let Some(first) = rows.problems.first() else { return Ok(Vec::new()) };
    let (parts, records, count) = (record_parts(first).0, records(first), rows.parameters(0).all.len());
    let sizes: Vec<usize> = parts.iter().map(|(_, range)| records.saturating_mul(range.len()).saturating_mul(count)).collect();
    let mut all: Vec<Vec<f64>> = sizes.iter().map(|size| memory::zeros(size.saturating_mul(rows.problems.len()))).collect::<Result<_>>()?;
    let mut outs: Vec<Vec<&mut [f64]>> = rows.problems.iter().map(|_| Vec::with_capacity(parts.len())).collect();
    for (values, &size) in all.iter_mut().zip(&sizes) {
        outs.iter_mut().zip(values.chunks_exact_mut(size.max(1))).for_each(|(out, row)| out.push(row));
    }
    rows.each(threads, poll, outs, |prepared, _, out| {
        let ranges = parts.iter().map(|(_, range)| range.clone());
        let mut series = super::Series::zeros(ranges, records, count)?;
        forward::run(prepared, &mut series)?;
        out.iter_mut().zip(series.into_rates()).for_each(|(to, from)| to.copy_from_slice(&from));
        Ok(())
    })?;
    Ok(all)
}

/// Return [`super::adjoint`] of each row, shape `(rows, parameters)`. `weights` has shape `(rows, records, numbers)`. Each thread stores
/// about `memory` bytes of states. NaN and errors: as for [`sensitivities_of_rows`].
pub fn adjoint_of_rows(rows: &Rows, weights: &[f64], memory: usize, threads: usize, poll: &mut dyn FnMut() -> bool) -> Result<Vec<f64>> {
    let Some(first) = rows.problems.first() else { return Ok(Vec::new()) };
    let (width, count) = (records(first) * record_parts(first).1, rows.parameters(0).all.len());
    let mut all = memory::zeros(count.saturating_mul(rows.problems.len()))?;
    let outs = all.chunks_exact_mut(count.max(1)).collect();
    rows.each(threads, poll, outs, |prepared, r, out: &mut &mut [f64]| {
        out.copy_from_slice(&backward::run(prepared, &weights[r * width..(r + 1) * width], memory)?);
        Ok(())
    })?;
    Ok(all)
}

fn records(problem: &Problem) -> usize {
    if let Times::At(times) = &problem.options.times { times.len() } else { 0 }
}
