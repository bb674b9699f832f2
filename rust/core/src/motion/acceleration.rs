//! The acceleration of a motion, as a motion: its velocity is the jerk of the other motion, and its acceleration is the snap.

use super::{Motion, Side};
use crate::error::{Error, Result};
use std::sync::Arc;

impl Motion {
    /// The acceleration of `motion` as a motion. Its velocity is the jerk of `motion`, and its acceleration is the snap.
    ///
    /// Errors: `Input` for a motion without jerk and snap ([`Motion::highest_order`]). `Solve` for a path that has no timing.
    ///
    /// ```
    /// use armlet_core::motion::{BangBang, Motion, Quintic};
    ///
    /// let quintic = Motion::from(Quintic::new(vec![0.0], vec![1.0], 1.0)?);
    /// let acceleration = Motion::acceleration_of(&quintic)?;
    /// let (all, at) = (quintic.derivatives(0.25, 4)?, acceleration.at(0.25));
    /// assert_eq!([at.q[0], at.v[0], at.a[0]], [all[2], all[3], all[4]]);
    /// assert!(Motion::acceleration_of(&BangBang::new(vec![0.0], vec![1.0], 1.0)?.into()).is_err());
    /// # Ok::<(), armlet_core::error::Error>(())
    /// ```
    pub fn acceleration_of(motion: &Motion) -> Result<Motion> {
        motion.require_derivatives(4).map_err(|error| match error {
            Error::Input { .. } => {
                Error::input("motion", "has no jerk and snap: expected a motion with four derivatives, got one whose acceleration jumps")
            }
            other => other,
        })?;
        Ok(if let Motion::Hold(q) = motion { Motion::Hold(vec![0.0; q.len()]) } else { Motion::Acceleration(Arc::new(motion.clone())) })
    }

    /// Write acceleration, jerk and snap at time `t`, s, to `out`, `(3, n)`.
    #[inline(never)]
    pub(super) fn write_acceleration(&self, t: f64, out: &mut [f64]) {
        self.evaluate::<5, 2>(t, out);
    }

    /// Write acceleration, jerk and snap at time `t`, s, to `out`, `(3, n)`. They are smooth functions of the motion's numbers near those of
    /// `base`. At a knot, jerk and snap are those of the same side as in [`Motion::write_acceleration`].
    pub(super) fn write_acceleration_with(&self, base: &Motion, t: f64, out: &mut [f64]) {
        match (self, base) {
            (Motion::Table(table), Motion::Table(base)) => table.evaluate_with::<5, 2>(base, t, Side::Moving, out),
            (Motion::Spline(spline), Motion::Spline(base)) => spline.evaluate_with::<5, 2>(base, t, Side::Moving, out),
            _ => self.write_acceleration(t, out),
        }
    }

    /// Times, s, at which jerk or snap jump. They increase.
    pub(super) fn jerk_jumps(&self) -> Vec<f64> {
        match self {
            Motion::Table(table) => table.knot_times(),
            Motion::Spline(spline) => spline.path().knots().to_vec(),
            Motion::TimedPath(path) => path.times().to_vec(),
            _ => self.breaks(),
        }
    }
}
