//! `armlet.Task`, the base class of all tasks. A task describes a controlled quantity by names, before its arm is known.

mod bounds;
pub mod kinds;
pub mod levels;

use crate::arguments::axes_of;
use crate::arrays::{ArrayArgument, Axis, Form, SCALAR, copied, items, owned, require_finite, shown, text};
use crate::constructor_call::{NamedValues, defined_by_arguments, short_repr, stored_form};
use crate::errors::{Failure, input_error};
use crate::motion::Motion;
use armlet_core::arm::Arm;
use armlet_core::error::Error;
use armlet_core::kinematics::TaskFunction;
use armlet_core::kinematics::coordinates::{parse_axes, rows_of_pose};
use armlet_core::law::{Gain, Level};
use armlet_core::memory;
use armlet_core::motion::Motion as CoreMotion;
use armlet_macros::entered;
use bounds::Bounds;
use pyo3::prelude::*;
use pyo3::types::{PyString, PyTuple};

/// The largest number of tasks of a solver or a law, and of joints, of levels, and of rows of all levels. The buffers of a solver grow with
/// `(n + rows)^2`.
pub const MOST_LEVELS: usize = 4096;

/// A function that makes the task function for an arm.
type OnArm = Box<dyn Fn(&Arm) -> Result<TaskFunction, Error> + Send + Sync>;

/// The controlled quantity of a task, with the names of frames and joints, before the arm is known.
struct Blueprint {
    on: OnArm,
    /// The length of a target, if it is known without the arm.
    target_size: Option<usize>,
    /// The coordinates of a pose that are a target, if the task accepts a pose as its target.
    of_pose: Option<Vec<usize>>,
    /// Whether bounds are angles from the target, so that a task with bounds has a target.
    turns_to_target: bool,
}

/// The target of a task.
enum Aim {
    Motion(CoreMotion),
    /// A constant for each row of a batch: the leading axes, and the numbers, which need not be finite.
    Rows(Vec<usize>, Vec<f64>),
}

/// A task function with its constant targets: the leading axes `lead`, and the numbers, `(lead.., size)`.
pub struct Goals {
    pub function: TaskFunction,
    pub lead: Vec<usize>,
    pub targets: Vec<f64>,
}

impl Blueprint {
    fn new(target_size: Option<usize>, on: impl Fn(&Arm) -> Result<TaskFunction, Error> + Send + Sync + 'static) -> Self {
        Blueprint { on: Box::new(on), target_size, of_pose: None, turns_to_target: false }
    }

    /// Accept poses `(..., 4, 4)` as targets. `letters` are the axes of the task.
    fn with_poses(mut self, letters: &str) -> Result<Self, Failure> {
        let rows = parse_axes(letters)?;
        // With four rows, an array (4, 4) is a batch of targets.
        self.of_pose = Some(rows).filter(|rows| rows.len() != 4);
        Ok(self)
    }

    /// Convert poses `(..., 4, 4)` to targets `(..., rows)`. The result is `None` if the argument has another shape.
    fn targets_of_poses<'py>(&self, function: &str, value: &Bound<'py, PyAny>) -> Result<Option<Bound<'py, PyAny>>, Failure> {
        let Some(rows) = &self.of_pose else { return Ok(None) };
        let argument = ArrayArgument::new(function, "target", value)?;
        let [lead @ .., 4, 4] = argument.shape.as_slice() else { return Ok(None) };
        let shape = [lead, &[rows.len()]].concat();
        let (_, values) = argument.values()?;
        let mut targets = memory::reserved(values.len() / 16 * rows.len())?;
        for (k, pose) in values.chunks_exact(16).enumerate() {
            // As in any batch of targets, a row that is not finite makes a row of NaN.
            if shape.len() > 1 && pose.iter().any(|x| !x.is_finite()) {
                targets.extend(std::iter::repeat_n(f64::NAN, rows.len()));
                continue;
            }
            require_finite(value.py(), function, "target", &[4, 4], pose)?;
            let place = if shape.len() > 1 { format!(" (first bad index {k})") } else { String::new() };
            targets.extend(
                rows_of_pose(pose, rows)
                    .map_err(|error| Error::input("target", format!("{}{place}", error.problem().unwrap_or_default())))?,
            );
        }
        Ok(Some(copied(value.py(), &shape, &targets)?))
    }
}

/// A gain as the caller passed it. Its shape is checked later, when the number of rows is known.
#[derive(Clone)]
struct Raw {
    shape: Vec<usize>,
    values: Vec<f64>,
}

