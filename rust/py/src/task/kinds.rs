//! Tasks that control other quantities than the pose of a frame: posture, centre of mass, axis, relative pose, distance, joint limits.

use super::{Blueprint, Common, Task, names};
use crate::arguments::axes_of;
use crate::arrays::{Axis, Form, number, numbers, text, vector};
use crate::constructor_call::{NamedValues, stored_form};
use crate::errors::Failure;
use armlet_core::error::Error;
use armlet_core::kinematics::TaskFunction;
use armlet_core::kinematics::task::Solid;
use armlet_macros::entered;
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;

/// A task that moves joints to desired positions: `e = q_d - q`, rad or m.
///
/// Args:
///     target: `q_d`, a `Motion` or a constant with one number per joint, rad or m; None if task velocities are passed at each call.
///     gain: as for `Task`.
///     motion: another name of the argument `target` (keyword only).
///     joints: names of the joints; None: all (keyword only).
///     damping: as for `Task` (keyword only).
///     lower, upper: as for `Task` (keyword only).
///
/// Raises:
///     InputError: a name is unknown, a shape is wrong, a number is not finite, or a gain is negative.
///
/// Source: [SicilianoEtAl2009], section 3.5; docs/priority.md.
///
/// >>> import armlet as al
/// >>> al.PostureTask([0.0, 0.5], 1.0, joints=["joint1", "joint3"])
/// PostureTask(joints=['joint1', 'joint3'], target=[0.0, 0.5], gain=1.0)
#[pyclass(frozen, extends = Task, module = "armlet")]
pub struct PostureTask;

#[entered]
#[pymethods]
impl PostureTask {
    #[new]
    #[arguments(target=None, gain=None, *, joints=None, motion=None, damping=None, lower=None, upper=None)]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let joints = names(NAME, joints)?;
        let own = match &joints {
            Some(joints) => vec![("joints", joints.clone().into_py_any(py)?)],
            None => Vec::new(),
        };
        let size = joints.as_ref().map(Vec::len);
        let blueprint = Blueprint::new(size, move |arm| TaskFunction::posture(arm, joints.as_deref()));
        let task = Common { name: NAME, target, motion, gain, damping, lower, upper }.task(blueprint, own)?;
        Ok(PyClassInitializer::from(task).add_subclass(PostureTask))
    }
}

/// A task that moves the arm's centre of mass to a point: `e = c_d - c`, m, in world axes.
///
/// Args:
///     axes: the controlled coordinates, letters of "xyz".
///     target: `c_d`, a `Motion` or a constant with one number per letter, m; None if task velocities are passed at each call.
///     gain: as for `Task`.
///     motion: another name of the argument `target` (keyword only).
///     damping: as for `Task` (keyword only).
///     lower, upper: as for `Task` (keyword only).
///
/// Raises:
///     InputError: a letter is unknown, a shape is wrong, a number is not finite, or a gain is negative.
///
/// Source: [SicilianoEtAl2009], section 3.5; docs/priority.md.
///
/// >>> import armlet as al
/// >>> al.CentreOfMassTask("xy", [0.5, 0.0], 2.0)
/// CentreOfMassTask(axes='xy', target=[0.5, 0.0], gain=2.0)
#[pyclass(frozen, extends = Task, module = "armlet")]
pub struct CentreOfMassTask;

#[entered]
#[pymethods]
impl CentreOfMassTask {
    #[new]
    #[arguments(axes, target=None, gain=None, *, motion=None, damping=None, lower=None, upper=None)]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let (letters, rows) = axes_of(NAME, axes)?;
        let blueprint = Blueprint::new(Some(rows), move |arm| TaskFunction::centre_of_mass(arm, &letters));
        let own = vec![("axes", axes.clone().unbind())];
        let task = Common { name: NAME, target, motion, gain, damping, lower, upper }.task(blueprint, own)?;
        Ok(PyClassInitializer::from(task).add_subclass(CentreOfMassTask))
    }
}

/// A task that turns a direction of a frame to a direction of the world. Rotation about this direction is free.
///
/// The task has two rows: the components along the two directions of the frame that are perpendicular to `axis`. The error is the rotation
/// vector from `axis` to `target`, rad. The task velocity is the frame's angular velocity, rad/s.
///
/// Args:
///     frame: name of the frame.
///     axis: the direction in the frame's axes, `(3,)`, of any length > 0.
///     target: the direction in world axes: a `Motion` of 3 numbers, or a constant `(3,)` of any length > 0. None if task velocities are
///         passed at each call.
///     gain: as for `Task`, with two rows.
///     motion: another name of the argument `target` (keyword only).
///     damping: as for `Task` (keyword only).
///     lower, upper: bounds of the two components of the rotation vector from `target` to the direction, rad, as for `Task` (keyword
///         only). The task then has a target and bounds.
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite, a direction has no length, or a gain is negative.
///
/// Source: [SicilianoEtAl2009], section 3.7; docs/priority.md.
///
/// >>> import armlet as al
/// >>> al.AxisTask("tool", [0.0, 0.0, 1.0], [0.0, 0.0, -1.0], 5.0)
/// AxisTask(frame='tool', axis=[0.0, 0.0, 1.0], target=[0.0, 0.0, -1.0], gain=5.0)
#[pyclass(frozen, extends = Task, module = "armlet")]
pub struct AxisTask;

