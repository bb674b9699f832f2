//! The compiled form of an arm, on which the algorithms run.
//!
//! Each body has a compiled frame, with the origin on the joint and z along the joint axis. So the motion subspace is `e_z`. In a product
//! with a joint rotation, only the first two columns of the other matrix change. `turn` is the rotation from the compiled frame to the body
//! frame of the model.

use super::{Arm, Joining};
use crate::interrupt;
use crate::memory::cloned;
use crate::scalar::Real;
use crate::spatial::{Inertia, Lift, Matrix, Matrix3, PARAMETERS, Placement, QuarterTurn, RotationMatrix, Sym3, Vector3};

/// The labels of the first moment of a body, for listings of recorded computations (`trace`). The label of its mass is `m`.
const MOMENT: [&str; 3] = ["mx", "my", "mz"];
const INERTIA: [&str; 6] = ["Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz"];
const SECOND_MOMENT: [&str; 6] = ["Sxx", "Sxy", "Syy", "Sxz", "Syz", "Szz"];

/// The parent of a body on the fixed base.
pub const BASE: usize = usize::MAX;

/// A body with its joint. Its *compiled frame* has the origin on the joint, and z along the joint axis.
///
/// ```
/// use armlet_core::arm::{Arm, BASE, Tree};
///
/// let tree = Tree::<f64>::new(&Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?);
/// let (upper, lower) = (&tree.bodies[0], &tree.bodies[1]);
/// assert_eq!((upper.parent, upper.end, lower.parent), (BASE, 2, 0));
/// assert!(lower.revolute && lower.translation.x == 0.5 && lower.inertia.mass == 0.4);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Body<S: Real> {
    /// The index of the parent body, or [`BASE`]. Parents precede children.
    pub parent: usize,
    /// The index after the last body that this body moves. This body moves all bodies between itself and `end`, because the order is depth
    /// first.
    pub end: usize,
    /// Whether a body other than the next one is a child of this body. Recursions then store the results of this body for that child.
    pub forks: bool,
    /// Whether the body rotates about its axis. If false, it slides along the axis.
    pub revolute: bool,
    /// The placement of the joint in the parent's compiled frame at `q = 0`.
    pub rotation: Matrix3<f64>,
    /// The quarter turn that equals `rotation`, if there is one.
    pub quarter: Option<QuarterTurn>,
    pub translation: Vector3<f64>,
    /// Whether the joint's origin equals the parent's origin in every state, as in a spherical wrist. Then first moments and inertias are
    /// not shifted from one origin to the other.
    pub concentric: bool,
    /// The inertia in compiled axes, about the joint origin.
    pub inertia: Inertia<S>,
    /// The second moment of mass, `integral of r r' dm = tr(I)/2 1 - I`, kg m^2.
    pub second_moment: Sym3<S>,
    /// The rotation `x_body = turn x_compiled`. `None` if the two frames are equal.
    pub turn: Option<Matrix3<f64>>,
    pub armature: S,
    pub damping: S,
    pub friction: S,
}

/// A frame that is fixed to a body, in the body's compiled axes. If `body` is [`BASE`], it is fixed to the base.
///
/// ```
/// use armlet_core::arm::{Arm, Tree};
///
/// let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
/// let tip = &Tree::<f64>::new(&arm).frames[arm.frame_index("link2")?];
/// assert_eq!((tip.body, tip.placement.translation.x), (1, 0.4));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct TreeFrame {
    pub body: usize,
    pub placement: Placement,
}

/// An arm in the form on which the algorithms run, over any number type.
///
/// ```
/// use armlet_core::arm::{Arm, Tree};
/// use armlet_core::dynamics::Dynamics;
///
/// // A pendulum with the gravity torque `5 sin q`.
/// let tree = Tree::<f64>::new(&Arm::pendulum(1.0, 5.0)?);
/// let (q, mut g) = ([0.3f64], [0.0]);
/// tree.gravity(&mut tree.workspace(), &[q[0].sin_cos()], &q, &mut g);
/// assert!((g[0] - 5.0 * 0.3f64.sin()).abs() < 1e-15);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Tree<S: Real> {
    pub bodies: Vec<Body<S>>,
    pub frames: Vec<TreeFrame>,
    pub gravity: Vector3<f64>,
    /// The map from coordinates to bodies, in an arm with mimic joints.
    pub joining: Option<Joining>,
    /// Whether the branches of the tree are short. Forward dynamics with the mass matrix is then faster than with articulated bodies.
    pub is_shallow: bool,
}

