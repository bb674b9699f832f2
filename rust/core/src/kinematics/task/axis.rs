//! A task in which a direction `a` of a frame points along a direction `a_d` of the world. The error has two components of the rotation
//! vector from `a` to `a_d`. They are along the directions `b_1` and `b_2` of the frame, which are perpendicular to `a`. The Jacobian has
//! the rows `b_k' R' J_w` with transposes `'`. `R` is the rotation matrix of the frame, and `J_w` has the angular rows of its geometric
//! Jacobian.

use super::{TaskFunction, TaskKind};
use crate::arm::{Arm, Tree};
use crate::error::{Error, Result, finite};
use crate::kinematics::Bodies;
use crate::kinematics::jacobian::put;
use crate::scalar::Real;
use crate::spatial::{Lift, Matrix, Matrix3, RotationMatrix, Vector, Vector3};

/// A task in which the direction `axis` of a frame points along a direction of the world.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::kinematics::task::Axis;
/// use armlet_core::kinematics::{TaskFunction, TaskStack};
///
/// let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
/// let task = TaskFunction::axis(&arm, "link2", [2.0, 0.0, 0.0])?;
/// assert!(matches!(&task, TaskFunction::Axis(Axis { axis, .. }) if axis.norm() == 1.0));
/// // The last link points along x, and has to turn by a right angle to point along y.
/// let mut stack = TaskStack::new(&arm, vec![task]);
/// stack.place(&[0.4, -0.4]);
/// let (mut e, mut w) = ([0.0; 2], [0.0; 2]);
/// stack.error(0, &[0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], &mut e, &mut w, None);
/// assert!((e[0].hypot(e[1]) - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Index of the frame.
    pub frame: usize,
    /// The direction `a`, a unit vector in the frame.
    pub axis: Vector3<f64>,
    /// Two unit vectors in the frame, perpendicular to `a` and to each other.
    pub across: [Vector3<f64>; 2],
}

impl TaskFunction {
    /// Create the task. `axis` is a direction in the frame, of any length > 0. Errors: `Input` for another `axis`, `Unknown` for the frame.
    pub fn axis(arm: &Arm, frame: &str, axis: [f64; 3]) -> Result<Self> {
        let axis = direction("axis", axis)?;
        let turn = Matrix3::taking_z_to(axis);
        Ok(Axis { frame: arm.frame_index(frame)?, axis, across: [turn.axis(0), turn.axis(1)] }.into())
    }
}

impl TaskKind for Axis {
    fn rows(&self) -> usize {
        2
    }

    fn target_size(&self) -> usize {
        3
    }

    fn require(&self, target: &[f64]) -> Result<()> {
        direction("target", [target[0], target[1], target[2]]).map(|_| ())
    }

    fn bodies<S: Real>(&self, tree: &Tree<S>) -> usize {
        Bodies::below(tree, self.frame)
    }

    fn error<S: Real>(&self, at: &mut Bodies<S>, target: &[S], e: &mut [S]) {
        let r = at.frame(self.frame, false).r;
        let world = self.across.map(|b| r.apply(b.lift()));
        let d = three(target);
        let turn = turn_between(r.apply(self.axis.lift()), d.scale(S::splat(1.0) / d.dot(d).sqrt()), world[0]);
        e.iter_mut().zip(world).for_each(|(e, b)| *e = b.dot(turn));
    }

    /// The desired direction `d` rotates with the angular velocity `d x d_dot / |d|^2`.
    fn feedforward<S: Real>(&self, at: &Bodies<S>, desired: [&[S]; 3], w: &mut [S], a: Option<&mut [S]>) {
        let r = at.frame(self.frame, false).r;
        let world = self.across.map(|b| r.apply(b.lift()));
        let [d, d_dot, d_ddot] = desired.map(three);
        let (one, square) = (S::splat(1.0), d.dot(d));
        let spin = d.cross(d_dot).scale(one / square);
        let spin_dot = (d.cross(d_ddot) - spin.scale(S::splat(2.0) * d.dot(d_dot))).scale(one / square);
        w.iter_mut().zip(world).for_each(|(w, b)| *w = b.dot(spin));
        if let Some(a) = a {
            a.iter_mut().zip(world).for_each(|(a, b)| *a = b.dot(spin_dot));
        }
    }

    fn jacobian<S: Real>(&self, at: &mut Bodies<S>, rate: bool, j: &mut [S]) {
        let (n, frame) = (at.n(), at.frame(self.frame, rate));
        let world = self.across.map(|b| frame.r.apply(b.lift()));
        at.columns(self.frame, &frame, rate, |c| {
            for (row, &b) in world.iter().enumerate() {
                let entry = if rate { frame.w.cross(b).dot(c.angular) + b.dot(c.angular_dot) } else { b.dot(c.angular) };
                put(&at.tree, c.multiplier, &mut j[row * n + c.joint], entry);
            }
        });
    }
}

fn three<S: Real>(x: &[S]) -> Vector3<S> {
    Vector3::from([x[0], x[1], x[2]])
}

/// A unit vector along `x`.
fn direction(argument: &str, x: [f64; 3]) -> Result<Vector3<f64>> {
    finite(argument, &x)?;
    // Scale `x` before computing its norm, because squares of extreme entries would overflow or vanish.
    let most = x.iter().fold(0.0f64, |most, x| most.max(x.abs()));
    if most == 0.0 {
        return Err(Error::input(argument, "has no direction: expected a vector of length > 0, got zeros"));
    }
    let v = Vector3::from(x.map(|x| x / most));
    Ok(v.scale(1.0 / v.norm()))
}

/// Below this sine of the angle between them, two unit vectors with a negative scalar product are opposite up to rounding.
const OPPOSITE: f64 = 1e-15;

/// The shortest rotation vector that takes the unit vector `a` to `d`. If they are opposite, the axis of rotation is `across`.
fn turn_between<S: Real>(a: Vector3<S>, d: Vector3<S>, across: Vector3<S>) -> Vector3<S> {
    let (axis, cosine) = (a.cross(d), a.dot(d));
    let sine = axis.dot(axis).sqrt();
    let angle = sine.atan2(cosine);
    // The cross product of opposite vectors is zero up to rounding, and then has no meaningful direction.
    let least = S::select(cosine.lt(S::zero()), S::splat(OPPOSITE), S::zero());
    let turns = least.lt(sine);
    let part = angle / sine;
    Vector3::from(std::array::from_fn(|k| S::select(turns, axis[k] * part, across[k] * angle)))
}