#[entered]
#[pymethods]
impl AxisTask {
    #[new]
    #[arguments(frame, axis, target=None, gain=None, *, motion=None, damping=None, lower=None, upper=None)]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let v = vector(NAME, "axis", axis, 3)?;
        if v.iter().all(|x| *x == 0.0) {
            return Err(Error::input("axis", "has no direction: expected a vector of length > 0, got zeros").into());
        }
        let (name, along) = (text(NAME, "frame", frame)?, [v[0], v[1], v[2]]);
        let mut blueprint = Blueprint::new(Some(3), move |arm| TaskFunction::axis(arm, &name, along));
        blueprint.turns_to_target = true;
        let own = vec![("frame", frame.clone().unbind()), ("axis", v.into_py_any(axis.py())?)];
        let task = Common { name: NAME, target, motion, gain, damping, lower, upper }.task(blueprint, own)?;
        Ok(PyClassInitializer::from(task).add_subclass(AxisTask))
    }
}

/// A task that controls the pose of a frame relative to another frame of the arm: `x = R_r'(p - p_r)`, `R = R_r' R_F`.
///
/// Args:
///     frame: name of the frame, with the position `p` and the rotation `R_F` in the world.
///     reference: name of the other frame, with `p_r` and `R_r`. The relative pose is in the axes of this frame.
///     axes: the controlled coordinates, as for `Task`.
///     target: a `Motion` or a constant `(rows,)`, m and rad (rotation vector); None if task velocities are passed at each call.
///     gain: as for `Task`.
///     motion: another name of the argument `target` (keyword only).
///     damping: as for `Task` (keyword only).
///     lower, upper: as for `Task` (keyword only).
///
/// Raises:
///     InputError: a letter is unknown, a shape is wrong, a number is not finite, or a gain is negative.
///
/// Source: [SicilianoEtAl2009], section 3.7; docs/priority.md.
///
/// >>> import armlet as al
/// >>> al.RelativeTask("left", "right", "xyz", [0.3, 0.0, 0.0], 5.0)
/// RelativeTask(frame='left', reference='right', axes='xyz', target=[0.3, 0.0, 0.0], gain=5.0)
#[pyclass(frozen, extends = Task, module = "armlet")]
pub struct RelativeTask;

#[entered]
#[pymethods]
impl RelativeTask {
    #[new]
    #[arguments(frame, reference, axes, target=None, gain=None, *, motion=None, damping=None, lower=None, upper=None)]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let (name, other) = (text(NAME, "frame", frame)?, text(NAME, "reference", reference)?);
        let (letters, rows) = axes_of(NAME, axes)?;
        let poses = letters.clone();
        let blueprint = Blueprint::new(Some(rows), move |arm| TaskFunction::relative(arm, &name, &other, &letters)).with_poses(&poses)?;
        let own = [("frame", frame), ("reference", reference), ("axes", axes)];
        let own = own.into_iter().map(|(name, value)| (name, value.clone().unbind())).collect();
        let task = Common { name: NAME, target, motion, gain, damping, lower, upper }.task(blueprint, own)?;
        Ok(PyClassInitializer::from(task).add_subclass(RelativeTask))
    }
}

/// A task that keeps a distance between two spheres or capsules, such as a link and an obstacle.
///
/// A capsule has all points within its radius of a line segment, its axis. The distance `d` is negative if the solids overlap. Between
/// `lower` and `upper`, the solids move freely. In `PriorityVelocity`, they approach a bound with the gain, `d_dot >= K (lower - d)`. In
/// `PriorityAcceleration`, `d_ddot >= -D d_dot + K (lower - d)`.
///
/// A sphere has one row with any other solid. Two capsules have five rows: the four ends of the axes with the other capsule, and the
/// nearest points of both axes. The smallest of them is the distance. So the solution does not jump where the axes are parallel.
///
/// Args:
///     frame: name of the frame of the first solid; None: the world.
///     other: name of the frame of the second solid; None: the world.
///     lower, upper: bounds of the distance, m; at least one of them. None: no bound.
///     gain: as for `Task`, a number or one per row.
///     points: the centre of the first solid, `(3,)`, m, which is then a sphere; or the ends of the axis of a capsule, `(2, 3)`. They are in
///         the axes of its frame (keyword only). None: the origin of the frame.
///     radius: radius of the first solid, m, >= 0; 0 if None (keyword only).
///     other_points, other_radius: the same for the second solid (keyword only).
///     damping: as for `Task` (keyword only).
///
/// Raises:
///     InputError: `lower` and `upper` are missing, a shape is wrong, a number is not finite, or a gain is negative. The law of the task
///         raises it for an unknown frame, two equal frames, equal ends of an axis, and a negative radius.
///
/// Source: [kanoun2011priority], section VI; docs/methods/inequalities.md.
///
/// >>> import armlet as al
/// >>> al.DistanceTask("link5", None, 0.05, points=[[0.0, 0.0, 0.0], [0.0, 0.0, 0.2]], radius=0.06, other_points=[0.5, 0.1, 0.4])
/// DistanceTask(frame='link5', points=[[0.0, 0.0, 0.0], [0.0, 0.0, 0.2]], radius=0.06, other_points=[0.5, 0.1, 0.4], lower=0.05)
#[pyclass(frozen, extends = Task, module = "armlet")]
pub struct DistanceTask;