/// A task that moves a frame of an arm to a target. This is also the base class of all tasks.
///
/// Each controlled coordinate is a row of the task. The error `e` is `p_d - p`, m, for x, y, z, and `log(R_d R')`, rad, for rx, ry, rz,
/// both in world axes. `p` and `R` are the position and the rotation of the frame, and `p_d` and `R_d` those of the target.
///
/// Args:
///     frame: name of the frame.
///     axes: the controlled coordinates in world axes, such as "xyz", "xy", "rx ry rz" or "x y rz".
///     target: a `Motion` or a constant `(rows,)`, m and rad (rotation vector); None if task velocities are passed at each call. A pose
///         `(4, 4)` is a constant too, except for a task of four rows. A batch of constants `(..., rows)` or `(..., 4, 4)` is for
///         `inverse_kinematics`, and may contain numbers that are not finite.
///     gain: `K` in `v = x_d_dot + K e`, 1/s (1/s^2 in `PriorityAcceleration`): scalar, `(rows,)` or `(rows, rows)`, not negative; 1 if
///         None.
///     motion: another name of the argument `target` (keyword only).
///     damping: gain of the error's derivative in `PriorityAcceleration`, 1/s: scalar, `(rows,)` or `(rows, rows)` (keyword only). None:
///         `2 K^1/2`, critical damping.
///     lower, upper: bounds of the coordinates in place of a target, a number or `(rows,)`, m and rad (keyword only). None or infinite: no
///         bound. A coordinate `x` approaches a bound with the gain, `K (lower - x) <= x_dot <= K (upper - x)`, and moves freely between
///         the bounds. For rx, ry, rz the coordinates are those of the rotation vector of the frame. In laws and `inverse_kinematics`.
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite, a gain is negative, or a task with bounds has a target.
///
/// Source: [SicilianoEtAl2009], section 3.7; docs/priority.md.
///
/// >>> import armlet as al
/// >>> al.Task("link4", "xy", [1.0, 0.5], 10.0)
/// Task('link4', 'xy', [1.0, 0.5], 10.0)
#[pyclass(frozen, subclass, module = "armlet", name = "Task")]
pub struct Task {
    blueprint: Blueprint,
    target: Option<Aim>,
    gain: Raw,
    damping: Option<Raw>,
    bounds: Option<Bounds>,
    /// The arguments, for `repr` and pickling.
    arguments: NamedValues,
}

defined_by_arguments!(Task);

/// The common arguments of the tasks.
struct Common<'a, 'py> {
    name: &'static str,
    target: Option<&'a Bound<'py, PyAny>>,
    motion: Option<&'a Bound<'py, PyAny>>,
    gain: Option<&'a Bound<'py, PyAny>>,
    damping: Option<&'a Bound<'py, PyAny>>,
    lower: Option<&'a Bound<'py, PyAny>>,
    upper: Option<&'a Bound<'py, PyAny>>,
}

fn raw(function: &str, name: &str, value: &Bound<'_, PyAny>) -> Result<Raw, Failure> {
    let forms = [SCALAR, Form(&[Axis::Any("rows")]), Form(&[Axis::Any("rows"), Axis::Any("rows")])];
    let argument = ArrayArgument::new(function, name, value)?.of(&forms)?;
    if argument.shape.len() == 2 && argument.shape[0] != argument.shape[1] {
        return Err(argument.of_another_shape(&forms));
    }
    let (shape, values) = argument.values()?;
    require_finite(value.py(), function, name, &shape, &values)?;
    if let Some(&k) = values.iter().find(|&&k| k < 0.0).filter(|_| shape.len() < 2) {
        return Err(input_error(value.py(), function, name, format!("is negative: expected >= 0, got {k}")).into());
    }
    Ok(Raw { shape, values: owned(values)? })
}

impl Raw {
    fn gain(&self, name: &str, rows: usize) -> Result<Gain, Error> {
        match self.shape.as_slice() {
            [] => Gain::not_negative(name, vec![self.values[0]; rows]),
            [m] if *m == rows => Gain::not_negative(name, self.values.clone()),
            [m, _] if *m == rows => Gain::full(name, rows, self.values.clone()),
            _ => Err(Error::input(
                name,
                format!("has the wrong shape: expected a scalar, ({rows},) or ({rows}, {rows}), got {}", shown(&self.shape)),
            )),
        }
    }
}

