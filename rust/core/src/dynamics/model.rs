//! Any arm, chosen at run time: the planar PR arm in closed form (`planar_pr`), or a tree of bodies (`tree`).
//!
//! Each quantity is a function that is not inlined. So laws and plants share one copy of the code, and each use costs one call.

use super::workspace::Workspace;
use super::{Dynamics, JointTerms, PlanarPr, Query, Size, newton_euler};
use crate::arm::{Arm, Joint, Tree};
use crate::error::{Error, Result};
use crate::kinematics::{self, Coordinates};
use crate::scalar::Real;
use crate::spatial::{Vector, Vector3, parameter};
use std::sync::Arc;

/// An arm as the user defines it.
#[derive(Clone, Debug, PartialEq)]
pub enum Model {
    /// The planar arm of one prismatic and one revolute joint, in closed form.
    PlanarPr(PlanarPr<f64>),
    /// A tree of bodies.
    Tree(Arc<Arm>),
}

impl From<Arm> for Model {
    fn from(arm: Arm) -> Self {
        Model::Tree(Arc::new(arm))
    }
}

impl Model {
    /// Number of coordinates `n`: the number of joints that are not mimic joints.
    pub fn n(&self) -> usize {
        match self {
            Model::PlanarPr(_) => 2,
            Model::Tree(arm) => arm.n(),
        }
    }

    /// The numbers of coordinates and bodies.
    pub fn size(&self) -> Size {
        match self {
            Model::PlanarPr(_) => Size { n: 2, bodies: 2 },
            Model::Tree(arm) => arm.size(),
        }
    }

    /// Approximate number of operations of a query.
    pub(crate) fn operations(&self, query: &Query) -> f64 {
        let pairs = match self {
            Model::PlanarPr(_) => 3,
            Model::Tree(arm) => arm.pairs(),
        };
        query.operations(self.size(), pairs)
    }

    /// Number of inertial parameters `p`.
    pub fn parameter_count(&self) -> usize {
        self.parameters().len()
    }

    /// Inertial parameters, `(p,)`, in SI units.
    pub fn parameters(&self) -> Vec<f64> {
        match self {
            Model::PlanarPr(arm) => arm.parameter_array().to_vec(),
            Model::Tree(arm) => arm.parameters(),
        }
    }

    /// Whether each coordinate is an angle, which enters through its sine and cosine.
    pub fn angles(&self) -> Vec<bool> {
        match self {
            Model::PlanarPr(_) => vec![false, true],
            Model::Tree(arm) => arm.independent().map(|joint| joint.kind.is_angle()).collect(),
        }
    }

    /// Whether each coordinate turns without end ([`Arm::turns_freely`]), `(n,)`. The planar PR arm has no joint limits.
    pub fn turns_freely(&self) -> Vec<bool> {
        match self {
            Model::PlanarPr(_) => vec![false, true],
            Model::Tree(arm) => arm.turns_freely(),
        }
    }

    /// Rotor inertia of each joint, `(n,)`, kg m^2 or kg. It is not one of the inertial parameters.
    pub fn armature(&self) -> Vec<f64> {
        match self {
            Model::PlanarPr(_) => vec![0.0; 2],
            Model::Tree(arm) => arm.independent().map(|joint| joint.armature).collect(),
        }
    }

    /// Viscous friction (N m s/rad or N s/m) and Coulomb friction (N m or N), `(n,)` each; zero if `acts` is false.
    pub fn friction(&self, acts: bool) -> [Vec<f64>; 2] {
        let of_joints = |get: fn(&Joint) -> f64| match self {
            Model::Tree(arm) if acts => arm.independent().map(get).collect(),
            Model::Tree(_) | Model::PlanarPr(_) => vec![0.0; self.n()],
        };
        [of_joints(|joint| joint.damping), of_joints(|joint| joint.friction)]
    }

    /// Names of the columns of the regressor: inertial parameters, then the joint terms: armature, damping, friction and offset. The planar
    /// PR arm has only `A`, `B` and `C`.
    pub fn column_names(&self, terms: JointTerms) -> Vec<String> {
        let Model::Tree(arm) = self else { return ["A", "B", "C"].map(String::from).to_vec() };
        let of_joints = |what: &'static str| arm.joint_names().map(move |joint| format!("{what}[{joint}]"));
        let mut names: Vec<String> =
            arm.joints.iter().flat_map(|joint| parameter::NAMES.iter().map(move |name| format!("{name}[{}]", joint.name))).collect();
        let kinds = [(terms.armature, "armature"), (terms.friction, "damping"), (terms.friction, "friction"), (terms.offset, "offset")];
        for (_, kind) in kinds.into_iter().filter(|(present, _)| *present) {
            names.extend(of_joints(kind));
        }
        names
    }

