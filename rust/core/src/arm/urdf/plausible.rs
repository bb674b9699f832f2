//! Bounds on the numbers of a robot's file. A number beyond them has a cause such as a lost exponent or a wrong unit, and rounding errors
//! dominate the dynamics. Every machine is within the bounds: a crane, a ship, a gantry with a model in millimetres.

use crate::spatial::{Sym3, Vector, Vector3};

/// Negative principal moments down to this fraction of the largest entry are rounding errors.
const NEGATIVE: f64 = 1e-9;
/// So are those down to this value, kg m^2, because files print seven or eight decimals. (An antenna of one milligram in a public robot has
/// -3.5e-8.) Smaller violations give a warning about the triangle inequality.
const DIGITS: f64 = 1e-7;

/// The kind of a number, and its largest magnitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    pub most: f64,
    pub unit: &'static str,
}

pub const LENGTH: Bound = Bound { most: 1e6, unit: "m" };
pub const ANGLE: Bound = Bound { most: 1e6, unit: "rad" };
pub const MASS: Bound = Bound { most: 1e9, unit: "kg" };
pub const INERTIA: Bound = Bound { most: 1e15, unit: "kg m^2" };
/// Armature, damping and Coulomb friction.
pub const DRIVE: Bound = Bound { most: 1e15, unit: "in SI units" };
/// Shortest and longest vector that is accepted as an axis.
pub const AXIS: [f64; 2] = [1e-6, 1e6];

impl Bound {
    /// The problem with the first value beyond the bound.
    pub fn problem(&self, values: &[f64]) -> Option<String> {
        let beyond = values.iter().find(|x| !(x.abs() <= self.most))?;
        Some(format!("is implausible: expected at most {:e} {}, got {beyond:e}", self.most, self.unit))
    }
}

/// The problem with the length of an axis. Its entries have no bounds.
pub fn axis_problem(axis: &[f64; 3]) -> Option<String> {
    let length = axis.iter().fold(0.0, |sum: f64, x| sum.hypot(*x));
    let [least, most] = AXIS;
    if (least..=most).contains(&length) {
        return None;
    }
    Some(format!("is implausible: expected a vector of a length from {least:e} to {most:e}, got {length:e}"))
}

/// The least principal moment about the centre of mass, if it is more negative than rounding errors explain.
///
/// The digits of the file are rounded, and so is the inertia of a body at `com` after its shift to the centre of mass.
pub fn negative_moment(moments: &Sym3<f64>, mass: f64, com: Vector3<f64>) -> Option<f64> {
    let largest = moments.0.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let moved = 1e-14 * mass * com.dot(com);
    Some(moments.principal()[0]).filter(|least| *least < -(NEGATIVE * largest + moved + DIGITS))
}
