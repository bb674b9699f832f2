//! A rigid arm driven by joint torques: `M(q) a + C(q, v) v + g(q) + friction = tau + J' W`.
//!
//! `W` is an external wrench, and `J'` the transposed Jacobian of its frame. A wall and stops add their forces. The state is `x = [q, v]`.
//! With LuGre friction, the deflections `z` of the bristles follow. The load `L` of this friction is `tau - sigma_0 z`, with the stiffness
//! `sigma_0` of the bristles.

use super::definition::fields;
use super::equations::{PlantAt, PlantEquations, PlantRates, Power};
use super::lugre::LoopLuGre;
use super::stick_slip::LoopStickSlip;
use super::stops::Stops;
use super::{Definition, FrictionCurve, JointFriction, Parameters, StickSlip, Wall};
use crate::dynamics::Model;
use crate::error::Result;
use crate::scalar::Real;
use crate::trace::expression::{stacked, zeros};
use crate::trace::{E, V};

/// A rigid arm, with validated parameters.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Model;
/// use armlet_core::law::{Gain, LawSpec, PdGravitySpec};
/// use armlet_core::plant::{PlantSpec, RigidSpec, Stops, Wall};
/// use armlet_core::simulate::{Options, Problem};
/// use nalgebra::dvector;
///
/// let model = Model::from(Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?);
/// let tip = model.tree("arm")?.frame_index("link2")?;
/// let plant = PlantSpec::from(RigidSpec {
///     friction: true,
///     // At x = 0.8 m, with the arm on its left.
///     wall: Some(Wall::new(tip, [0.8, 0.0, 0.0], [-1.0, 0.0, 0.0], 1e4, 50.0)?),
///     stops: Some(Stops::new(vec![-2.0; 2], vec![2.0; 2], vec![1e3; 2], vec![10.0; 2])?),
///     ..RigidSpec::new(model.clone())
/// });
/// let law = PdGravitySpec::new(model, dvector![0.0, 0.0], Gain::scalar("kp", 2, 100.0)?, Gain::scalar("kd", 2, 20.0)?)?;
/// let run = Problem::from_rest(&plant, &law.into(), &dvector![0.8, -0.2], Options::fixed(3.0, 1e-4))?.run()?;
/// // The target lies 0.1 m behind the wall, which holds the arm back.
/// assert!(run.positions().column(run.t.len() - 1).amax() > 0.1);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct RigidSpec {
    /// The model of the arm.
    pub model: Model,
    /// Whether the viscous and Coulomb friction of the model's joints acts.
    pub friction: bool,
    /// Whether `dry` is the friction of the model, which then acts only through `dry`: see [`RigidSpec::with_sticking_friction`].
    pub sticks: bool,
    /// Dry friction of the joints; `None` without it.
    pub dry: Option<JointFriction>,
    /// A wall that a frame may touch; `None` without a wall.
    pub wall: Option<Wall>,
    /// Joint stops; `None` without stops.
    pub stops: Option<Stops>,
}

impl RigidSpec {
    /// Create a plant without friction, wall and stops.
    pub fn new(model: Model) -> Self {
        RigidSpec { model, friction: false, sticks: false, dry: None, wall: None, stops: None }
    }

    /// Set the dry friction of the joints. Errors: `WrongShape` for a wrong number of joints.
    pub fn with_friction(self, friction: Option<JointFriction>) -> Result<Self> {
        friction.iter().try_for_each(|friction| friction.require_joints("friction", self.model.n()))?;
        Ok(RigidSpec { dry: friction, ..self })
    }

    /// Set the viscous and Coulomb friction of the model's joints, as stick-slip friction: it can hold a joint at rest. Errors: `Input` for
    /// a model without joint friction.
    pub fn with_sticking_friction(self) -> Result<Self> {
        self.model.tree("friction")?;
        let [viscous, coulomb] = self.model.friction(true);
        let curve = FrictionCurve::new(coulomb, None, None, Some(viscous), None)?;
        Ok(RigidSpec { friction: true, sticks: true, dry: Some(JointFriction::StickSlip(StickSlip { curve })), ..self })
    }

