//! The functions of time of a problem: forces that the caller supplies as functions, and tables of desired motions. Their time scales
//! limit the steps of a run.

use super::division::Division;
use crate::error::Result;
use crate::motion::{Motion, sample_all};
use crate::simulate::adaptive::segments::Segments;
use crate::simulate::problem::Problem;
use crate::simulate::problem::force::Force;
use crate::simulate::problem::time_scale::TimeScale;
use crate::simulate::stop::Stop;

impl Problem<'_> {
    /// Return the time scale of the force of run 0, if the force is a function. The result is `None` if the function stops the run, if the
    /// caller requests a stop, or if `max_step` is infinite.
    fn force_scale(&self, stop: &dyn Stop) -> Option<TimeScale> {
        let Some(Force::Signal(call)) = self.force(0) else { return None };
        if self.options.max_step == Some(f64::INFINITY) || !(self.options.t_end > 0.0) {
            return None;
        }
        TimeScale::of(self.options.t_end, 6, &mut |t, out: &mut [f64]| {
            let wrench = if stop.requested() { None } else { call(t) };
            wrench.is_some_and(|wrench| {
                out.copy_from_slice(&wrench);
                true
            })
        })
    }

    /// Return the time scale of the tables among the desired motions of run `run`. The result is `None` without tables, or if `max_step` is
    /// infinite. The other motions have their breaks, or do not rest between two movements.
    fn table_scale(&self, run: usize) -> Option<TimeScale> {
        let o = &self.options;
        let tables: Vec<&Motion> =
            self.law(run).motions().into_iter().filter(|motion| matches!(motion, Motion::Table(_) | Motion::Spline(_))).collect();
        if tables.is_empty() || o.max_step == Some(f64::INFINITY) || !(o.t_end > 0.0) {
            return None;
        }
        let width = tables.iter().map(|motion| 3 * motion.dof()).sum();
        TimeScale::of(o.t_end, width, &mut |t, out: &mut [f64]| {
            sample_all(tables.iter().copied(), t, out);
            true
        })
    }

    /// Return the segments of run `run`, whose desired motions differ from those of other runs, with steps limited by its tables.
    pub(in crate::simulate) fn limit_by_own_tables(&self, segments: Segments, run: usize) -> Segments {
        segments.scaled(if self.shares_exogenous() { None } else { self.table_scale(run) })
    }

    /// Return the time grid with steps limited by the tables that all runs share.
    pub(in crate::simulate) fn limit_by_shared_tables(&self, division: Division) -> Division {
        match division {
            Division::Adaptive(segments) if self.shares_exogenous() => Division::Adaptive(segments.scaled(self.table_scale(0))),
            division => division,
        }
    }

    /// Validate the problem of one run, and return its time grid. A force that is a function of time limits the steps of an adaptive
    /// method. Errors: those of [`Problem::validate`].
    pub(in crate::simulate) fn divide(&self, stop: &dyn Stop) -> Result<Division> {
        Ok(match self.limit_by_shared_tables(self.validate()?) {
            Division::Adaptive(segments) => {
                let scale = self.force_scale(stop);
                let segments = segments.with_breaks(scale.as_ref().map_or(&[][..], |scale| &scale.jumps[..]));
                Division::Adaptive(segments.scaled(scale))
            }
            fixed => fixed,
        })
    }

    /// Return start and end, s, of a change of the force that fixed steps are too long for. Only a function of time is checked.
    pub(in crate::simulate) fn unresolved_force(&self, division: &Division, stop: &dyn Stop) -> Option<[f64; 2]> {
        let (Division::Fixed(_), o) = (division, &self.options) else { return None };
        if !TimeScale::resolves(o.grid(), o.t_end) {
            return None;
        }
        self.force_scale(stop)?.block_within(o.grid()).map(<[f64; 2]>::from)
    }
}
