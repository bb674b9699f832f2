//! The origin `p` of a frame along a path `q(s)`, and the limits of its speed and acceleration. `'` is `d/ds`, and `r = ds/dt`, `x = r^2`,
//! `u = d^2 s/dt^2`:
//!
//! ```text
//! p' = dp/ds = J q',   p'' = J q'' + (dJ/ds) q'         J: the Jacobian of the origin
//! velocity = p' r,   |p'| r <= V                        an upper bound of the path speed r
//! acceleration = p' u + p'' x,   |p' u + p'' x| <= A      a convex set in the plane of u and x
//! ```
//!
//! `V` is the limit of the speed, and `A` the limit of the acceleration. At a point of a segment the acceleration is `a u + b x + m`. Let
//! `c` and `d` be the parts of `b` and `m` perpendicular to `a`. The limit `A` gives an upper and a lower bound of `u` at each `x`:
//!
//! ```text
//! u = -a.(b x + m) / |a|^2 +- sqrt(A^2 - |c x + d|^2) / |a|
//! ```
//!
//! The upper bound is a concave function of `x`, the lower bound a convex one. So Newton's method in `lines` can use their tangents as
//! lines.

use super::mover::Mover;
use super::tuning::{FAR, FASTEST, NONE, STEEP};
use crate::dynamics::{Quantity, Query};
use nalgebra::Vector3;

/// Limits of the origin of a frame. Each limit is `(1,)`, or `(P + 1,)`: one value per knot of the path, and linear in `s` between knots.
///
/// ```
/// use armlet_core::plan::{Mover, PathLimits, TimePathOptions, TipLimits, time_path};
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Functions;
/// # use armlet_core::motion::{Ends, Path};
/// # use std::sync::Arc;
///
/// # let arm = Functions::new(Arc::new(Arm::planar(&[2.0], None, None, None, [0.0, 0.0])?));
/// # let path = Arc::new(Path::waypoints(&[0.0, 1.0], 1, None, Ends::Natural)?.0);
/// // The tip is 2 m from the axis, so 1 m/s is 0.5 rad/s: T = 1/0.5 + 0.5/4.
/// let tip = TipLimits { frame: 0, speed: Some(vec![1.0]), acceleration: None };
/// let limits = PathLimits { acceleration: Some(vec![4.0]), tip: Some(tip), ..PathLimits::default() };
/// let plan = time_path(Mover::Tree(&arm), path, &limits, &TimePathOptions::default())?;
/// assert!((plan.motion.duration() - 2.125).abs() < 1e-9);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct TipLimits {
    /// Index of the frame.
    pub frame: usize,
    /// Largest speed, m/s.
    pub speed: Option<Vec<f64>>,
    /// Largest acceleration, m/s^2.
    pub acceleration: Option<Vec<f64>>,
}

/// Tip limits in the form that the planner uses. A limit that varies along the path is replaced by 1, and the motion of the frame is
/// divided by the limit.
#[derive(Clone, Debug)]
pub(super) struct Tip {
    pub frame: usize,
    pub speed: Option<f64>,
    pub acceleration: Option<f64>,
}

/// Numbers per point: three components of the acceleration, then three of the velocity.
pub(super) const TIP: usize = 6;

/// The interval of `u` that satisfies the limit of acceleration at one point of a segment.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ball {
    /// The path acceleration `u` with the smallest acceleration of the frame is `middle[0] + middle[1] x`.
    middle: [f64; 2],
    /// The vectors `c` and `d`: the parts of `b` and `m` perpendicular to `a`, in the acceleration `a u + b x + m`.
    across: [Vector3<f64>; 2],
    /// The reduced limit `A` of the norm of the frame's acceleration, m/s^2. If the limit varies along the path, `A` is a fraction of this
    /// limit.
    radius: f64,
    /// `1 / |a|`; zero if `a = 0`, so that `u` does not accelerate the frame's origin.
    by: f64,
}

/// A bound of `u`: its value at one `x`, and its tangent `intercept + slope x` at this `x`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tangent {
    pub value: f64,
    pub intercept: f64,
    pub slope: f64,
}

