//! Limits of the numbers in a robot's file. A number beyond its limit indicates a lost exponent or a wrong unit, and rounding errors would
//! dominate the dynamics. A crane, a ship, and a gantry with a model in millimetres are within the limits.

use crate::spatial::{Sym3, Vector, Vector3};

/// A negative principal moment counts as a rounding error down to this fraction of the largest entry.
const NEGATIVE: f64 = 1e-9;
/// A negative principal moment of at most this magnitude, kg m^2, also counts as a rounding error, because files print seven or eight
/// decimals. An example is -3.5e-8 for an antenna of one milligram. Such a moment can cause a warning about the triangle inequality.
const DIGITS: f64 = 1e-7;

/// The largest magnitude of a kind of number, and its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    pub most: f64,
    pub unit: &'static str,
}

pub const LENGTH: Bound = Bound { most: 1e6, unit: "m" };
pub const ANGLE: Bound = Bound { most: 1e6, unit: "rad" };
pub const MASS: Bound = Bound { most: 1e9, unit: "kg" };
pub const INERTIA: Bound = Bound { most: 1e15, unit: "kg m^2" };
/// The limit of armature, damping and Coulomb friction.
pub const DRIVE: Bound = Bound { most: 1e15, unit: "in SI units" };
/// The smallest and the largest length of a vector that is accepted as an axis.
pub const AXIS: [f64; 2] = [1e-6, 1e6];

impl Bound {
    /// Return the problem with the first value beyond the limit, if there is one.
    pub fn problem(&self, values: &[f64]) -> Option<String> {
        let beyond = values.iter().find(|x| !(x.abs() <= self.most))?;
        Some(format!("is implausible: expected at most {:e} {}, got {beyond:e}", self.most, self.unit))
    }
}

/// Return the problem with the length of an axis, if there is one. Single components have no limit.
pub fn axis_problem(axis: &[f64; 3]) -> Option<String> {
    let length = axis.iter().fold(0.0, |sum: f64, x| sum.hypot(*x));
    let [least, most] = AXIS;
    if (least..=most).contains(&length) {
        return None;
    }
    Some(format!("is implausible: expected a vector of a length from {least:e} to {most:e}, got {length:e}"))
}

/// Return the smallest principal moment about the centre of mass, if it is more negative than rounding errors explain.
///
/// Rounding errors come from the digits of the file, and from the shift of a body at `com` to its centre of mass.
pub fn negative_moment(moments: &Sym3<f64>, mass: f64, com: Vector3<f64>) -> Option<f64> {
    let largest = moments.0.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let moved = 1e-14 * mass * com.dot(com);
    Some(moments.principal()[0]).filter(|least| *least < -(NEGATIVE * largest + moved + DIGITS))
}