    /// The tree of bodies. Errors: `Input`, about `argument`, for the planar PR arm.
    pub fn tree(&self, argument: &str) -> Result<&Arc<Arm>> {
        match self {
            Model::Tree(arm) => Ok(arm),
            Model::PlanarPr(_) => Err(Error::input(argument, "has no links: expected an arm with a kinematic model, got planar_pr")),
        }
    }

    /// Whether both arms have the same joints, frames and gravity. Inertial parameters may differ.
    pub fn same_geometry(&self, other: &Model) -> bool {
        match (self, other) {
            (Model::PlanarPr(_), Model::PlanarPr(_)) => true,
            (Model::Tree(a), Model::Tree(b)) => {
                Arc::ptr_eq(a, b)
                    || (a.gravity == b.gravity
                        && a.frames == b.frames
                        && a.mimics == b.mimics
                        && a.joints.len() == b.joints.len()
                        && a.joints.iter().zip(&b.joints).all(|(x, y)| {
                            let mut x = x.clone();
                            x.parameters = y.parameters;
                            x == *y
                        }))
            }
            _ => false,
        }
    }
}

/// A model on the number type `S`.
///
/// ```
/// use armlet_core::dynamics::{AnyArm, Dynamics, Model, PlanarPr};
///
/// // The mass matrix at q2 = 0: M12 = B cos q2.
/// let model = PlanarPr::new(3.0, 0.5, 0.2).map(Model::PlanarPr)?;
/// let arm = AnyArm::<f64>::new(&model);
/// let (q, mut m) = ([0.0f64; 2], [0.0; 4]);
/// arm.mass_matrix(&mut arm.workspace(), &q.map(f64::sin_cos), &q, &mut m);
/// assert_eq!(m, [3.0, 0.5, 0.5, 0.2]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug)]
pub enum AnyArm<S: Real> {
    /// The planar PR arm in closed form.
    PlanarPr(PlanarPr<S>),
    /// A tree of bodies.
    Tree(Tree<S>),
}

impl<S: Real> AnyArm<S> {
    /// Create the arm of a model.
    pub fn new(model: &Model) -> Self {
        match model {
            Model::PlanarPr(arm) => AnyArm::PlanarPr(arm.lift()),
            Model::Tree(arm) => AnyArm::Tree(Tree::new(arm)),
        }
    }

    /// The tree; `None` for the planar PR arm in closed form.
    pub fn tree(&self) -> Option<&Tree<S>> {
        match self {
            AnyArm::PlanarPr(_) => None,
            AnyArm::Tree(tree) => Some(tree),
        }
    }
}

/// A quantity as a function that is not inlined: `$name(ws, trig, inputs.., outputs..)`.
macro_rules! not_inlined {
    ($name:ident, [$($input:ident),*], [$($output:ident),+]) => {
        #[inline(never)]
        fn $name(&self, ws: &mut Workspace<S>, trig: &[(S, S)], $($input: &[S],)* $($output: &mut [S]),+) {
            match self {
                AnyArm::PlanarPr(arm) => arm.$name(&mut (), trig, $($input,)* $($output),+),
                AnyArm::Tree(arm) => arm.$name(ws, trig, $($input,)* $($output),+),
            }
        }
    };
}

impl<S: Real> Dynamics<S> for AnyArm<S> {
    type Workspace = Workspace<S>;

    fn workspace(&self) -> Workspace<S> {
        match self {
            AnyArm::PlanarPr(_) => Workspace::new(&Tree {
                bodies: Vec::new(),
                frames: Vec::new(),
                gravity: Vector3::from([0.0; 3]),
                joining: None,
                is_shallow: false,
            }),
            AnyArm::Tree(tree) => Workspace::new(tree),
        }
    }
    fn dof(&self) -> usize {
        match self {
            AnyArm::PlanarPr(_) => 2,
            AnyArm::Tree(tree) => tree.n(),
        }
    }
    fn parameter_count(&self) -> usize {
        match self {
            AnyArm::PlanarPr(arm) => arm.parameter_count(),
            AnyArm::Tree(tree) => tree.parameter_count(),
        }
    }
    fn is_angle(&self, joint: usize) -> bool {
        match self {
            AnyArm::PlanarPr(arm) => arm.is_angle(joint),
            AnyArm::Tree(tree) => tree.is_angle(joint),
        }
    }
    fn parameters(&self, pi: &mut [S]) {
        match self {
            AnyArm::PlanarPr(arm) => arm.parameters(pi),
            AnyArm::Tree(tree) => tree.parameters(pi),
        }
    }