impl Ball {
    /// Create the set of all `(u, x)` with `|a u + b x + m| <= radius`.
    pub fn new([a, b, m]: [Vector3<f64>; 3], radius: f64) -> Self {
        let size = a.norm();
        if size < NONE {
            return Ball { middle: [0.0; 2], across: [b, m], radius, by: 0.0 };
        }
        let along = a / size;
        let middle = [-along.dot(&m) / size, -along.dot(&b) / size];
        Ball { middle, across: [b - along * along.dot(&b), m - along * along.dot(&m)], radius, by: 1.0 / size }
    }

    /// The interval of `x` for which a feasible `u` exists.
    pub fn range(&self) -> (f64, f64) {
        let [c, d] = self.across;
        let (cc, cd, left) = (c.norm_squared(), c.dot(&d), self.radius * self.radius - d.norm_squared());
        if !(self.radius > 0.0) || left < 0.0 && cc == 0.0 {
            return (FASTEST, 0.0);
        }
        let root = cd * cd + cc * left;
        if root < 0.0 {
            return (FASTEST, 0.0);
        }
        let root = root.sqrt();
        // Compute each root in the form without cancellation.
        let (far, near) = if cd > 0.0 { (left / (cd + root), -(cd + root) / cc) } else { ((root - cd) / cc, -left / (root - cd)) };
        let usable = |x: f64, other: f64| if x.is_nan() { other } else { x };
        (usable(near, 0.0).max(0.0), usable(far, FASTEST).min(FASTEST))
    }

    /// The tangents at `x` of the upper and of the lower bound of `u`.
    #[inline(always)]
    pub fn tangents(&self, x: f64) -> [Tangent; 2] {
        if self.by == 0.0 {
            return [FAR, -FAR].map(|value| Tangent { value, intercept: value, slope: 0.0 });
        }
        let [c, d] = self.across;
        let here = c * x + d;
        let size = here.norm();
        let left = (self.radius - size) * (self.radius + size);
        let half = left.max(0.0).sqrt();
        let steep = left.max(STEEP * self.radius * self.radius).sqrt();
        let fall = c.dot(&here) / steep;
        [1.0, -1.0].map(|side| {
            let value = self.middle[0] + self.middle[1] * x + side * half * self.by;
            let slope = self.middle[1] - side * fall * self.by;
            Tangent { value, intercept: value - slope * x, slope }
        })
    }
}

/// Compute acceleration and velocity of the frame's origin at `count` points. `points` has `q, v, a`, `(count, n)` each. The six numbers of
/// point `k` are written to `out` from index `k * stride` on.
pub(super) fn motion(mover: Mover, frame: usize, points: [&[f64]; 3], count: usize, stride: usize, out: &mut [f64]) {
    let n = mover.dof();
    let [q, v, a] = points;
    let of = |quantity: Quantity, inputs: &[&[f64]]| {
        let query = Query { frame, ..Query::from(quantity) };
        let mut matrices = vec![0.0; count * 6 * n];
        mover.matrices(&query, inputs, count, &mut matrices);
        matrices
    };
    let jacobians = of(Quantity::Jacobian, &[q]);
    let changes = of(Quantity::JacobianDot, &[q, v]);
    for k in 0..count {
        let out = &mut out[k * stride..k * stride + TIP];
        let (v, a) = (&v[k * n..(k + 1) * n], &a[k * n..(k + 1) * n]);
        for axis in 0..3 {
            let at = (k * 6 + axis) * n;
            let (row, change) = (&jacobians[at..at + n], &changes[at..at + n]);
            out[axis] = (0..n).map(|j| row[j] * a[j] + change[j] * v[j]).sum();
            out[3 + axis] = (0..n).map(|j| row[j] * v[j]).sum();
        }
    }
}

/// The Euclidean norm of the first three numbers.
pub(super) fn length(values: &[f64]) -> f64 {
    Vector3::new(values[0], values[1], values[2]).norm()
}
