//! The arguments `friction` and `motor_friction` of a plant: an `armlet.LuGre` or an `armlet.StickSlip`.

use crate::arrays::{Axis, Form, SCALAR, numbers, require_finite, spread};
use crate::errors::{Failure, input_error};
use armlet_core::error::Error;
use armlet_core::plant::{FrictionCurve, JointFriction, LuGre, StickSlip};
use pyo3::prelude::*;

/// Read an `armlet.LuGre` or `armlet.StickSlip` as the friction of `n` joints. The result is `None` for other objects.
pub fn friction(function: &'static str, n: usize, argument: &str, value: &Bound<'_, PyAny>) -> Result<Option<JointFriction>, Failure> {
    let known = value.py().import("armlet.friction_models")?;
    let bristles = value.is_instance(&known.getattr("LuGre")?)?;
    if !bristles && !value.is_instance(&known.getattr("StickSlip")?)? {
        return Ok(None);
    }
    let read = |name: &str| -> Result<Option<Vec<f64>>, Failure> {
        let given = value.getattr(name)?;
        if given.is_none() {
            return Ok(None);
        }
        let named = format!("{argument}.{name}");
        let (shape, values) = numbers(function, &named, &given, &[SCALAR, Form(&[Axis::Is(n)])])?;
        require_finite(value.py(), function, &named, &shape, &values)?;
        Ok(Some(spread(&shape, values, n)?))
    };
    let needed = |name: &str| -> Result<Vec<f64>, Failure> {
        let missing =
            || input_error(value.py(), function, &format!("{argument}.{name}"), "is missing: expected a scalar or (n,), got None");
        Ok(read(name)?.ok_or_else(missing)?)
    };
    let own = |error: Error| match error.argument().map(|name| format!("{argument}.{name}")) {
        Some(name) => error.of_argument(name),
        None => error,
    };
    let curve = FrictionCurve::new(needed("coulomb")?, read("static")?, read("stribeck_speed")?, read("viscous")?, read("load_ratio")?);
    let curve = curve.map_err(own)?;
    if !bristles {
        return Ok(Some(JointFriction::StickSlip(StickSlip { curve })));
    }
    Ok(Some(JointFriction::LuGre(LuGre::new(curve, needed("stiffness")?, read("damping")?).map_err(own)?)))
}