impl Common<'_, '_> {
    /// Make the task of a blueprint. The common arguments are appended to `arguments`.
    fn task(self, blueprint: Blueprint, mut arguments: NamedValues) -> Result<Task, Failure> {
        let given = match (self.target, self.motion) {
            (Some(target), Some(_)) => {
                return Err(input_error(target.py(), self.name, "motion", "is given twice: expected either target or motion").into());
            }
            (target, motion) => target.or(motion),
        };
        let target = match given {
            None => None,
            Some(given) => {
                let target = match given.cast::<Motion>() {
                    Ok(motion) => Aim::Motion(motion.get().core.clone()),
                    Err(_) => {
                        let of_pose = blueprint.targets_of_poses(self.name, given)?;
                        let given = of_pose.as_ref().unwrap_or(given);
                        let single = Form(&[Axis::Any("rows")]);
                        // The last axis of a batch must have the length of the target. This is checked before the numbers are read.
                        let argument = ArrayArgument::new(self.name, "target", given)?;
                        let width = [Axis::Leading, blueprint.target_size.map_or(Axis::Any("rows"), Axis::Is)];
                        let forms = [single, Form(&width)];
                        let count = if argument.shape.len() > 1 { 2 } else { 1 };
                        let (mut shape, values) = argument.of(&forms[..count])?.values()?;
                        if shape.len() == 1 {
                            require_finite(given.py(), self.name, "target", &shape, &values)?;
                            Aim::Motion(CoreMotion::Hold(owned(values)?))
                        } else {
                            shape.pop();
                            Aim::Rows(shape, owned(values)?)
                        }
                    }
                };
                // The argument is copied after the check of its shape. A batch is stored as an array.
                let stored = match &target {
                    Aim::Motion(_) => stored_form(given)?,
                    Aim::Rows(lead, values) => {
                        let shape: Vec<usize> =
                            lead.iter().copied().chain([values.len() / lead.iter().product::<usize>().max(1)]).collect();
                        copied(given.py(), &shape, values)?.unbind()
                    }
                };
                arguments.push(("target", stored));
                Some(target)
            }
        };
        let gain = match self.gain {
            Some(gain) => {
                let read = raw(self.name, "gain", gain)?;
                arguments.push(("gain", stored_form(gain)?));
                read
            }
            None => Raw { shape: Vec::new(), values: vec![1.0] },
        };
        let damping = match self.damping {
            Some(damping) => {
                let read = raw(self.name, "damping", damping)?;
                arguments.push(("damping", stored_form(damping)?));
                Some(read)
            }
            None => None,
        };
        let bounds = Bounds::read(self.name, &mut arguments, [("lower", self.lower), ("upper", self.upper)])?;
        if let (Some(given), Some(_), false) = (given, &bounds, blueprint.turns_to_target) {
            let problem = "is given with bounds: expected either a target, or lower and upper";
            return Err(input_error(given.py(), self.name, "target", problem).into());
        }
        Ok(Task { blueprint, target, gain, damping, bounds, arguments })
    }
}

impl Task {
    /// Make the task function for an arm.
    pub fn function(&self, arm: &Arm) -> Result<TaskFunction, Error> {
        (self.blueprint.on)(arm)
    }

    /// Make the task function for an arm, with the constant targets. A task with bounds has its distance from them as its error. A missing or
    /// moving target is an error.
    pub fn goals(&self, arm: &Arm) -> Result<Goals, Error> {
        if let Some(Aim::Rows(lead, values)) = &self.target {
            let (function, rows) = (self.function(arm)?, lead.iter().product::<usize>());
            let size = function.target_size();
            // The number of elements is compared, because `Aim::Rows` does not store the length of the last axis.
            if rows.checked_mul(size) != Some(values.len()) {
                let got = shown(&[lead.as_slice(), &[values.len() / rows.max(1)]].concat());
                return Err(Error::input("target", format!("has the wrong shape: expected (..., {size}), got {got}")));
            }
            return Ok(Goals { function, lead: lead.clone(), targets: values.clone() });
        }
        let Level { function, target, bounds, .. } = self.level(arm)?;
        match target {
            CoreMotion::Hold(target) if bounds.is_some() => {
                let bounds = bounds.unwrap_or_default();
                Ok(Goals { function: function.within(target, bounds)?, lead: Vec::new(), targets: Vec::new() })
            }
            CoreMotion::Hold(targets) => Ok(Goals { function, lead: Vec::new(), targets }),
            _ => Err(Error::input("target", "moves: expected a constant, got a motion")),
        }
    }