/// The largest mean length of the paths from the base to the bodies of a shallow tree, in joints. A joint whose placement is not a quarter
/// turn counts as [`GENERAL`] joints. A shallow tree also has at most [`MOST_JOINTS`] joints. For such trees, forward dynamics with the
/// mass matrix is faster (`docs/adr/0008`).
const SHALLOW: f64 = 7.0;
/// The relative computing time of a joint whose placement is not a quarter turn. The unit is the time of a joint with a quarter turn.
const GENERAL: f64 = 1.25;
/// The number of joints up to which a workspace has memory for the mass matrix: 0.5 MB.
const MOST_JOINTS: usize = 256;

/// Return whether the branches of the tree are short, see [`Tree::is_shallow`].
fn is_shallow(bodies: &[Body<f64>]) -> bool {
    let carried = |i: usize, body: &Body<f64>| (body.end - i) as f64 * if body.quarter.is_some() { 1.0 } else { GENERAL };
    let mean_fits = || bodies.iter().enumerate().map(|(i, body)| carried(i, body)).sum::<f64>() <= SHALLOW * bodies.len() as f64;
    bodies.len() <= MOST_JOINTS && mean_fits()
}

impl Tree<f64> {
    fn compile(arm: &Arm) -> Self {
        let mut turns: Vec<Matrix3<f64>> = Vec::with_capacity(arm.joints.len());
        for joint in &arm.joints {
            interrupt::check();
            let before = joint.parent.map_or(Matrix3::IDENTITY, |p| turns[p]).transpose().times(joint.placement.rotation);
            turns.push(compiled_axes(&before, Vector3::from(joint.axis)));
        }
        let parent_turn = |parent: Option<usize>| parent.map_or(Matrix3::IDENTITY, |p| turns[p]).transpose();
        let mut ends: Vec<usize> = (1..=arm.joints.len()).collect();
        let (mut forks, mut sizes) = (vec![false; arm.joints.len()], vec![1; arm.joints.len()]);
        for (i, joint) in arm.joints.iter().enumerate().rev() {
            if let Some(p) = joint.parent {
                ends[p] = ends[p].max(ends[i]);
                forks[p] |= p + 1 != i;
                sizes[p] += sizes[i];
            }
        }
        debug_assert!((0..ends.len()).all(|i| ends[i] - i == sizes[i]), "the order of joints is not depth first");
        let bodies: Vec<Body<f64>> = arm
            .joints
            .iter()
            .enumerate()
            .map(|(i, joint)| {
                interrupt::check();
                let back = parent_turn(joint.parent);
                let rotation = back.times(joint.placement.rotation).times(turns[i]);
                let (translation, revolute) = (back.apply(joint.placement.translation), joint.kind.is_angle());
                Body {
                    parent: joint.parent.unwrap_or(BASE),
                    end: ends[i],
                    forks: forks[i],
                    revolute,
                    rotation,
                    quarter: QuarterTurn::of(&rotation),
                    translation,
                    concentric: revolute && translation == Vector3::from([0.0; 3]),
                    inertia: Inertia::zero(),
                    second_moment: Sym3::zero(),
                    turn: (turns[i] != Matrix3::IDENTITY).then_some(turns[i]),
                    armature: joint.armature,
                    damping: joint.damping,
                    friction: joint.friction,
                }
            })
            .collect();
        let frames = arm
            .frames
            .iter()
            .map(|frame| {
                interrupt::check();
                let back = Placement { rotation: parent_turn(frame.body), translation: Vector3::from([0.0; 3]) };
                TreeFrame { body: frame.body.unwrap_or(BASE), placement: back.then(&frame.placement) }
            })
            .collect();
        let (shallow, gravity) = (is_shallow(&bodies), Vector3::from(arm.gravity));
        let mut tree = Tree { is_shallow: shallow, bodies, frames, gravity, joining: arm.joining() };
        tree.set_parameters(&arm.parameters());
        tree
    }

    /// Return the tree on another number type.
    pub fn lift<S: Real>(&self) -> Tree<S> {
        let number = |name, i: usize, x: f64| S::labelled(name, i as u32 + 1, || S::parameter(x));
        let lifted = |i: usize, body: &Body<f64>| Body {
            inertia: Inertia {
                mass: number("m", i, body.inertia.mass),
                moment: Vector3::from(std::array::from_fn(|k| number(MOMENT[k], i, body.inertia.moment[k]))),
                inertia: Sym3(std::array::from_fn(|k| number(INERTIA[k], i, body.inertia.inertia.0[k]))),
            },
            second_moment: Sym3(std::array::from_fn(|k| number(SECOND_MOMENT[k], i, body.second_moment.0[k]))),
            parent: body.parent,
            end: body.end,
            forks: body.forks,
            revolute: body.revolute,
            rotation: body.rotation,
            quarter: body.quarter,
            translation: body.translation,
            concentric: body.concentric,
            turn: body.turn,
            armature: S::fixed(body.armature),
            damping: S::fixed(body.damping),
            friction: S::fixed(body.friction),
        };
        Tree {
            bodies: self
                .bodies
                .iter()
                .enumerate()
                .map(|(i, body)| {
                    interrupt::check();
                    lifted(i, body)
                })
                .collect(),
            frames: cloned(&self.frames),
            gravity: self.gravity,
            joining: self.joining.clone(),
            is_shallow: self.is_shallow,
        }
    }
}

