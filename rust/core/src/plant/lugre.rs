//! The LuGre model of friction (Canudas de Wit, Olsson, Astrom and Lischinsky 1995): bristles of deflection `z` slip,
//!
//! `z' = v - sigma_0 |v| z / h(v, L)`, `tau_f = sigma_0 z + sigma_1 z' + sigma_2 v`,
//!
//! with the curve `h` of [`FrictionCurve`]. They store `sigma_0 z^2 / 2`; the rest of the power `tau_f v` is lost.

use super::friction::{FrictionCurve, LaneCurve, require, require_rows};
use crate::error::Result;
use crate::scalar::Real;

/// Friction with bristles, `(n,)` numbers each.
#[derive(Clone, Debug, PartialEq)]
pub struct LuGre {
    /// `h(v, L)`, with `sigma_2` as its viscous part.
    pub curve: FrictionCurve,
    /// `sigma_0`, N m/rad or N/m.
    pub stiffness: Vec<f64>,
    /// `sigma_1`, N m s/rad or N s/m.
    pub damping: Vec<f64>,
}

impl LuGre {
    /// Bristles of this stiffness and damping (zero unless given) under a curve.
    pub fn new(curve: FrictionCurve, stiffness: Vec<f64>, damping: Option<Vec<f64>>) -> Result<Self> {
        let n = curve.n();
        let damping = damping.unwrap_or_else(|| vec![0.0; n]);
        require_rows("stiffness", &stiffness, n)?;
        require_rows("damping", &damping, n)?;
        require("coulomb", &curve.coulomb, "> 0", |_, x| x > 0.0)?;
        require("stiffness", &stiffness, "> 0", |_, x| x > 0.0)?;
        require("damping", &damping, ">= 0", |_, x| x >= 0.0)?;
        let speed = |i: usize, x: f64| x > 0.0 || curve.breakaway[i] == curve.coulomb[i];
        require("stribeck_speed", &curve.stribeck_speed, "> 0 where static exceeds coulomb", speed)?;
        Ok(LuGre { curve, stiffness, damping })
    }
}

/// The results of the bristles of a joint.
pub(super) struct Rubbing<S> {
    /// `tau_f`.
    pub torque: S,
    /// `z'`.
    pub z_dot: S,
    /// The power lost, without the power that the bristles store.
    pub lost: S,
}

/// The bristles of the lanes.
pub(super) struct LaneLuGre<S> {
    curve: LaneCurve<S>,
    pub stiffness: Vec<S>,
    damping: Vec<S>,
}

impl<S: Real> LaneLuGre<S> {
    pub fn new<'a>(of: impl Fn(usize) -> &'a LuGre) -> Self {
        let n = of(0).curve.n();
        let numbers = |name, f: &dyn Fn(&LuGre, usize) -> f64| {
            S::labelled(name, 1, || (0..n).map(|i| S::from_lanes(|lane| f(of(lane), i))).collect::<Vec<S>>())
        };
        LaneLuGre {
            curve: LaneCurve::new(|lane| &of(lane).curve),
            stiffness: numbers("bristle_stiffness", &|friction, i| friction.stiffness[i]),
            damping: numbers("bristle_damping", &|friction, i| friction.damping[i]),
        }
    }

    /// The torque of the bristles of joint `i`, `sigma_0 z`.
    pub fn spring(&self, i: usize, z: S) -> S {
        self.stiffness[i] * z
    }

    /// Joint `i` at speed `v`, under the load `L`.
    pub fn rub(&self, i: usize, v: S, z: S, load: S) -> Rubbing<S> {
        let spring = self.spring(i, z);
        let z_dot = v - v.abs() * spring / self.curve.level(i, v, load);
        let torque = self.curve.viscous[i].mul_add(v, self.damping[i].mul_add(z_dot, spring));
        Rubbing { torque, z_dot, lost: spring.neg_mul_add(z_dot, torque * v) }
    }

    /// `sum sigma_0 z^2 / 2`.
    pub fn energy(&self, z: &[S]) -> S {
        let mut twice = S::zero();
        for (&stiffness, &z) in self.stiffness.iter().zip(z) {
            twice = (stiffness * z).mul_add(z, twice);
        }
        S::splat(0.5) * twice
    }
}
