//! The tasks that control other quantities than a frame.

use super::{Blueprint, Common, Task, names};
use crate::arguments::axes_of;
use crate::arrays::{number, text, vector};
use crate::errors::entry;
use armlet_core::error::Error;
use armlet_core::kinematics::TaskFunction;
use armlet_macros::entered;
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;

/// Joints at a posture: `e = q_d - q`. Without `joints` these are all joints, in the order of `q`.
///
/// Args:
///     target: a `Motion` or a constant of one number per joint, rad or m; None if each call has the velocities.
///     gain: as for `Task`.
///     motion: the same argument as `target`.
///     joints: names of the joints; None: all (keyword only).
///     damping: as for `Task` (keyword only).
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
    #[pyo3(signature = (target=None, gain=None, *, joints=None, motion=None, damping=None))]
    fn new<'py>(
        py: Python<'py>,
        target: Option<&Bound<'py, PyAny>>,
        gain: Option<&Bound<'py, PyAny>>,
        joints: Option<&Bound<'py, PyAny>>,
        motion: Option<&Bound<'py, PyAny>>,
        damping: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        const NAME: &str = "PostureTask";
        entry(py, NAME, || {
            let joints = names(NAME, joints)?;
            let own = match &joints {
                Some(joints) => vec![("joints", joints.clone().into_py_any(py)?)],
                None => Vec::new(),
            };
            let size = joints.as_ref().map(Vec::len);
            let blueprint = Blueprint::new(size, move |arm| TaskFunction::posture(arm, joints.as_deref()));
            let task = Common { name: NAME, target, motion, gain, damping }.task(blueprint, own)?;
            Ok(PyClassInitializer::from(task).add_subclass(PostureTask))
        })
    }
}

/// The centre of mass at a point: `e = c_d - c`, in rows of world axes.
///
/// Args:
///     axes: letters of "xyz".
///     target: a `Motion` or a constant, m; None if each call has the velocities.
///     gain: as for `Task`.
///     motion: the same argument as `target`.
///     damping: as for `Task` (keyword only).
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
    #[pyo3(signature = (axes, target=None, gain=None, *, motion=None, damping=None))]
    fn new<'py>(
        axes: &Bound<'py, PyAny>,
        target: Option<&Bound<'py, PyAny>>,
        gain: Option<&Bound<'py, PyAny>>,
        motion: Option<&Bound<'py, PyAny>>,
        damping: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        const NAME: &str = "CentreOfMassTask";
        entry(axes.py(), NAME, || {
            let (letters, rows) = axes_of(NAME, axes)?;
            let blueprint = Blueprint::new(Some(rows), move |arm| TaskFunction::centre_of_mass(arm, &letters));
            let own = vec![("axes", axes.clone().unbind())];
            let task = Common { name: NAME, target, motion, gain, damping }.task(blueprint, own)?;
            Ok(PyClassInitializer::from(task).add_subclass(CentreOfMassTask))
        })
    }
}

/// A direction of a frame shall point along a direction of the world. Rotation about it is free. Two rows.
///
/// The error is the rotation vector from the first to the second direction, in the frame's two directions perpendicular to its axis. The
/// velocity of the task is the frame's angular velocity about these two, rad/s.
///
/// Args:
///     frame: name of the frame.
///     axis: the direction in the frame's axes, (3,), any length > 0.
///     target: a `Motion` of 3 numbers or a constant `(3,)`, any length > 0; None if each call has the velocities.
///     gain: as for `Task`; rows = 2.
///     motion: the same argument as `target`.
///     damping: as for `Task` (keyword only).
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
    #[pyo3(signature = (frame, axis, target=None, gain=None, *, motion=None, damping=None))]
    fn new<'py>(
        frame: &Bound<'py, PyAny>,
        axis: &Bound<'py, PyAny>,
        target: Option<&Bound<'py, PyAny>>,
        gain: Option<&Bound<'py, PyAny>>,
        motion: Option<&Bound<'py, PyAny>>,
        damping: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        const NAME: &str = "AxisTask";
        entry(frame.py(), NAME, || {
            let v = vector(NAME, "axis", axis, 3)?;
            if v.iter().all(|x| *x == 0.0) {
                return Err(Error::input("axis", "has no direction: expected a vector of length > 0, got zeros").into());
            }
            let (name, along) = (text(NAME, "frame", frame)?, [v[0], v[1], v[2]]);
            let blueprint = Blueprint::new(Some(3), move |arm| TaskFunction::axis(arm, &name, along));
            let own = vec![("frame", frame.clone().unbind()), ("axis", v.into_py_any(axis.py())?)];
            let task = Common { name: NAME, target, motion, gain, damping }.task(blueprint, own)?;
            Ok(PyClassInitializer::from(task).add_subclass(AxisTask))
        })
    }
}

/// Rows of the pose of a frame relative to another frame of the arm: `x = R_r'(p - p_r)`, `R = R_r' R_F`.
///
/// Args:
///     frame: name of the frame.
///     reference: name of this other frame, in whose axes the pose is.
///     axes: as for `Task`.
///     target: a `Motion` or a constant, m and rad; None if each call has the velocities.
///     gain: as for `Task`.
///     motion: the same argument as `target`.
///     damping: as for `Task` (keyword only).
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
    #[pyo3(signature = (frame, reference, axes, target=None, gain=None, *, motion=None, damping=None))]
    fn new<'py>(
        frame: &Bound<'py, PyAny>,
        reference: &Bound<'py, PyAny>,
        axes: &Bound<'py, PyAny>,
        target: Option<&Bound<'py, PyAny>>,
        gain: Option<&Bound<'py, PyAny>>,
        motion: Option<&Bound<'py, PyAny>>,
        damping: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        const NAME: &str = "RelativeTask";
        entry(frame.py(), NAME, || {
            let (name, other) = (text(NAME, "frame", frame)?, text(NAME, "reference", reference)?);
            let (letters, rows) = axes_of(NAME, axes)?;
            let blueprint = Blueprint::new(Some(rows), move |arm| TaskFunction::relative(arm, &name, &other, &letters));
            let own = [("frame", frame), ("reference", reference), ("axes", axes)];
            let own = own.into_iter().map(|(name, value)| (name, value.clone().unbind())).collect();
            let task = Common { name: NAME, target, motion, gain, damping }.task(blueprint, own)?;
            Ok(PyClassInitializer::from(task).add_subclass(RelativeTask))
        })
    }
}

/// A task that keeps joints away from their limits. The error is the distance out of the margin, and zero elsewhere.
///
/// As the last level, it uses the remaining freedom. It moves joints that are too near a limit, and commands zero velocity for the others.
///
/// Args:
///     gain: as for `Task`.
///     margin: the fraction of the range at each end that the joints shall avoid, 0 to 0.5; 0.5 centres the joints.
///     joints: names of the joints; None: all that have two finite limits (keyword only).
///     damping: as for `Task` (keyword only).
///
/// Raises:
///     InputError: a name is unknown, `margin` is out of range, or a gain is negative.
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
    #[pyo3(signature = (gain=None, margin=None, *, joints=None, damping=None))]
    fn new<'py>(
        py: Python<'py>,
        gain: Option<&Bound<'py, PyAny>>,
        margin: Option<&Bound<'py, PyAny>>,
        joints: Option<&Bound<'py, PyAny>>,
        damping: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        const NAME: &str = "JointLimitTask";
        entry(py, NAME, || {
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
            let task = Common { name: NAME, target: None, motion: None, gain, damping }.task(blueprint, own)?;
            Ok(PyClassInitializer::from(task).add_subclass(JointLimitTask))
        })
    }
}