    /// Whether the model's Coulomb friction acts and cannot hold a joint at rest: its torque jumps where the velocity changes its sign.
    pub(super) fn jumps(&self) -> bool {
        self.friction && self.dry.is_none() && self.model.friction(true)[1].iter().any(|&coulomb| coulomb > 0.0)
    }
}

impl Definition for RigidSpec {
    fields!();

    fn has_friction(&self) -> bool {
        self.friction
    }

    fn initial_state(&self, q0: &[f64], v0: &[f64], _: Option<&[f64]>, _: Option<&[f64]>) -> Vec<f64> {
        let mut x = [q0, v0].concat();
        x.resize(x.len() + bristles(self.dry.as_ref()), 0.0);
        x
    }
}

/// Number of bristles of a friction.
pub(super) fn bristles(friction: Option<&JointFriction>) -> usize {
    friction.and_then(JointFriction::bristles).map_or(0, |bristles| bristles.curve.n())
}

/// The LuGre friction of a loop; `None` for another friction.
pub(super) fn loop_bristles(friction: Option<&JointFriction>) -> Option<LoopLuGre> {
    friction.and_then(JointFriction::bristles).map(LoopLuGre::new)
}

/// The stick-slip friction of a loop; `None` for another friction. `drives`: see [`LoopStickSlip::new`].
pub(super) fn loop_stick_slip<S: Real>(friction: Option<&JointFriction>, drives: bool) -> Option<LoopStickSlip<S>> {
    friction.and_then(JointFriction::stick_slip).map(|friction| LoopStickSlip::new(friction, drives))
}

impl Parameters {
    /// Add dry friction. `drives`: see [`LoopStickSlip::new`].
    pub(super) fn dry_friction(self, friction: Option<&JointFriction>, drives: bool) -> Self {
        let numbers = self.option(loop_bristles(friction), |numbers, friction| numbers.made("bristles", friction));
        numbers.option(loop_stick_slip::<E>(friction, drives), |numbers, friction| numbers.made("stick_slip", friction))
    }
}

impl PlantEquations for RigidSpec {
    fn parameters(&self) -> Parameters {
        Parameters::of_arm(&self.model).contacts(self.wall.as_ref(), self.stops.as_ref()).dry_friction(self.dry.as_ref(), true)
    }

    fn equations(&self, at: &PlantAt) -> PlantRates {
        let (arm, v) = (at.arm(), &at.x.v);
        let (mut torque, mut outside) = self.torque(at);
        let (mut z_dot, mut friction) = (zeros(0), None);
        if self.dry.as_ref().is_some_and(|dry| dry.bristles().is_some()) {
            let bristles: &LoopLuGre = at.numbers().get_made("bristles");
            let load = &at.tau - bristles.spring(&at.x.bristles);
            let rubbing = bristles.rub(v, &at.x.bristles, &load);
            torque -= &rubbing.torque;
            outside -= rubbing.lost;
            z_dot = rubbing.z_dot;
            friction = Some(rubbing.torque);
        }
        let a = match self.stick_slip(at) {
            None => arm.forward_dynamics(v, &torque),
            Some(mut sticking) => {
                let (a, tau_f) = sticking.motion(v);
                outside -= tau_f.dot(v);
                friction = Some(tau_f);
                a
            }
        };
        PlantRates { x_dot: stacked([v, &a, &z_dot]), power: Power { input: at.tau.dot(v), outside }, friction }
    }

    /// The friction with `A = M` and `b = torque - (C v + g)`.
    fn stick_slip(&self, at: &PlantAt) -> Option<LoopStickSlip<E>> {
        let mut sticking = at.held_friction()?;
        let (torque, _) = self.torque(at);
        sticking.load(&at.arm().mass_matrix(), &(torque - at.arm().bias(&at.x.v)), &at.tau);
        Some(sticking)
    }
}

impl RigidSpec {
    /// The torques on the joints without dry friction and without `C v + g`, `(n,)`, and their power without the input, W.
    fn torque(&self, at: &PlantAt) -> (V, E) {
        let (outside, mut power) = at.outside();
        let mut torque = &at.tau + outside;
        if self.friction && !self.sticks {
            let tau_f = at.arm().friction(&at.x.v);
            power -= tau_f.dot(&at.x.v);
            torque -= tau_f;
        }
        (torque, power)
    }
}