    not_inlined!(mass_matrix, [q], [m]);
    not_inlined!(coriolis_matrix, [q, v], [c]);
    not_inlined!(gravity, [q], [g]);
    not_inlined!(bias, [q, v], [out]);
    not_inlined!(inverse_dynamics, [q, v, a], [tau]);
    not_inlined!(forward_dynamics, [q, v, tau], [a]);

    #[inline(never)]
    fn regressor(&self, ws: &mut Workspace<S>, trig: &[(S, S)], q: &[S], rates: [&[S]; 3], y: &mut [S]) {
        match self {
            AnyArm::PlanarPr(arm) => arm.regressor(&mut (), trig, q, rates, y),
            AnyArm::Tree(arm) => arm.regressor(ws, trig, q, rates, y),
        }
    }

    #[inline(never)]
    fn regressor_products(
        &self,
        ws: &mut Workspace<S>,
        trig: &[(S, S)],
        q: &[S],
        rates: [&[S]; 3],
        by_parameters: (&[S], &mut [S]),
        by_rates: (&[S], &mut [S]),
    ) {
        match self {
            AnyArm::PlanarPr(arm) => arm.regressor_products(&mut (), trig, q, rates, by_parameters, by_rates),
            AnyArm::Tree(arm) => arm.regressor_products(ws, trig, q, rates, by_parameters, by_rates),
        }
    }

    #[inline(never)]
    fn energy(&self, ws: &mut Workspace<S>, trig: &[(S, S)], q: &[S], v: &[S]) -> (S, S) {
        match self {
            AnyArm::PlanarPr(arm) => arm.energy(&mut (), trig, q, v),
            AnyArm::Tree(arm) => arm.energy(ws, trig, q, v),
        }
    }
}

impl<S: Real> AnyArm<S> {
    /// Write the geometric Jacobian of a frame, `(6, n)`, to `j`, and return the position of the frame. A planar PR arm has no frames, so
    /// its position is zero, and `j` is not written.
    #[inline(never)]
    pub fn jacobian(&self, ws: &mut Workspace<S>, trig: &[(S, S)], q: &[S], frame: usize, j: &mut [S]) -> Vector3<S> {
        match self {
            AnyArm::PlanarPr(_) => Vector3::zero(),
            AnyArm::Tree(tree) => kinematics::jacobian(tree, &mut ws.poses, trig, q, frame, j),
        }
    }

    /// The bias acceleration `J_dot v` of a frame with the Jacobian `J`: its acceleration at zero joint accelerations. The result is the linear
    /// and the angular acceleration in world axes. A planar PR arm has no frames, so its result is zero.
    #[inline(never)]
    pub fn bias_acceleration(&self, ws: &mut Workspace<S>, at: (&[(S, S)], &[S]), v: &[S], frame: usize) -> [Vector3<S>; 2] {
        match self {
            AnyArm::PlanarPr(_) => [Vector3::zero(); 2],
            AnyArm::Tree(tree) => newton_euler::bias_acceleration(tree, ws, at, v, frame),
        }
    }

    /// The position of a frame, m. A planar PR arm has no frames, so its result is zero.
    #[inline(never)]
    pub fn position(&self, ws: &mut Workspace<S>, trig: &[(S, S)], q: &[S], frame: usize) -> Vector3<S> {
        match self {
            AnyArm::PlanarPr(_) => Vector3::zero(),
            AnyArm::Tree(tree) => kinematics::frame_pose(tree, &mut ws.poses, trig, q, frame).1,
        }
    }

    /// Compute the error `e`, `(m,)`, and the Jacobian `j`, `(m, n)`, of Cartesian coordinates. `full` is memory for `(6, n)`.
    /// For a planar PR arm, nothing is written.
    #[inline(never)]
    pub fn error_and_jacobian(
        &self,
        ws: &mut Workspace<S>,
        coordinates: &Coordinates,
        full: &mut [S],
        at: (&[(S, S)], &[S]),
        target: &[S],
        (e, j): (&mut [S], &mut [S]),
    ) {
        if let AnyArm::Tree(tree) = self {
            coordinates.error_and_jacobian(tree, &mut ws.poses, full, at, target, (e, j));
        }
    }
}