impl<S: Real> Tree<S> {
    /// Compile an arm. The compilation uses `f64`, so that the numbers of the tree are the same for every number type.
    pub fn new(arm: &Arm) -> Self {
        Tree::compile(arm).lift()
    }

    /// Set the inertial parameters, shape `(10 bodies,)`, in the body frames of the model, in the order of [`crate::spatial`].
    pub fn set_parameters(&mut self, pi: &[S]) {
        for (body, p) in self.bodies.iter_mut().zip(pi.chunks_exact(PARAMETERS)) {
            interrupt::check();
            let given = Inertia::from_parameters(p);
            body.inertia = match body.turn {
                None => given,
                Some(turn) => given.rotated(turn.lift::<S>().transpose()),
            };
            body.second_moment = second_moment(&body.inertia.inertia);
        }
    }

    /// Write the inertial parameters, shape `(10 bodies,)`, in the layout of [`Tree::set_parameters`]. Up to rounding, they equal the
    /// parameters that were set.
    pub fn write_parameters(&self, pi: &mut [S]) {
        for (body, p) in self.bodies.iter().zip(pi.chunks_exact_mut(PARAMETERS)) {
            let inertia = match body.turn {
                None => body.inertia,
                Some(turn) => body.inertia.rotated(turn.lift()),
            };
            inertia.write_parameters(p);
        }
    }

    /// The number of coordinates: the number of joints that are not mimic joints.
    #[inline]
    pub fn n(&self) -> usize {
        self.joining.as_ref().map_or(self.bodies.len(), |joining| joining.leaders.len())
    }

    /// The coordinate that moves a body, and the rate of the body's joint divided by the rate of the coordinate.
    #[inline]
    pub fn mover(&self, body: usize) -> (usize, f64) {
        self.joining.as_ref().map_or((body, 1.0), |joining| (joining.rows[body].0, joining.rows[body].1))
    }

    /// The body of the joint of a coordinate.
    #[inline]
    pub fn leader(&self, coordinate: usize) -> &Body<S> {
        &self.bodies[self.joining.as_ref().map_or(coordinate, |joining| joining.leaders[coordinate])]
    }

    /// The sine, the cosine and the position of a body's joint, computed from the sines, cosines and positions of the coordinates.
    #[inline]
    pub fn position(&self, body: usize, trig: &[(S, S)], q: &[S]) -> ((S, S), S) {
        let Some(joining) = &self.joining else { return (trig[body], q[body]) };
        let (k, multiplier, offset) = joining.rows[body];
        if joining.leaders[k] == body {
            return (trig[k], q[k]);
        }
        let position = S::splat(multiplier).mul_add(q[k], S::splat(offset));
        (position.sin_cos(), position)
    }

    /// The rate of a body's joint, from the rates of the coordinates.
    #[inline]
    pub fn rate(&self, body: usize, v: &[S]) -> S {
        let Some(joining) = &self.joining else { return v[body] };
        let (k, multiplier, _) = joining.rows[body];
        S::splat(multiplier) * v[k]
    }
}

/// Return the axes of a body's compiled frame in the joint frame, as the columns of a rotation matrix. The third column is `axis`. `before`
/// is the rotation of the joint frame in the parent's compiled frame. If possible, the product of `before` and the result is a quarter
/// turn. If `axis` is the z axis, the result is the identity.
fn compiled_axes(before: &Matrix3<f64>, axis: Vector3<f64>) -> Matrix3<f64> {
    let mut turn = Matrix3::taking_z_to(axis);
    let first = turn;
    if turn != Matrix3::IDENTITY {
        for _ in 0..4 {
            if QuarterTurn::of(&before.times(turn)).is_some() {
                return turn;
            }
            let [x, y, z] = turn.axes();
            turn = Matrix3::from_columns(&[y, -x, z]);
        }
    }
    first
}

/// Return the second moment `tr(I)/2 1 - I`, kg m^2, of the inertia `I`.
pub fn second_moment<S: Real>(inertia: &Sym3<S>) -> Sym3<S> {
    let [xx, xy, yy, xz, yz, zz] = inertia.0;
    let half_trace = S::splat(0.5) * (xx + yy + zz);
    Sym3([half_trace - xx, -xy, half_trace - yy, -xz, -yz, half_trace - zz])
}
