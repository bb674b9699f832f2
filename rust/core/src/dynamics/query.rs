//! Queries of an arm: the quantities of [`super::Evaluator`], their inputs, options and shapes. All units are SI: rad and N m for revolute
//! joints, m and N for prismatic joints.

use crate::arm::{Arm, Tree};
use crate::scalar::{Isa, Real, isa};
use crate::spatial::PARAMETERS;

/// A quantity of an arm. Each variant lists the inputs in their order. An input is `(n,)`, except a wrench, `(6,)`.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::{Evaluator, Quantity};
///
/// let mut arm = Evaluator::new(&Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?);
/// let mut com = [0.0; 3];
/// arm.one(&Quantity::Com.into(), &[&[0.0, 0.0]], &mut com)?;
/// // Two uniform rods in one line, which is 0.9 m long.
/// assert!((com[0] - 0.45).abs() < 1e-15 && com[1..] == [0.0; 2]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Mass matrix: `q -> (n, n)`.
    MassMatrix,
    /// Coriolis matrix: `q, v -> (n, n)`.
    CoriolisMatrix,
    /// Christoffel symbols: `q -> (n n, n)`. Row `i n + j`, column `k` is `c[i, j, k]`.
    Christoffel,
    /// Gravity torque: `q -> (n,)`.
    Gravity,
    /// Bias torque `C v + g`: `q, v -> (n,)`.
    Bias,
    /// Inverse dynamics: `q, v, a -> (n,)`; with a wrench frame `q, v, a, wrench -> (n,)`.
    InverseDynamics,
    /// Forward dynamics: `q, v, tau -> (n,)`; with a wrench frame `q, v, tau, wrench -> (n,)`.
    ForwardDynamics,
    /// Slotine-Li regressor: `q, v, v_r, a_r -> (n, p)`.
    Regressor,
    /// Kinetic and potential energy, J: `q, v -> (2,)`.
    Energy,
    /// Pose of a frame, a homogeneous transform with the position in m: `q -> (4, 4)`.
    Pose,
    /// Position, m, and rotation vector `log R`, rad, of a frame: `q -> (6,)`.
    PoseVector,
    /// Position of a frame, m: `q -> (3,)`.
    Position,
    /// Poses of the bodies of all joints, including mimic joints: `q -> (4 b, 4)`, where `b` is the number of bodies.
    JointPoses,
    /// Geometric Jacobian of a frame: `q -> (6, n)`.
    Jacobian,
    /// Rate of the geometric Jacobian of a frame: `q, v -> (6, n)`.
    JacobianDot,
    /// Centre of mass, m: `q -> (3,)`.
    Com,
    /// Jacobian of the centre of mass: `q -> (3, n)`.
    ComJacobian,
    /// Derivatives of inverse dynamics: `q, v, a -> (3 n, n)`. The three stacked blocks are `d tau / d q`, `d tau / d v` and `d tau / d a =
    /// M`.
    InverseDynamicsDerivatives,
    /// Dynamics along a path of slope `v` and curvature `a`: `q, v, a -> (3, n)`, with the rows `M v`, `M a + C v` and `g`. The first two
    /// rows exclude gravity, because its rounding errors could exceed the torques of a short motion.
    PathDynamics,
    /// Derivatives of forward dynamics: `q, v, tau -> (3 n, n)`. The three stacked blocks are `d a / d q`, `d a / d v` and `d a / d tau`.
    ForwardDynamicsDerivatives,
}

/// The sizes on which the shapes of results depend.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::{Quantity, Query, Size};
///
/// // The second joint follows the first joint.
/// let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0; 2])?.following(&[None, Some((0, -2.0, 0.0))])?;
/// assert_eq!(arm.size(), Size { n: 1, bodies: 2 });
/// assert_eq!(Query::from(Quantity::Regressor).shape(arm.size()), (1, 20));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Number of coordinates `n`.
    pub n: usize,
    /// Number of bodies `b`: one per coordinate, and one for each joint that follows another.
    pub bodies: usize,
}

impl Arm {
    /// The numbers of coordinates and bodies.
    #[inline]
    pub fn size(&self) -> Size {
        Size { n: self.n(), bodies: self.joints.len() }
    }

    /// Number of pairs of a body and one of its ancestors, or itself. So many entries of `M` on and below its diagonal do not vanish.
    pub(crate) fn pairs(&self) -> usize {
        let mut depths = Vec::with_capacity(self.joints.len());
        for joint in &self.joints {
            depths.push(1 + joint.parent.map_or(0, |parent| depths[parent]));
        }
        depths.iter().sum()
    }
}

