//! A task on the distance between two solids, which are spheres and capsules (the points within a radius of a line segment). The distance is
//! `d = |r| - r_a - r_b` with `r = p_a - p_b`. `p_a` and `p_b` are the nearest points of both axes, and `r_a` and `r_b` the radii. With
//! `n = r/|r|`, the Jacobian is `n'(J_a - J_b)`, where `J_a` and `J_b` are the linear Jacobians of the bodies at these points.
//!
//! The nearest points of two capsules jump where their axes are parallel. So two capsules have five rows. Each of the four ends of the axes
//! has one, with the nearest point of the other axis. The last row has the nearest points of both axes. The smallest row is the distance.
//! The first four rows do not jump. Where the last one jumps, it is a mean of two of them, so that it changes no solution.
//!
//! A point `p = start + s along` of an axis has the place `s`. The nearest points are `r' along_a = 0` and `r' along_b = 0`, unless the place
//! is at an end, 0 or 1. The time derivatives of these equations are the rates of the places, which the rate of the Jacobian needs.

use super::TaskFunction;
use super::kind::{TaskKind, frame_of};
use crate::arm::{Arm, Tree};
use crate::error::{Error, Result, finite};
use crate::kinematics::Bodies;
use crate::kinematics::bodies::Moving;
use crate::scalar::Real;
use crate::spatial::{Matrix, Vector, Vector3};

/// A relative squared sine of the angle between two axes below which they count as parallel.
const PARALLEL: f64 = 1e-12;

/// A sphere or a capsule.
///
/// ```
/// use armlet_core::kinematics::task::Solid;
///
/// let ball = Solid { frame: None, points: vec![[0.4, 0.0, 0.2]], radius: 0.1 };
/// let link = Solid { frame: Some(1), points: vec![[0.0, 0.0, 0.0], [-0.4, 0.0, 0.0]], radius: 0.05 };
/// assert!(!ball.is_capsule() && link.is_capsule());
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    /// Index of the frame to which it is fixed; `None` for the world.
    pub frame: Option<usize>,
    /// The centre of a sphere, or the two ends of the axis of a capsule, in the axes of the frame, m.
    pub points: Vec<[f64; 3]>,
    /// The radius, m.
    pub radius: f64,
}

impl Solid {
    /// Whether the solid is a capsule.
    pub fn is_capsule(&self) -> bool {
        self.points.len() > 1
    }

    fn check(&self, [points, radius]: [&str; 2]) -> Result<()> {
        self.points.iter().try_for_each(|point| finite(points, point))?;
        if ![1, 2].contains(&self.points.len()) {
            return Err(Error::input(points, format!("is not a centre or two ends: expected 1 or 2 points, got {}", self.points.len())));
        }
        if self.is_capsule() && self.points[0] == self.points[1] {
            return Err(Error::input(points, "has two equal ends: expected two different points, or one for a sphere"));
        }
        if !(self.radius >= 0.0 && self.radius.is_finite()) {
            return Err(Error::input(radius, format!("is not a radius: expected a finite number >= 0, got {}", self.radius)));
        }
        Ok(())
    }

    /// The axis of the solid at the state of the bodies.
    fn axis<S: Real>(&self, at: &Bodies<S>, moving: bool) -> Axis<S> {
        let none = Vector3::zero();
        let ends = [0, self.points.len() - 1].map(|k| Vector3::from(self.points[k].map(S::splat)));
        let Some(frame) = self.frame else {
            return Axis { body: None, start: ends[0], along: ends[1] - ends[0], start_dot: none, along_dot: none };
        };
        let body = at.frame(frame, moving);
        let (offset, along) = (body.r.apply(ends[0]), body.r.apply(ends[1] - ends[0]));
        let start_dot = body.w.cross_add(offset, body.u);
        Axis { body: Some((frame, body)), start: body.p + offset, along, start_dot, along_dot: body.w.cross(along) }
    }
}

/// An axis in the world, with the velocity of its body.
struct Axis<S: Real> {
    body: Option<(usize, Moving<S>)>,
    start: Vector3<S>,
    along: Vector3<S>,
    start_dot: Vector3<S>,
    along_dot: Vector3<S>,
}

