//! A compliant wall with the outward unit normal `n`. At the depth `d = n . (p_wall - p) > 0`, the force `f = n max(0, k d + c d_dot)` acts
//! on a frame at `p`. Outside there is no force. The wall never pulls.

use super::unilateral::{Mode, pressing, push, require_spring, stored};
use crate::error::{Error, Result, finite};
use crate::scalar::Real;
use crate::spatial::{Lift, Vector, Vector3, unit_vector};
use crate::trace::E;

/// A compliant wall that a frame may touch.
///
/// ```
/// use armlet_core::plant::Wall;
/// use armlet_core::spatial::Vector3;
///
/// // A wall at x = 0.8 m for the frame with the index 1. The arm is on the side with smaller x.
/// let wall = Wall::new(1, [0.8, 0.0, 0.0], [-2.0, 0.0, 0.0], 1e4, 50.0)?;
/// assert_eq!(wall.normal, [-1.0, 0.0, 0.0]);
/// assert!((wall.depth(Vector3::new(0.82, 0.3, 0.0)) - 0.02f64).abs() < 1e-15);
/// assert!(Wall::new(1, [0.8, 0.0, 0.0], [-1.0, 0.0, 0.0], 0.0, 50.0).is_err());
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Wall {
    /// Index of the frame that may touch the wall.
    pub frame: usize,
    /// A point of the wall's surface, world axes, m.
    pub point: [f64; 3],
    /// Unit normal that points out of the wall, `(3,)`, world axes.
    pub normal: [f64; 3],
    /// Stiffness `k`, N/m.
    pub stiffness: f64,
    /// Damping `c`, N s/m.
    pub damping: f64,
}

impl Wall {
    /// Create a wall through `point` with the outward `normal`, which need not be a unit vector. `stiffness` is in N/m, `damping` in N s/m.
    ///
    /// Errors: `Input` for a `normal` of length zero, a stiffness that is not positive, a negative damping, or numbers that are not finite.
    pub fn new(frame: usize, point: [f64; 3], normal: [f64; 3], stiffness: f64, damping: f64) -> Result<Self> {
        finite("point", &point)?;
        finite("normal", &normal)?;
        require_spring(stiffness, damping)?;
        let Some(normal) = unit_vector(normal) else {
            return Err(Error::input("normal", format!("has no direction: expected a vector of length > 0, got {normal:?}")));
        };
        Ok(Wall { frame, point, normal, stiffness, damping })
    }

    /// Depth of a point `p` below the surface, m; negative outside.
    pub fn depth<S: Real>(&self, p: Vector3<S>) -> S {
        let n = Vector3::from(self.normal).lift::<S>();
        n.dot(Vector3::from(self.point).lift::<S>() - p)
    }
}

/// The wall of a plant in a control loop.
pub struct LoopWall {
    /// Index of the frame.
    pub frame: usize,
    point: Vector3<E>,
    normal: Vector3<E>,
    stiffness: E,
    damping: E,
}

impl LoopWall {
    /// Create the wall of a loop.
    pub fn new(wall: &Wall) -> Self {
        LoopWall {
            frame: wall.frame,
            point: Vector3::from(wall.point.map(E::varying)),
            normal: Vector3::from(wall.normal.map(E::varying)),
            stiffness: E::labelled("wall_stiffness", 0, || E::varying(wall.stiffness)),
            damping: E::labelled("wall_damping", 0, || E::varying(wall.damping)),
        }
    }

    /// Energy stored in the wall, J, with the frame at `p`.
    pub fn energy(&self, p: Vector3<E>) -> E {
        stored(self.stiffness, self.normal.dot(self.point - p))
    }

    /// The depth `d`, m, and its rate `d_dot`, m/s, for the frame at `p` with the velocity `p_dot`.
    fn depth(&self, p: Vector3<E>, p_dot: Vector3<E>) -> (E, E) {
        (self.normal.dot(self.point - p), -self.normal.dot(p_dot))
    }

    /// The depth `d`, m, and the push `k d + c d_dot`, N, for the frame at `p` with the velocity `p_dot`.
    pub fn contact(&self, p: Vector3<E>, p_dot: Vector3<E>) -> [E; 2] {
        let (depth, rate) = self.depth(p, p_dot);
        [depth, pressing(self.stiffness, self.damping, depth, rate)]
    }

    /// The force on the frame at `p` with the velocity `p_dot`, N, and the power lost in the wall, W. `held` is the mode of the contact
    /// (see [`push`]).
    pub fn force(&self, p: Vector3<E>, p_dot: Vector3<E>, held: Option<Mode<E>>) -> (Vector3<E>, E) {
        let (depth, rate) = self.depth(p, p_dot);
        let (force, lost) = push(self.stiffness, self.damping, depth, rate, held);
        (self.normal.scale(force), lost)
    }
}