impl<S: Real> Tree<S> {
    /// The numbers of coordinates and bodies.
    #[inline]
    pub fn size(&self) -> Size {
        Size { n: self.n(), bodies: self.bodies.len() }
    }
}

/// A quantity with its options.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::{Evaluator, Quantity, Query};
///
/// let mut arm = Evaluator::new(&Arm::planar(&[0.5, 0.4], None, None, None, [0.0, 0.0])?);
/// let query = Query { wrench: Some(1), ..Quantity::InverseDynamics.into() };
/// assert_eq!(query.inputs(), ["q", "v", "a", "wrench"]);
/// // The torque that holds the straight arm against a force of 10 N at its tip.
/// let (still, mut tau) = ([0.0; 2], [0.0; 2]);
/// arm.one(&query, &[&still, &still, &still, &[0.0, -10.0, 0.0, 0.0, 0.0, 0.0]], &mut tau)?;
/// assert!((tau[0] - 9.0).abs() < 1e-14 && (tau[1] - 4.0).abs() < 1e-14);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Query {
    /// The quantity.
    pub quantity: Quantity,
    /// Index of the frame of a pose, a position, a Jacobian or its rate.
    pub frame: usize,
    /// Index of the frame of the wrench `[f; n]` (world axes, at the frame origin) in inverse and forward dynamics.
    pub wrench: Option<usize>,
    /// Whether joint friction acts. Friction is added to bias and inverse dynamics, and subtracted from the torque in forward dynamics.
    /// Derivatives include only its viscous part. With friction, the regressor has the additional columns `diag(v_r)` and `diag(sign v)`.
    pub friction: bool,
    /// Whether the regressor has the additional columns `diag(a_r)` for rotor inertias, before the columns of friction.
    pub armature: bool,
    /// Whether the regressor has the additional columns of the identity matrix for torque offsets, after the columns of friction.
    pub offset: bool,
}

/// The columns that the regressor has in addition to those of the inertial parameters, in this order. Each kind has one column per joint,
/// and friction has two.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::{JointTerms, Model}};
/// let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// let names = model.column_names(JointTerms { offset: true, ..JointTerms::default() });
/// assert_eq!((names.len(), names[10].as_str()), (11, "offset[joint1]"));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JointTerms {
    /// Rotor inertias, `diag(a_r)`.
    pub armature: bool,
    /// Viscous and Coulomb friction, `diag(v_r)` and `diag(sign v)`.
    pub friction: bool,
    /// Torque offsets, the identity matrix.
    pub offset: bool,
}

impl JointTerms {
    /// The query of a regressor with these columns.
    pub fn regressor(self) -> Query {
        let JointTerms { armature, friction, offset } = self;
        Query { armature, friction, offset, ..Quantity::Regressor.into() }
    }
}

impl From<Quantity> for Query {
    fn from(quantity: Quantity) -> Self {
        Query { quantity, frame: 0, wrench: None, friction: false, armature: false, offset: false }
    }
}