/// Where a row has its point on an axis.
#[derive(Clone, Copy, PartialEq)]
enum Place {
    /// At an end, 0 or 1, or at the centre of a sphere, 0.
    End(usize),
    Nearest,
}

/// The points of a row: `p_a` and `p_b` with their velocities, the direction `n` with its rate, and `|r|`.
struct Pair<S: Real> {
    points: [(Vector3<S>, Vector3<S>); 2],
    n: Vector3<S>,
    n_dot: Vector3<S>,
    length: S,
}

/// A task on the distance between two solids.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::kinematics::task::Solid;
/// use armlet_core::kinematics::{TaskFunction, TaskStack};
///
/// let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
/// let tip = Solid { frame: None, points: vec![[0.0; 3]], radius: 0.05 };
/// let ball = Solid { frame: None, points: vec![[1.2, 0.0, 0.0]], radius: 0.1 };
/// let mut stack = TaskStack::new(&arm, vec![TaskFunction::distance(&arm, Some("link2"), tip, None, ball)?]);
/// stack.place(&[0.0, 0.0]);
/// // The tip is at 0.9 m, 0.3 m from the centre of the ball.
/// let (mut e, mut w) = ([0.0], [0.0]);
/// stack.error(0, &[0.0; 3], &mut e, &mut w, None);
/// assert!((e[0] + 0.15).abs() < 1e-15);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Distance {
    /// The two solids.
    pub solids: [Solid; 2],
}

impl TaskFunction {
    /// Create the task for a solid at `frame` and another one at `other`. `None` is the world. The fields `frame` of the solids are set.
    ///
    /// Errors: `Unknown` for a frame. `Input` for two solids in the world or at one frame, and for a wrong number of points. Also `Input` for
    /// equal ends, a negative radius, or numbers that are not finite.
    pub fn distance(arm: &Arm, frame: Option<&str>, mut solid: Solid, other: Option<&str>, mut second: Solid) -> Result<Self> {
        solid.frame = frame.map(|name| frame_of(arm, "frame", name)).transpose()?;
        second.frame = other.map(|name| frame_of(arm, "other", name)).transpose()?;
        if solid.frame == second.frame {
            return Err(Error::input("other", "is the frame itself: expected another frame, or the world for one of both"));
        }
        solid.check(["points", "radius"])?;
        second.check(["other_points", "other_radius"])?;
        Ok(Distance { solids: [solid, second] }.into())
    }
}

impl Distance {
    /// The places of each row.
    fn places(&self) -> Vec<[Place; 2]> {
        use Place::{End, Nearest};
        match [&self.solids[0], &self.solids[1]].map(Solid::is_capsule) {
            [false, false] => vec![[End(0), End(0)]],
            [false, true] => vec![[End(0), Nearest]],
            [true, false] => vec![[Nearest, End(0)]],
            [true, true] => vec![[End(0), Nearest], [End(1), Nearest], [Nearest, End(0)], [Nearest, End(1)], [Nearest, Nearest]],
        }
    }

    fn pairs<S: Real>(&self, at: &Bodies<S>, moving: bool) -> ([Axis<S>; 2], Vec<Pair<S>>) {
        let axes = [0, 1].map(|k| self.solids[k].axis(at, moving));
        let pairs = self.places().into_iter().map(|places| pair(&axes, places)).collect();
        (axes, pairs)
    }
}

