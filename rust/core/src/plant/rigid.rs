//! A rigid arm driven by joint torques: `M(q) a + C(q, v) v + g(q) + friction = tau + J' W`.
//!
//! `W` is an external wrench, and `J'` the transposed Jacobian of its frame. A wall and stops add their forces. The state is `x = [q, v]`.
//! With LuGre friction, the deflections `z` of the bristles follow. The load `L` of this friction is `tau - sigma_0 z`, with the stiffness
//! `sigma_0` of the bristles.

use super::contact::LoopWall;
use super::definition::fields;
use super::lugre::LoopLuGre;
use super::stick_slip::{Load, LoopStickSlip};
use super::stops::{LoopStops, Stops};
use super::{Definition, FrictionCurve, JointFriction, Mode, Plant, Power, StickSlip, Wall};
use crate::dynamics::energy::friction_torque;
use crate::dynamics::{AnyArm, Dynamics, Model, Workspace};
use crate::error::Result;
use crate::scalar::Real;
use crate::spatial::Vector3;
use crate::trace::Sym;

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

/// The links of a plant, with the external forces on them.
pub(super) struct Links {
    pub arm: AnyArm<Sym>,
    pub ws: Workspace<Sym>,
    pub n: usize,
    force_frame: Option<usize>,
    wall: Option<LoopWall>,
    stops: Option<LoopStops>,
    /// The modes in which contacts are held, the wall first; empty if the modes follow the state.
    held: Vec<Mode<Sym>>,
    jacobian: Vec<Sym>,
    /// Sum of the torques on the joints, except `C v + g`, `(n,)`, N m or N.
    pub effort: Vec<Sym>,
}

impl Links {
    pub fn new(model: &Model, wall: Option<&Wall>, stops: Option<&Stops>, force_frame: Option<usize>) -> Self {
        let n = model.n();
        let arm = AnyArm::new(model);
        let wall = wall.map(LoopWall::new);
        let stops = stops.map(LoopStops::new);
        let contacts = usize::from(wall.is_some()) + stops.as_ref().map_or(0, LoopStops::len);
        let used = force_frame.is_some() || wall.is_some();
        Links {
            ws: arm.workspace(),
            arm,
            n,
            force_frame,
            wall,
            stops,
            held: Vec::with_capacity(contacts),
            jacobian: vec![Sym::zero(); if used { 6 * n } else { 0 }],
            effort: vec![Sym::zero(); n],
        }
    }

    /// Hold every contact in its mode of `contacts`. If `contacts` is empty, the modes follow the state.
    pub fn hold(&mut self, contacts: &mut dyn Iterator<Item = Mode<Sym>>) {
        self.held.clear();
        self.held.extend(contacts);
    }

    /// Return the depth `d` and the push `k d + c d_dot` of contact `i`. The wall has index 0 if it exists, and the stops follow.
    pub fn contact(&mut self, i: usize, trig: &[(Sym, Sym)], q: &[Sym], v: &[Sym]) -> [Sym; 2] {
        match (&self.wall, &self.stops) {
            (Some(wall), _) if i == 0 => {
                let (p, p_dot) = moving_frame((&self.arm, &mut self.ws), trig, (q, v), wall.frame, &mut self.jacobian);
                wall.contact(p, p_dot)
            }
            (wall, Some(stops)) => stops.contact(i - usize::from(wall.is_some()), q, v),
            _ => [Sym::zero(); 2],
        }
    }