impl Query {
    /// Names of the inputs.
    #[inline]
    pub fn inputs(&self) -> &'static [&'static str] {
        match (self.quantity, self.wrench.is_some()) {
            (Quantity::InverseDynamics, true) => &["q", "v", "a", "wrench"],
            (Quantity::InverseDynamics, false) => &["q", "v", "a"],
            (Quantity::ForwardDynamics, true) => &["q", "v", "tau", "wrench"],
            (Quantity::ForwardDynamics, false) => &["q", "v", "tau"],
            (Quantity::InverseDynamicsDerivatives | Quantity::PathDynamics, _) => &["q", "v", "a"],
            (Quantity::ForwardDynamicsDerivatives, _) => &["q", "v", "tau"],
            (Quantity::Regressor, _) => &["q", "v", "v_r", "a_r"],
            (Quantity::CoriolisMatrix | Quantity::Bias | Quantity::Energy | Quantity::JacobianDot, _) => &["q", "v"],
            (Quantity::MassMatrix | Quantity::Christoffel | Quantity::Gravity | Quantity::Com | Quantity::ComJacobian, _)
            | (Quantity::Pose | Quantity::PoseVector | Quantity::Position | Quantity::JointPoses | Quantity::Jacobian, _) => &["q"],
        }
    }

    /// Length of input number `input` at one configuration.
    #[inline]
    pub fn input_length(&self, input: usize, n: usize) -> usize {
        if input == 3 && self.wrench.is_some() { 6 } else { n }
    }

    /// Rows and columns of the output; one row for vectors.
    #[inline]
    pub fn shape(&self, Size { n, bodies }: Size) -> (usize, usize) {
        match self.quantity {
            Quantity::MassMatrix | Quantity::CoriolisMatrix => (n, n),
            Quantity::Christoffel => (n * n, n),
            Quantity::Gravity | Quantity::Bias | Quantity::InverseDynamics | Quantity::ForwardDynamics => (1, n),
            Quantity::Regressor => {
                let kinds = usize::from(self.armature) + 2 * usize::from(self.friction) + usize::from(self.offset);
                (n, PARAMETERS * bodies + n * kinds)
            }
            Quantity::PathDynamics => (3, n),
            Quantity::Energy => (1, 2),
            Quantity::Pose => (4, 4),
            Quantity::PoseVector => (1, 6),
            Quantity::Position | Quantity::Com => (1, 3),
            Quantity::JointPoses => (4 * bodies, 4),
            Quantity::Jacobian | Quantity::JacobianDot => (6, n),
            Quantity::ComJacobian => (3, n),
            Quantity::InverseDynamicsDerivatives | Quantity::ForwardDynamicsDerivatives => (3 * n, n),
        }
    }

    #[inline]
    pub(super) fn length(&self, size: Size) -> usize {
        let (rows, columns) = self.shape(size);
        rows * columns
    }

    /// Whether the result depends on a frame.
    #[inline]
    pub(super) fn is_framed(&self) -> bool {
        use Quantity::*;
        match self.quantity {
            Pose | PoseVector | Position | Jacobian | JacobianDot => true,
            MassMatrix | CoriolisMatrix | Christoffel | Gravity | Bias | InverseDynamics | ForwardDynamics | Regressor | Energy => false,
            JointPoses | Com | ComJacobian | InverseDynamicsDerivatives | PathDynamics | ForwardDynamicsDerivatives => false,
        }
    }

    /// Whether inputs and output have the right sizes. If not, `check` reports the wrong one.
    pub(super) fn fits(&self, inputs: &[&[f64]], count: usize, size: Size, frames: usize, out: usize) -> bool {
        let expected = self.inputs().len();
        let mut fits = inputs.len() == expected && out == count * self.length(size);
        for k in 0..4 {
            fits &= k >= expected || inputs.get(k).is_some_and(|given| given.len() == count * self.input_length(k, size.n));
        }
        fits && (!self.is_framed() || self.frame < frames) && self.wrench.is_none_or(|frame| frame < frames)
    }

    /// Approximate number of operations for one configuration of an arm with these [`Arm::pairs`]. The estimate does not account for
    /// vanishing terms and common terms.
    pub(crate) fn operations(&self, Size { n, bodies }: Size, pairs: usize) -> f64 {
        use Quantity::*;
        let (joint, pair) = match self.quantity {
            ForwardDynamics => (350.0, 0.0),
            ForwardDynamicsDerivatives => (350.0, 110.0),
            InverseDynamicsDerivatives => (200.0, 110.0),
            CoriolisMatrix | Christoffel => (200.0, 50.0),
            PathDynamics => (300.0, 0.0),
            MassMatrix => (130.0, 20.0),
            Regressor => (130.0, 60.0),
            Gravity | Bias | InverseDynamics | Energy | Pose | PoseVector | Position | JointPoses => (130.0, 0.0),
            Jacobian | JacobianDot | Com | ComJacobian => (130.0, 0.0),
        };
        let solved = if self.quantity == ForwardDynamicsDerivatives { 3.5 } else { 0.0 };
        // The Christoffel symbols require one Coriolis matrix per joint.
        let times = if self.quantity == Christoffel { n as f64 } else { 1.0 };
        let (n, bodies) = (n as f64, bodies as f64);
        // The mass matrix of an arm with joints that follow others has no vanishing entries.
        let joined = if bodies > n && matches!(self.quantity, ForwardDynamics | ForwardDynamicsDerivatives) { n * n * n } else { 0.0 };
        times * (bodies * joint + pairs as f64 * pair + n * n * n * solved + joined)
    }

    /// Approximate time per configuration in a batch, ns, with the instruction set of this machine, for a chain. Callers use it to divide
    /// the work among threads.
    pub fn nanoseconds(&self, size: Size) -> f64 {
        let slower = match isa() {
            Isa::Baseline => 4.0,
            Isa::Avx2 => 2.0,
            Isa::Avx512 => 1.0,
        };
        let pairs = size.bodies * (size.bodies + 1) / 2;
        10.0 + slower * (0.05 * self.operations(size, pairs) + 0.1 * self.length(size) as f64)
    }
}