/// The nearest points of two axes at the places of a row.
fn pair<S: Real>([a, b]: &[Axis<S>; 2], places: [Place; 2]) -> Pair<S> {
    let (zero, one) = (S::zero(), S::splat(1.0));
    let within = |x: S| x.max(zero).min(one);
    let is_free = |x: S| S::select(zero.lt(x), S::select(x.lt(one), one, zero), zero);
    let apart = a.start - b.start;
    let (aa, ab, bb) = (a.along.dot(a.along), a.along.dot(b.along), b.along.dot(b.along));
    let (ar, br) = (a.along.dot(apart), b.along.dot(apart));
    let determinant = aa * bb - ab * ab + S::splat(PARALLEL) * aa * bb;
    let on_b = |s: S| within((ab * s + br) / bb);
    let on_a = |t: S| within((ab * t - ar) / aa);
    let (s, t) = match places {
        [Place::End(k), Place::End(l)] => (S::splat(k as f64), S::splat(l as f64)),
        [Place::End(k), Place::Nearest] => (S::splat(k as f64), on_b(S::splat(k as f64))),
        [Place::Nearest, Place::End(l)] => (on_a(S::splat(l as f64)), S::splat(l as f64)),
        [Place::Nearest, Place::Nearest] => {
            let t = on_b(within((ab * br - bb * ar) / determinant));
            (on_a(t), t)
        }
    };
    let (p_a, p_b) = (a.along.scale_add(s, a.start), b.along.scale_add(t, b.start));
    let r = p_a - p_b;
    let length = r.dot(r).sqrt();
    // Where both points coincide, no direction increases the distance, and the row is zero.
    let inverse = one / length.max(S::splat(f64::MIN_POSITIVE));
    let n = r.scale(inverse);

    // The rates of the places `s` and `t`: aa s' - ab t' = p, -ab s' + bb t' = q.
    let (u_a, u_b) = (a.along_dot.scale_add(s, a.start_dot), b.along_dot.scale_add(t, b.start_dot));
    let u = u_a - u_b;
    let (p, q) = (-(u.dot(a.along) + r.dot(a.along_dot)), u.dot(b.along) + r.dot(b.along_dot));
    let (s_dot, t_dot) = match places {
        [Place::End(_), Place::End(_)] => (zero, zero),
        [Place::End(_), Place::Nearest] => (zero, is_free(t) * q / bb),
        [Place::Nearest, Place::End(_)] => (is_free(s) * p / aa, zero),
        [Place::Nearest, Place::Nearest] => {
            let (s_free, t_free) = (is_free(s), is_free(t));
            let both = zero.lt(s_free * t_free);
            let alone = (s_free * p / aa, t_free * q / bb);
            let coupled = ((bb * p + ab * q) / determinant, (ab * p + aa * q) / determinant);
            (S::select(both, coupled.0, alone.0), S::select(both, coupled.1, alone.1))
        }
    };
    let (p_a_dot, p_b_dot) = (a.along.scale_add(s_dot, u_a), b.along.scale_add(t_dot, u_b));
    let r_dot = p_a_dot - p_b_dot;
    let n_dot = (r_dot - n.scale(n.dot(r_dot))).scale(inverse);
    Pair { points: [(p_a, p_a_dot), (p_b, p_b_dot)], n, n_dot, length }
}

impl TaskKind for Distance {
    fn rows(&self) -> usize {
        self.places().len()
    }

    fn bodies<S: Real>(&self, tree: &Tree<S>) -> usize {
        self.solids.iter().filter_map(|solid| solid.frame).map(|frame| Bodies::below(tree, frame)).max().unwrap_or(0)
    }

    fn error<S: Real>(&self, at: &mut Bodies<S>, target: &[S], e: &mut [S]) {
        let radii = S::splat(self.solids[0].radius + self.solids[1].radius);
        for ((e, target), pair) in e.iter_mut().zip(target).zip(self.pairs(at, false).1) {
            *e = *target - (pair.length - radii);
        }
    }

    fn jacobian<S: Real>(&self, at: &mut Bodies<S>, rate: bool, j: &mut [S]) {
        let (n, (axes, pairs)) = (at.n(), self.pairs(at, rate));
        for (row, pair) in pairs.iter().enumerate() {
            for ((axis, (p, u)), sign) in axes.iter().zip(pair.points).zip([S::splat(1.0), S::splat(-1.0)]) {
                let Some((frame, body)) = axis.body else { continue };
                at.columns(frame, &Moving { p, u, ..body }, rate, |c| {
                    let entry = if rate { pair.n.dot(c.linear_dot) + pair.n_dot.dot(c.linear) } else { pair.n.dot(c.linear) };
                    let entry = if at.tree.joining.is_some() { S::splat(c.multiplier) * entry } else { entry };
                    j[row * n + c.joint] += sign * entry;
                });
            }
        }
    }
}
