//! Derivatives of motions with respect to time: velocity, acceleration, jerk and snap. Elastic joints require jerk and snap for feed-forward.

use super::Motion;
use crate::error::{Error, Result, finite};
use crate::status::Status;
use nalgebra::DMatrix;

/// Number of results per joint of [`Motion::write_derivatives`]: position, velocity, acceleration, jerk and snap.
pub const DERIVATIVES: usize = 5;

impl Motion {
    /// Compute the position and its derivatives with respect to time up to `order`, at time `t`, s: `(order + 1, n)`. The derivatives are
    /// velocity, acceleration, jerk and snap.
    ///
    /// Where the jerk or the snap jumps, the result is the value after the jump. They jump at the ends of a quintic, and at the knots of a
    /// table or spline. In a timed path they jump at its knots and grid points. At such a time, the snap does not contain the impulse of a jump of the jerk. At the
    /// end of a table or path, the result is that of its last interval. A spline that stops at its last knot rests from there on. Before the
    /// start and after the end, all derivatives are zero.
    ///
    /// Errors: `Input` for a time that is not finite. Also as for [`Motion::require_derivatives`].
    ///
    /// ```
    /// use armlet_core::motion::{BangBang, Motion, Quintic};
    /// use nalgebra::dvector;
    ///
    /// let quintic = Motion::from(Quintic::new(dvector![0.0], dvector![1.0], 1.0)?);
    /// // s = 10 t^3 - 15 t^4 + 6 t^5
    /// assert_eq!(quintic.derivatives(0.5, 4)?.as_slice(), [0.5, 1.875, 0.0, -30.0, 0.0]);
    /// let fastest = Motion::from(BangBang::new(dvector![0.0], dvector![1.0], 1.0)?);
    /// assert!(fastest.derivatives(0.5, 2).is_ok() && fastest.derivatives(0.5, 3).is_err());
    /// # Ok::<(), armlet_core::error::Error>(())
    /// ```
    pub fn derivatives(&self, t: f64, order: usize) -> Result<DMatrix<f64>> {
        finite("t", &[t])?;
        self.require_derivatives(order)?;
        let mut all = vec![0.0; DERIVATIVES * self.dof()];
        self.write_derivatives(t, &mut all);
        Ok(DMatrix::from_row_slice(order + 1, self.dof(), &all[..(order + 1) * self.dof()]))
    }

    /// Write the position and its four derivatives at time `t`, s, to `out`, `(5 n,)`, without a check of time and order. The third and the
    /// fourth derivative of an acceleration are not written.
    pub fn write_derivatives(&self, t: f64, out: &mut [f64]) {
        self.evaluate::<DERIVATIVES, 0>(t, out);
    }

    /// The highest order of a derivative that has a value at every time: 4, or 2 if the acceleration jumps between start and end.
    pub fn highest_order(&self) -> usize {
        match self {
            Motion::BangBang(_) | Motion::Acceleration(_) => 2,
            Motion::Spline(spline) if !spline.is_smooth() => 2,
            Motion::TimedPath(path) if path.inner_jumps().next().is_some() => 2,
            _ => DERIVATIVES - 1,
        }
    }

    /// Check that the motion has derivatives up to `order` at every time. Errors: `Input` for an order above [`Motion::highest_order`], and
    /// `Solve` for a path that has no timing.
    pub fn require_derivatives(&self, order: usize) -> Result<()> {
        let highest = self.highest_order();
        if order > highest {
            let why = match self {
                Motion::Acceleration(_) => " for an acceleration",
                _ if highest == 2 => " for a motion whose acceleration jumps",
                _ => "",
            };
            return Err(Error::input("order", format!("is too high: expected at most {highest}{why}, got {order}")));
        }
        match self {
            Motion::TimedPath(path) if path.duration().is_nan() => {
                Err(Error::Solve { status: Status::Infeasible, t: 0.0, problem: "the path has no timing".into() })
            }
            _ => Ok(()),
        }
    }
}
