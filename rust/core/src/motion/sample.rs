//! Conversions of all kinds of motions to [`Motion`], and the values of a motion at one time as nalgebra vectors.

use super::{BangBang, Motion, Quintic, Sinusoid, Spline, Table, TimedPath};
use nalgebra::DVector;

/// Position, velocity and acceleration of a motion at one time, `(n,)` each.
///
/// ```
/// use armlet_core::motion::{Motion, MotionSample, Quintic};
/// use nalgebra::dvector;
///
/// let motion = Motion::from(Quintic::new(dvector![0.0], dvector![1.0], 2.0)?);
/// // In the middle, the speed is 15/8 of the mean speed.
/// let MotionSample { q, v, a } = motion.at(1.0);
/// assert_eq!((q[0], v[0], a[0]), (0.5, 15.0 / 16.0, 0.0));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct MotionSample {
    /// Position `q_d`, `(n,)`, rad or m.
    pub q: DVector<f64>,
    /// Velocity `v_d`, `(n,)`, rad/s or m/s.
    pub v: DVector<f64>,
    /// Acceleration `a_d`, `(n,)`, rad/s^2 or m/s^2.
    pub a: DVector<f64>,
}

impl Motion {
    /// The values `q_d`, `v_d` and `a_d` at time `t`, s.
    ///
    /// ```
    /// use armlet_core::motion::{BangBang, Motion, Quintic};
    /// use nalgebra::dvector;
    ///
    /// let quintic = Motion::from(Quintic::new(dvector![0.0, 1.0], dvector![2.0, 1.0], 4.0)?);
    /// let middle = quintic.at(2.0);
    /// assert_eq!(middle.q, dvector![1.0, 1.0]);
    /// assert_eq!(middle.a, dvector![0.0, 0.0]);
    /// let fastest = Motion::from(BangBang::new(dvector![0.0], dvector![1.0], 2.0)?);
    /// assert_eq!(fastest.at(0.0).a, dvector![1.0]);
    /// assert_eq!(Motion::hold(dvector![0.5])?.at(7.0).v, dvector![0.0]);
    /// # Ok::<(), armlet_core::error::Error>(())
    /// ```
    pub fn at(&self, t: f64) -> MotionSample {
        let n = self.dof();
        let mut values = vec![0.0; 3 * n];
        self.sample(t, &mut values);
        let [q, v, a] = [0, 1, 2].map(|k| DVector::from_column_slice(&values[k * n..(k + 1) * n]));
        MotionSample { q, v, a }
    }
}

macro_rules! convert {
    ($($kind:ident)*) => {
        $(impl From<$kind> for Motion {
            fn from(motion: $kind) -> Self {
                Motion::$kind(motion)
            }
        })*
    };
}

convert!(Sinusoid Quintic BangBang Table Spline TimedPath);
