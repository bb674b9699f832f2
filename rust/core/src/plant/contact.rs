//! A wall that pushes back: a frame at depth `d = n . (p_wall - p) > 0` feels `f = n max(0, k d + c d_dot)`, and nothing
//! outside. Unilateral: the wall never pulls.

use crate::error::{Error, Result, finite, positive};
use crate::scalar::Real;
use crate::spatial::V3;

#[derive(Clone, Debug, PartialEq)]
pub struct Wall {
    /// The frame that touches it.
    pub frame: usize,
    /// A point of the surface, world axes, m.
    pub point: [f64; 3],
    /// Unit normal, out of the wall.
    pub normal: [f64; 3],
    /// N/m
    pub stiffness: f64,
    /// N s/m
    pub damping: f64,
}

impl Wall {
    pub fn new(frame: usize, point: [f64; 3], normal: [f64; 3], stiffness: f64, damping: f64) -> Result<Self> {
        finite("point", &point)?;
        finite("normal", &normal)?;
        positive("stiffness", stiffness)?;
        if !(damping >= 0.0 && damping.is_finite()) {
            return Err(Error::input("damping", format!("is negative or not finite: expected a number >= 0, got {damping}")));
        }
        let length = V3(normal).norm();
        if !(length > 0.0 && length.is_finite()) {
            return Err(Error::input("normal", format!("has no direction: expected a vector of length > 0, got {normal:?}")));
        }
        Ok(Wall { frame, point, normal: normal.map(|x| x / length), stiffness, damping })
    }

    /// Depth of a point `p` below the surface, m; negative outside.
    #[inline(always)]
    pub fn depth<S: Real>(&self, p: V3<S>) -> S {
        let n = V3(self.normal).lift::<S>();
        n.dot(V3(self.point).lift::<S>() - p)
    }

    /// The force on a frame at `p` that moves at `p_dot`, and the power lost in the wall.
    #[inline(always)]
    pub fn force<S: Real>(&self, p: V3<S>, p_dot: V3<S>) -> (V3<S>, S) {
        let n = V3(self.normal).lift::<S>();
        let (depth, rate) = (self.depth(p), -n.dot(p_dot));
        let spring = S::splat(self.stiffness) * depth;
        let push = S::splat(self.damping).mul_add(rate, spring);
        let touching = S::zero().lt(depth);
        let pushing = S::zero().lt(push);
        let push = S::select(touching, S::select(pushing, push, S::zero()), S::zero());
        let stored = S::select(touching, spring, S::zero());
        // What enters the wall's spring is stored; the rest is lost: (f - k d) d_dot.
        (n.scale(push), (push - stored) * rate)
    }

    /// Energy stored in the wall.
    pub fn energy(&self, p: [f64; 3]) -> f64 {
        let depth = self.depth(V3(p)).max(0.0);
        0.5 * self.stiffness * depth * depth
    }
}