/// Read the points of a solid. The default is the origin of its frame.
fn solid(
    function: &str,
    [points, radius]: [(&'static str, Option<&Bound<'_, PyAny>>); 2],
    own: &mut NamedValues,
) -> Result<Solid, Failure> {
    let mut solid = Solid { frame: None, points: vec![[0.0; 3]], radius: 0.0 };
    if let (name, Some(value)) = points {
        let (_, values) = numbers(function, name, value, &[Form(&[Axis::Is(3)]), Form(&[Axis::Is(2), Axis::Is(3)])])?;
        solid.points = values.chunks_exact(3).map(|point| [point[0], point[1], point[2]]).collect();
        own.push((name, stored_form(value)?));
    }
    if let (name, Some(value)) = radius {
        solid.radius = number(function, name, value)?;
        own.push((name, value.clone().unbind()));
    }
    Ok(solid)
}

#[entered]
#[pymethods]
impl DistanceTask {
    #[new]
    #[arguments(
        frame, other=None, lower=None, gain=None, *, upper=None, points=None, radius=None, other_points=None, other_radius=None, damping=None
    )]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let mut own = vec![("frame", frame.clone().unbind())];
        own.extend(other.map(|other| ("other", other.clone().unbind())));
        let of_frame = (!frame.is_none()).then(|| text(NAME, "frame", frame)).transpose()?;
        let names = [of_frame, other.map(|other| text(NAME, "other", other)).transpose()?];
        let first = solid(NAME, [("points", points), ("radius", radius)], &mut own)?;
        let second = solid(NAME, [("other_points", other_points), ("other_radius", other_radius)], &mut own)?;
        if lower.is_none() && upper.is_none() {
            return Err(Error::input("lower", "is missing: expected lower or upper, got None").into());
        }
        let rows = if first.points.len() + second.points.len() == 4 { 5 } else { 1 };
        let blueprint = Blueprint::new(Some(rows), move |arm| {
            let [frame, other] = [&names[0], &names[1]].map(Option::as_deref);
            TaskFunction::distance(arm, frame, first.clone(), other, second.clone())
        });
        let task = Common { name: NAME, target: None, motion: None, gain, damping, lower, upper }.task(blueprint, own)?;
        Ok(PyClassInitializer::from(task).add_subclass(DistanceTask))
    }
}

/// A task that keeps joints away from their limits.
///
/// The error of a joint is the displacement from its position to the nearest point of the inner part of its range, rad or m. It is zero
/// inside this part. As the last level of a stack, the task moves joints that are too near a limit, and commands zero velocity to the other
/// joints.
///
/// Args:
///     gain: as for `Task`, with one row per joint.
///     margin: the fraction of the range at each end that joints avoid, 0 to 0.5; 0.1 if None. With 0.5 the inner part is the centre of
///         the range.
///     joints: names of the joints; None: all joints with two finite limits (keyword only).
///     damping: as for `Task` (keyword only).
///
/// Raises:
///     InputError: `margin` is out of range, or a gain is negative. The law or solver of the task raises it for an unknown joint, and for a
///         joint without two finite limits.
///
/// Source: [SicilianoEtAl2009], section 3.5; docs/priority.md.
///
/// >>> import armlet as al
/// >>> al.JointLimitTask(2.0, 0.2)
/// JointLimitTask(margin=0.2, gain=2.0)
#[pyclass(frozen, extends = Task, module = "armlet")]
pub struct JointLimitTask;

#[entered]
#[pymethods]
impl JointLimitTask {
    #[new]
    #[arguments(gain=None, margin=None, *, joints=None, damping=None)]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let joints = names(NAME, joints)?;
        let margin = margin.map_or(Ok(0.1), |margin| number(NAME, "margin", margin))?;
        if !(0.0..=0.5).contains(&margin) {
            let problem = format!("is not a part of the range: expected 0 <= margin <= 0.5, got {margin}");
            return Err(Error::input("margin", problem).into());
        }
        let mut own = vec![("margin", margin.into_py_any(py)?)];
        if let Some(joints) = &joints {
            own.push(("joints", joints.clone().into_py_any(py)?));
        }
        let blueprint = Blueprint::new(None, move |arm| TaskFunction::joint_limits(arm, joints.as_deref(), margin));
        let task = Common { name: NAME, target: None, motion: None, gain, damping, lower: None, upper: None }.task(blueprint, own)?;
        Ok(PyClassInitializer::from(task).add_subclass(JointLimitTask))
    }
}
