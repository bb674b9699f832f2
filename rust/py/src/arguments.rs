//! The arguments of constructors of laws and plants. They are read once, and stored for `repr` and pickling (module `constructor_call`).

use crate::arm::Arm;
use crate::arrays::{
    Axis, Form, SCALAR, WHATEVER, copied, flag_or_false, numbers, object, owned, per_entry, quoted, require_finite, spread, text,
};
use crate::constructor_call::NamedValues;
use crate::errors::{Failure, input_error};
use crate::motion::Motion;
use armlet_core::kinematics::coordinates::parse_axes;
use armlet_core::linalg::gain::Gain;
use armlet_core::motion::Motion as CoreMotion;
use pyo3::prelude::*;
use pyo3::types::PyBool;

const AN_ARM: &str = "an Arm such as planar_pr(..)";
const A_MOTION: &str = "a Motion such as Hold";

/// The arguments of a law or a plant that contains an arm.
pub struct Arguments<'py> {
    function: &'static str,
    pub arm: Bound<'py, Arm>,
    /// The names and stored values of all arguments except the arm.
    pub arguments: NamedValues,
}

impl<'py> Arguments<'py> {
    pub fn new(function: &'static str, arm: &Bound<'py, PyAny>) -> Result<Self, Failure> {
        Ok(Arguments { function, arm: object::<Arm>(function, "arm", AN_ARM, arm)?, arguments: Vec::new() })
    }

    /// The name of the class that is constructed, for messages.
    pub fn function(&self) -> &'static str {
        self.function
    }

    pub fn model(&self) -> armlet_core::dynamics::Model {
        self.arm.get().model.core()
    }

    /// Read and store a gain: a scalar, `(n,)` or `(n, n)`.
    pub fn gain(&mut self, name: &'static str, value: &Bound<'py, PyAny>, n: usize) -> Result<Gain, Failure> {
        let gain = gain(self.function, name, value, n)?;
        self.store_copy(name, value)?;
        Ok(gain)
    }

    /// Read and store an array `(n,)`, or one number for all `n`.
    pub fn vector(&mut self, name: &'static str, value: &Bound<'py, PyAny>, n: usize) -> Result<Vec<f64>, Failure> {
        let values = per_entry(self.function, name, value, n)?;
        self.store_copy(name, value)?;
        Ok(values)
    }

    pub fn motion(&mut self, name: &'static str, value: &Bound<'py, PyAny>) -> Result<CoreMotion, Failure> {
        let motion = object::<Motion>(self.function, name, A_MOTION, value)?;
        self.arguments.push((name, value.clone().unbind()));
        Ok(motion.get().core.clone())
    }

    /// Read and store a motion of `n` coordinates, or a constant position `(n,)`.
    pub fn motion_or_hold(&mut self, name: &'static str, value: &Bound<'py, PyAny>, n: usize) -> Result<CoreMotion, Failure> {
        match value.cast::<Motion>() {
            Ok(_) => self.motion(name, value),
            Err(_) => Ok(CoreMotion::Hold(self.vector(name, value, n)?)),
        }
    }

    /// Read and store numbers `(n,)`, or one number for all `n`. The result is `None` if the argument is missing.
    pub fn rows(&mut self, name: &'static str, value: Option<&Bound<'py, PyAny>>, n: usize) -> Result<Option<Vec<f64>>, Failure> {
        let Some(value) = value else { return Ok(None) };
        let (shape, values) = numbers(self.function, name, value, &[SCALAR, Form(&[Axis::Is(n)])])?;
        self.store_copy(name, value)?;
        Ok(Some(spread(&shape, values, n)?))
    }

    /// Read and store the frame and the axes (default "xyz"). The third result is the number of axes.
    pub fn frame_and_axes(
        &mut self,
        frame: &Bound<'py, PyAny>,
        axes: Option<&Bound<'py, PyAny>>,
    ) -> Result<(String, String, usize), Failure> {
        let name = text(self.function, "frame", frame)?;
        self.store("frame", frame);
        let Some(axes) = axes else { return Ok((name, "xyz".into(), 3)) };
        self.store("axes", axes);
        let (axes, rows) = axes_of(self.function, axes)?;
        Ok((name, axes, rows))
    }

    /// Read and store one finite number.
    pub fn number(&mut self, name: &'static str, value: &Bound<'py, PyAny>) -> Result<f64, Failure> {
        let x = crate::arrays::number(self.function, name, value)?;
        require_finite(value.py(), self.function, name, &[], &[x])?;
        self.store(name, value);
        Ok(x)
    }

    /// Read a flag whose default is False. Only True is stored, so `repr` omits the default.
    pub fn flag(&mut self, name: &'static str, value: Option<&Bound<'py, PyAny>>) -> Result<bool, Failure> {
        let flag = flag_or_false(self.function, name, value)?;
        if flag {
            self.store(name, PyBool::new(self.arm.py(), true).as_any());
        }
        Ok(flag)
    }

    /// Store an argument without a copy. This suits immutable objects such as text, flags and numbers.
    pub fn store(&mut self, name: &'static str, value: &Bound<'py, PyAny>) {
        self.arguments.push((name, value.clone().unbind()));
    }

    /// Store a copy of the caller's array, so that later changes of the array have no effect.
    pub fn store_copy(&mut self, name: &'static str, value: &Bound<'py, PyAny>) -> Result<(), Failure> {
        let (shape, values) = numbers(self.function, name, value, &[WHATEVER])?;
        let copy = copied(value.py(), &shape, &values)?;
        self.arguments.push((name, copy.unbind()));
        Ok(())
    }
}

/// Refuse the argument `name`, which takes effect only with `partner`, unless the partner is present.
pub fn require_partner(function: &str, name: &str, value: Option<&Bound<'_, PyAny>>, partner: &str, present: bool) -> Result<(), Failure> {
    match value {
        Some(value) if !present => {
            let problem = format!("takes effect only with {partner}: expected None without it, got {}", quoted(value));
            Err(input_error(value.py(), function, name, problem).into())
        }
        _ => Ok(()),
    }
}

/// Read the argument `axes`, such as "xyz rx". Return its text and the number of coordinates that it names.
pub fn axes_of(function: &str, axes: &Bound<'_, PyAny>) -> Result<(String, usize), Failure> {
    let axes = text(function, "axes", axes)?;
    let rows = parse_axes(&axes)?.len();
    Ok((axes, rows))
}

/// Read a gain: a scalar, `(n,)` or `(n, n)`.
pub fn gain(function: &str, name: &'static str, value: &Bound<'_, PyAny>, n: usize) -> Result<Gain, Failure> {
    let forms = [SCALAR, Form(&[Axis::Is(n)]), Form(&[Axis::Is(n), Axis::Is(n)])];
    let (shape, values) = numbers(function, name, value, &forms)?;
    require_finite(value.py(), function, name, &shape, &values)?;
    match shape.len() {
        0 => Ok(Gain::scalar(name, n, values[0])?),
        1 => Ok(Gain::diagonal(name, owned(values)?)?),
        _ => Ok(Gain::full(name, n, owned(values)?)?),
    }
}