    /// Add the torques of wrench, wall and stops to `self.effort`. Return the power of the wrench, minus the power lost in wall and stops,
    /// W.
    pub fn add_outside(&mut self, trig: &[(Sym, Sym)], q: &[Sym], v: &[Sym], wrench: &[Sym]) -> Sym {
        let mut power = Sym::zero();
        if let Some(frame) = self.force_frame {
            self.arm.jacobian(&mut self.ws, trig, q, frame, &mut self.jacobian);
            for i in 0..self.n {
                let mut torque = self.jacobian[i] * wrench[0];
                for k in 1..6 {
                    torque = self.jacobian[k * self.n + i].mul_add(wrench[k], torque);
                }
                self.effort[i] += torque;
                power = torque.mul_add(v[i], power);
            }
        }
        if let Some(wall) = &self.wall {
            let (p, p_dot) = moving_frame((&self.arm, &mut self.ws), trig, (q, v), wall.frame, &mut self.jacobian);
            let held = self.held.first().copied();
            let (f, lost) = wall.force(p, p_dot, held);
            for i in 0..self.n {
                for k in 0..3 {
                    self.effort[i] = self.jacobian[k * self.n + i].mul_add(f[k], self.effort[i]);
                }
            }
            power -= lost;
        }
        if let Some(stops) = &self.stops {
            let held = (!self.held.is_empty()).then(|| &self.held[usize::from(self.wall.is_some())..]);
            power -= stops.add(q, v, held, &mut self.effort);
        }
        power
    }

    /// Compute `a = M^-1 (effort - C v - g)`, `(n,)`.
    pub fn accelerate(&mut self, trig: &[(Sym, Sym)], q: &[Sym], v: &[Sym], a: &mut [Sym]) {
        self.arm.forward_dynamics(&mut self.ws, trig, q, v, &self.effort, a);
    }
}

/// Position and velocity of the origin of a frame, world axes. Afterwards `jacobian` has the Jacobian of this frame.
fn moving_frame(
    (arm, ws): (&AnyArm<Sym>, &mut Workspace<Sym>),
    trig: &[(Sym, Sym)],
    (q, v): (&[Sym], &[Sym]),
    frame: usize,
    jacobian: &mut [Sym],
) -> (Vector3<Sym>, Vector3<Sym>) {
    let p = arm.jacobian(ws, trig, q, frame, jacobian);
    let n = jacobian.len() / 6;
    let p_dot = Vector3::from(std::array::from_fn(|k| {
        let mut sum = Sym::zero();
        for i in 0..n {
            sum = jacobian[k * n + i].mul_add(v[i], sum);
        }
        sum
    }));
    (p, p_dot)
}

/// Set the data of the stick-slip friction under the plant's input `tau`: the mass matrix `A = M`, the torques `b = effort - (C v + g)`,
/// and the loads.
fn load(links: &mut Links, sticking: &mut LoopStickSlip<Sym>, trig: &[(Sym, Sym)], (q, v): (&[Sym], &[Sym]), tau: &[Sym]) {
    links.arm.mass_matrix(&mut links.ws, trig, q, &mut sticking.matrix);
    links.arm.bias(&mut links.ws, trig, q, v, &mut sticking.drive);
    for i in 0..links.n {
        sticking.drive[i] = links.effort[i] - sticking.drive[i];
        sticking.loads[i] = Load::Driven(tau[i]);
    }
}

/// A rigid arm in a control loop.
pub struct Rigid {
    links: Links,
    friction: bool,
    bristles: Option<LoopLuGre>,
    sticking: Option<LoopStickSlip<Sym>>,
}

impl Rigid {
    /// Subtract the friction of the model from the torques on the joints, if it acts. Return its power, <= 0, W.
    fn rub(&mut self, v: &[Sym]) -> Sym {
        let mut outside = Sym::zero();
        if let (true, AnyArm::Tree(tree)) = (self.friction, &self.links.arm) {
            for i in 0..self.links.n {
                let loss = friction_torque(tree.leader(i), v[i]);
                self.links.effort[i] -= loss;
                outside = loss.neg_mul_add(v[i], outside);
            }
        }
        outside
    }
}

impl RigidSpec {
    pub(super) fn build(&self, force_frame: Option<usize>) -> Rigid {
        Rigid {
            links: Links::new(&self.model, self.wall.as_ref(), self.stops.as_ref(), force_frame),
            friction: self.friction && !self.sticks,
            bristles: loop_bristles(self.dry.as_ref()),
            sticking: loop_stick_slip(self.dry.as_ref(), true),
        }
    }
}

