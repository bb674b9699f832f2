//! The LuGre model of friction (Canudas de Wit, Olsson, Astrom and Lischinsky 1995). Bristles between the sliding surfaces have the
//! deflection `z`:
//!
//! `z' = v - sigma_0 |v| z / h(v, L)`, `tau_f = sigma_0 z + sigma_1 z' + sigma_2 v`,
//!
//! with the joint velocity `v`, the load `L` of the joint and the curve `h` of [`FrictionCurve`]. `z'` is the time derivative, and `tau_f`
//! the friction torque. The bristles store the energy `sigma_0 z^2 / 2`. The rest of the power `tau_f v` is lost.

use super::friction_curve::{FrictionCurve, LoopCurve, require, require_rows};
use crate::error::Result;
use crate::scalar::labelled_numbers;
use crate::trace::expression::{constant, magnitudes, vector};
use crate::trace::{E, V};

/// Friction with bristles; each parameter is `(n,)`.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Model;
/// use armlet_core::plant::{FrictionCurve, JointFriction, LuGre, PlantSpec, RigidSpec};
///
/// let bristles = LuGre::new(FrictionCurve::new(vec![2.0], None, None, Some(vec![0.5]), None)?, vec![1e4], None)?;
/// assert_eq!(bristles.damping, [0.0]);
/// // The deflections of the bristles are states.
/// let arm = RigidSpec::new(Model::from(Arm::pendulum(1.0, 5.0)?));
/// let plant = PlantSpec::from(arm.with_friction(Some(JointFriction::LuGre(bristles)))?);
/// assert_eq!((plant.seen(), plant.bristles(), plant.states()), (2, 1, 3));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct LuGre {
    /// Friction curve `h(v, L)`. Its viscous part is `sigma_2`.
    pub curve: FrictionCurve,
    /// Stiffness `sigma_0` of the bristles, N m/rad or N/m.
    pub stiffness: Vec<f64>,
    /// Damping `sigma_1` of the bristles, N m s/rad or N s/m.
    pub damping: Vec<f64>,
}

impl LuGre {
    /// Create bristles with a friction curve, a stiffness and a damping, `(n,)` each. `None` means zero damping.
    ///
    /// Errors: `WrongShape` for unequal lengths. `Input` for a stiffness or Coulomb friction that is not positive, or a negative damping.
    /// Also `Input` for a Stribeck speed of zero where static friction exceeds Coulomb friction.
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

/// The friction of bristles at one instant.
pub(super) struct Rubbing {
    /// Friction torques `tau_f`, `(n,)`, N m or N.
    pub torque: V,
    /// Rates `z'` of the deflections, `(n,)`, rad/s or m/s.
    pub z_dot: V,
    /// The power that friction loses, W. It excludes the power that the bristles store.
    pub lost: E,
}

/// LuGre friction in a control loop.
pub(super) struct LoopLuGre {
    curve: LoopCurve<E>,
    stiffness: V,
    damping: V,
}

impl LoopLuGre {
    pub fn new(friction: &LuGre) -> Self {
        LoopLuGre {
            curve: LoopCurve::new(&friction.curve),
            stiffness: V::from_vec(labelled_numbers("bristle_stiffness", &friction.stiffness)),
            damping: V::from_vec(labelled_numbers("bristle_damping", &friction.damping)),
        }
    }

    /// The torques of the bristles, `sigma_0 z`, `(n,)`.
    pub fn spring(&self, z: &V) -> V {
        self.stiffness.component_mul(z)
    }

    /// The friction at the speeds `v`, with the deflections `z` and the loads `load`, `(n,)` each.
    pub fn rub(&self, v: &V, z: &V, load: &V) -> Rubbing {
        let spring = self.spring(z);
        let h = V::from_fn(v.len(), |i, _| self.curve.level(i, v[i], load[i]));
        let z_dot = v - magnitudes(v).component_mul(&spring).component_div(&h);
        let viscous = vector(&self.curve.viscous).component_mul(v);
        let torque = &spring + self.damping.component_mul(&z_dot) + viscous;
        let lost = torque.dot(v) - spring.dot(&z_dot);
        Rubbing { torque, z_dot, lost }
    }

    /// The stored energy `sum sigma_0 z^2 / 2`, J.
    pub fn energy(&self, z: &V) -> E {
        constant(0.5) * z.dot(&self.spring(z))
    }
}