    /// Make the level of priority for an arm: the task function, its target and its gains. A missing target is an error.
    pub fn level(&self, arm: &Arm) -> Result<Level, Error> {
        let function = self.function(arm)?;
        let rows = function.rows();
        let target = match &self.target {
            Some(Aim::Motion(target)) => target.clone(),
            Some(Aim::Rows(lead, _)) => {
                let problem = format!("is a batch: expected a Motion or a constant ({rows},), got leading axes {}", shown(lead));
                return Err(Error::input("target", problem));
            }
            None if function.target_size() == 0 => CoreMotion::Hold(Vec::new()),
            None if self.bounds.is_some() && !self.blueprint.turns_to_target => CoreMotion::Hold(vec![0.0; function.target_size()]),
            None => return Err(Error::input("target", "is missing: expected a Motion or a constant, got None")),
        };
        let damping = self.damping.as_ref().map(|damping| damping.gain("damping", rows)).transpose()?;
        let level = Level::new(function, target, self.gain.gain("gain", rows)?, damping)?;
        let Some(bounds) = &self.bounds else { return Ok(level) };
        let [lower, upper] = bounds.of_rows(rows)?;
        level.within(lower, upper)
    }
}

/// The largest number of names in a list.
const MOST_NAMES: usize = 1 << 20;

/// Read a list of tasks, and apply `of` to each of them. The errors of `of` name the task.
pub fn each<T>(function: &str, tasks: &Bound<'_, PyAny>, of: impl Fn(&Task) -> Result<T, Error>) -> Result<(Py<PyTuple>, Vec<T>), Failure> {
    let py = tasks.py();
    let refuse = |argument: &str, problem: String| -> Failure { input_error(py, function, argument, problem).into() };
    if tasks.is_instance_of::<Task>() {
        return Err(refuse("tasks", "is a single task: expected a list of tasks, the highest first".into()));
    }
    let items = items(function, "tasks", "a list: expected tasks, the highest first", tasks, MOST_LEVELS)?;
    if items.is_empty() {
        return Err(refuse("tasks", "is empty: expected at least one task, got 0".into()));
    }
    let mut out = Vec::with_capacity(items.len());
    for (i, item) in items.iter().enumerate() {
        let Ok(task) = item.cast::<Task>() else {
            let kind = item.get_type().name().map(|name| name.to_string()).unwrap_or_default();
            return Err(refuse("tasks", format!("is of the wrong type: expected tasks, got {kind} (first bad index {i})")));
        };
        out.push(of(task.get()).map_err(|error| match error.argument().map(|argument| format!("tasks[{i}].{argument}")) {
            Some(argument) => error.of_argument(argument),
            None => error,
        })?);
    }
    Ok((PyTuple::new(py, items)?.unbind(), out))
}

/// Read a list of names of joints, or None.
fn names(function: &str, value: Option<&Bound<'_, PyAny>>) -> Result<Option<Vec<String>>, Failure> {
    let Some(value) = value else { return Ok(None) };
    if value.is_instance_of::<PyString>() {
        return Err(input_error(value.py(), function, "joints", "is a single name: expected a list of names").into());
    }
    let items = items(function, "joints", "a list of names: expected strings", value, MOST_NAMES)?;
    Ok(Some(items.iter().map(|item| text(function, "joints", item)).collect::<Result<_, _>>()?))
}

#[entered]
#[pymethods]
impl Task {
    #[new]
    #[arguments(frame, axes, target=None, gain=None, *, motion=None, damping=None, lower=None, upper=None)]
    fn new() -> Result<Self, Failure> {
        let (name, (letters, rows)) = (text(NAME, "frame", frame)?, axes_of(NAME, axes)?);
        let poses = letters.clone();
        let blueprint = Blueprint::new(Some(rows), move |arm| TaskFunction::frame(arm, &name, &letters)).with_poses(&poses)?;
        let own = vec![("frame", frame.clone().unbind()), ("axes", axes.clone().unbind())];
        Common { name: NAME, target, motion, gain, damping, lower, upper }.task(blueprint, own)
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let py = slf.py();
        let mut parts = Vec::new();
        let of_frame = slf.get().arguments.get(1).is_some_and(|(name, _)| *name == "axes");
        for (i, (name, value)) in slf.get().arguments.iter().enumerate() {
            let shown = short_repr(value.bind(py))?;
            // Arguments are shown by position until one is missing, and then by name.
            let plain = i < 2 || (i == 2 && *name == "target") || (i == 3 && *name == "gain" && slf.get().arguments[2].0 == "target");
            let keyword = !plain || *name == "damping" || !of_frame;
            parts.push(if keyword { format!("{name}={shown}") } else { shown });
        }
        Ok(format!("{}({})", slf.get_type().name()?, parts.join(", ")))
    }
}