impl Plant for Rigid {
    fn rates(&mut self, trig: &[(Sym, Sym)], x: &[Sym], tau: &[Sym], wrench: &[Sym], dx: &mut [Sym]) -> Power {
        let n = self.links.n;
        let (q, v) = (&x[..n], &x[n..2 * n]);
        let mut input = Sym::zero();
        for i in 0..n {
            self.links.effort[i] = tau[i];
            input = tau[i].mul_add(v[i], input);
            dx[i] = v[i];
        }
        let mut outside = self.rub(v);
        if let Some(bristles) = &self.bristles {
            for i in 0..n {
                let z = x[2 * n + i];
                let rubbing = bristles.rub(i, v[i], z, tau[i] - bristles.spring(i, z));
                self.links.effort[i] -= rubbing.torque;
                dx[2 * n + i] = rubbing.z_dot;
                outside -= rubbing.lost;
            }
        }
        outside += self.links.add_outside(trig, q, v, wrench);
        let a = &mut dx[n..2 * n];
        match &mut self.sticking {
            None => self.links.accelerate(trig, q, v, a),
            Some(sticking) => {
                load(&mut self.links, sticking, trig, (q, v), tau);
                sticking.slide(v);
                sticking.hold(a);
                for i in 0..n {
                    outside = sticking.torque()[i].neg_mul_add(v[i], outside);
                }
            }
        }
        Power { input, outside }
    }

    fn stick_slip(&mut self) -> Option<(&mut LoopStickSlip<Sym>, usize)> {
        Some((self.sticking.as_mut()?, self.links.n))
    }

    fn load_friction(&mut self, trig: &[(Sym, Sym)], x: &[Sym], tau: &[Sym], wrench: &[Sym]) {
        if self.sticking.is_none() {
            return;
        }
        let (q, v) = x.split_at(self.links.n);
        self.links.effort.copy_from_slice(tau);
        self.rub(v);
        self.links.add_outside(trig, q, v, wrench);
        if let Some(sticking) = &mut self.sticking {
            load(&mut self.links, sticking, trig, (q, v), tau);
        }
    }

    fn hold(&mut self, contacts: &mut dyn Iterator<Item = Mode<Sym>>) {
        self.links.hold(contacts);
    }

    fn contact(&mut self, i: usize, trig: &[(Sym, Sym)], x: &[Sym]) -> [Sym; 2] {
        let n = self.links.n;
        self.links.contact(i, trig, &x[..n], &x[n..2 * n])
    }
}

#[cfg(test)]
mod tests {
    use super::super::recorded::function_of;
    use super::*;
    use crate::arm::Arm;

    /// The friction of the model and stick-slip friction act together. `rates` and `load_friction` must then compute the same torques.
    #[test]
    fn both_evaluations_have_the_same_torques() {
        let mut arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81]).unwrap();
        for joint in &mut arm.joints {
            (joint.damping, joint.friction) = (0.3, 0.2);
        }
        let curve = FrictionCurve::new(vec![0.1; 2], None, None, None, None).unwrap();
        let dry = Some(JointFriction::StickSlip(StickSlip { curve }));
        for friction in [false, true] {
            let spec = RigidSpec { friction, dry: dry.clone(), ..RigidSpec::new(Model::from(arm.clone())) };
            let drive = |plant: &Rigid| plant.sticking.as_ref().map_or(Vec::new(), |sticking| sticking.drive.clone());
            let torques = function_of(
                &spec.clone().into(),
                || spec.build(None),
                |mut plant, at| {
                    plant.rates(&at.trig, at.x, at.tau, at.wrench, &mut [Sym::zero(); 4]);
                    let moving = drive(&plant);
                    plant.load_friction(&at.trig, at.x, at.tau, at.wrench);
                    [moving, drive(&plant)].concat()
                },
            );
            let mut torques = torques.interpreted(false);
            torques.inputs(0, 6).copy_from_slice(&[0.3, -0.4, 0.7, -0.2, 1.0, 2.0]);
            torques.run();
            assert_eq!(torques.outputs(0, 2), torques.outputs(2, 2), "friction: {friction}");
            assert!(torques.outputs(0, 2).iter().all(|torque| torque.abs() > 0.1));
        }
    }
}
