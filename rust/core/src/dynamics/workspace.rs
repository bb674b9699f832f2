//! Buffers of the tree algorithms, created once per tree.

use super::crba;
use crate::arm::Tree;
use crate::kinematics::Pose;
use crate::memory::copies;
use crate::scalar::Real;
use crate::spatial::{Inertia, Matrix, Matrix3, PARAMETERS, Spatial, Sym3, Vector, Vector3};

/// The motion of a body, in its axes. The names are those of `newton_euler`: angular velocity `w`, reference angular velocity `wr`, and
/// angular acceleration `wd`. The acceleration field minus gravity is `a + U r`.
#[derive(Clone, Copy, Debug, Default)]
pub struct BodyMotion<S: Real> {
    pub w: Vector3<S>,
    pub wr: Vector3<S>,
    pub wd: Vector3<S>,
    pub a: Vector3<S>,
    pub u: Matrix3<S>,
}

/// The memory of one body in the Newton-Euler recursions. `f` and `n` are force and moment in body axes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Link<S: Real> {
    /// Rotation to the axes of the parent; not used if the placement is a quarter turn.
    pub e: Matrix3<S>,
    /// Joint origin in the axes of the parent.
    pub p: Vector3<S>,
    pub motion: BodyMotion<S>,
    pub f: Vector3<S>,
    pub n: Vector3<S>,
    /// Motion of the body under the joint rates `s`.
    pub twist: Spatial<S>,
}

/// Composite quantities of a subtree, in world axes, about the joint origin.
#[derive(Clone, Copy, Debug, Default)]
pub struct Composite<S: Real> {
    pub inertia: Inertia<S>,
    /// Linear momentum. Velocities are relative to the velocity of the joint origin, but in `body_derivatives` relative to the world.
    pub momentum: Vector3<S>,
    /// The matrix `K = integral of u r' dm`, with the velocity `u` of the momentum.
    pub k: Matrix3<S>,
}

impl<S: Real> Composite<S> {
    pub fn plus(&self, b: &Composite<S>) -> Composite<S> {
        let k = Matrix3::from_columns(&[self.k.axis(0) + b.k.axis(0), self.k.axis(1) + b.k.axis(1), self.k.axis(2) + b.k.axis(2)]);
        Composite { inertia: self.inertia.plus(&b.inertia), momentum: self.momentum + b.momentum, k }
    }
}

/// An articulated inertia and a bias force, in world axes, about the joint origin: `f = M a + H wd + b_f`, `n = H' a + I wd + b_n`, with
/// the transpose `H'`. The fields `mass`, `h` and `inertia` are `M`, `H` and `I`. The fields `f` and `n` are `b_f` and `b_n`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Handle<S: Real> {
    pub mass: Sym3<S>,
    pub h: Matrix3<S>,
    pub inertia: Sym3<S>,
    pub f: Vector3<S>,
    pub n: Vector3<S>,
}

impl<S: Real> Handle<S> {
    pub fn plus(&self, b: &Handle<S>) -> Handle<S> {
        let h = Matrix3::from_columns(&[self.h.axis(0) + b.h.axis(0), self.h.axis(1) + b.h.axis(1), self.h.axis(2) + b.h.axis(2)]);
        Handle { mass: self.mass.plus(&b.mass), h, inertia: self.inertia.plus(&b.inertia), f: self.f + b.f, n: self.n + b.n }
    }
}

/// The memory of one body in the articulated-body recursion, in world axes. The names are those of `aba`: `c = (ca, cw)`, `U = (uf, un)`,
/// `u = tau - S.b`. `inverse` is `1/D`. `w` is the angular velocity, and `wd` the angular acceleration. `a` is the acceleration of the
/// body's origin minus gravity.
#[derive(Clone, Copy, Debug, Default)]
pub struct Articulated<S: Real> {
    pub handle: Handle<S>,
    pub p: Vector3<S>,
    pub ca: Vector3<S>,
    pub cw: Vector3<S>,
    pub uf: Vector3<S>,
    pub un: Vector3<S>,
    pub u: S,
    pub inverse: S,
    pub w: Vector3<S>,
    pub a: Vector3<S>,
    pub wd: Vector3<S>,
}

/// The motion `(linear, angular)` at the world origin per unit rate of a joint, and the product `V_j x S_j = (gamma, alpha)` of `coriolis`.
/// `w` and `velocity` are the angular velocity of the body and the velocity of its origin. The axes are the world's.
#[derive(Clone, Copy, Debug, Default)]
pub struct Column<S: Real> {
    pub linear: Vector3<S>,
    pub angular: Vector3<S>,
    pub w: Vector3<S>,
    pub velocity: Vector3<S>,
    pub alpha: Vector3<S>,
    pub gamma: Vector3<S>,
}

/// The factors of a mass matrix `L' D L`: `L'` above the diagonal of `matrix`, `(n, n)`, and the reciprocals of `D`.
#[derive(Clone, Debug)]
pub struct Factors<S> {
    pub matrix: Vec<S>,
    pub inverse: Vec<S>,
}

/// The data of one joint for `body_derivatives`, in world axes. `(linear, angular)` is its unit motion at the world origin. `v` is the
/// velocity of the body's origin, and `a` its acceleration minus gravity. `w` and `wd` are the angular velocity and acceleration of the
/// body. `(f, n)` is the wrench on its subtree, with the moment about the body's origin.
#[derive(Clone, Copy, Debug, Default)]
pub struct Slope<S: Real> {
    pub linear: Vector3<S>,
    pub angular: Vector3<S>,
    pub w: Vector3<S>,
    pub v: Vector3<S>,
    pub a: Vector3<S>,
    pub wd: Vector3<S>,
    /// Linear and angular part of the acceleration `phi = A_p x S + V_p x psi` (see `body_derivatives`), about the joint origin `o`. About
    /// the world origin, the linear part is `phi_v + o x phi_w`.
    pub phi_v: Vector3<S>,
    pub phi_w: Vector3<S>,
    pub psi_w: Vector3<S>,
    pub f: Vector3<S>,
    pub n: Vector3<S>,
}

/// Motions of bodies in the coordinates of all joints, including joints that follow others.
#[derive(Clone, Debug, Default)]
pub struct Spread<S: Real> {
    /// (sin, cos) of every joint.
    pub trig: Vec<(S, S)>,
    /// Position of every joint.
    pub q: Vec<S>,
    /// Rates and accelerations of every joint: up to four vectors over all joints.
    pub rates: [Vec<S>; 4],
    /// A result for all joints, before it is projected to the coordinates. The result has up to ten columns per body.
    pub answer: Vec<S>,
    /// The mass matrix `M` in coordinates, `(n, n)`.
    pub mass: Vec<S>,
    /// The Cholesky factor of the mass matrix `M` in coordinates, `(n, n)`.
    pub factor: Vec<S>,
}

impl<S: Real> Spread<S> {
    /// Create buffers for an arm with joints that follow others; empty for other arms.
    pub fn new(tree: &Tree<S>) -> Self {
        if tree.joining.is_none() {
            return Spread::default();
        }
        let (n, bodies) = (tree.n(), tree.bodies.len());
        let zeros = |k: usize| vec![S::zero(); k];
        Spread {
            trig: vec![(S::zero(), S::zero()); bodies],
            q: zeros(bodies),
            rates: std::array::from_fn(|_| zeros(bodies)),
            answer: zeros(PARAMETERS * bodies * bodies),
            mass: zeros(n * n),
            factor: zeros(n * n),
        }
    }
}

/// The field `a + U r` of a body in the axes of its parameters, with `U = [d]x + sym U`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Field<S: Real> {
    pub a: Vector3<S>,
    pub u: Matrix3<S>,
    pub d: Vector3<S>,
    /// Entries xy, xz, yz of `sym U`.
    pub off: Vector3<S>,
    /// Differences xx - yy, zz - xx, yy - zz of the diagonal of `sym U`.
    pub differences: Vector3<S>,
}

/// The buffers of all algorithms of a tree.
///
/// ```
/// use armlet_core::arm::{Arm, Tree};
/// use armlet_core::dynamics::{Dynamics, Workspace};
///
/// let tree = Tree::<f64>::new(&Arm::pendulum(2.0, 5.0)?);
/// let mut workspace = Workspace::new(&tree);
/// let (mut m, mut g) = ([0.0], [0.0]);
/// for q in [0.1, 0.2, 0.3f64] {
///     let trig = [q.sin_cos()];
///     tree.mass_matrix(&mut workspace, &trig, &[q], &mut m);
///     tree.gravity(&mut workspace, &trig, &[q], &mut g);
///     assert!((m[0] - 2.0).abs() < 1e-15 && (g[0] - 5.0 * q.sin()).abs() < 1e-15);
/// }
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Workspace<S: Real> {
    pub poses: Vec<Pose<S>>,
    pub links: Vec<Link<S>>,
    pub fields: Vec<Field<S>>,
    pub composites: Vec<Composite<S>>,
    pub articulated: Vec<Articulated<S>>,
    pub mass: crba::Composites<S>,
    pub factors: Factors<S>,
    pub columns: Vec<Column<S>>,
    pub slopes: Vec<Slope<S>>,
    /// Angular velocity of each body, and velocity of its origin.
    pub motion: Vec<(Vector3<S>, Vector3<S>)>,
    /// Mass of each subtree, and its first moment about the joint.
    pub subtrees: Vec<(S, Vector3<S>)>,
    /// Buffers for joints that follow others; empty for other arms.
    pub spread: Spread<S>,
}

impl<S: Real> Workspace<S> {
    pub fn new(tree: &Tree<S>) -> Self {
        let n = tree.bodies.len();
        Workspace {
            poses: copies(n, Pose::identity()),
            links: copies(n, Link::default()),
            fields: copies(n, Field::default()),
            composites: copies(n, Composite::default()),
            articulated: copies(n, Articulated::default()),
            mass: crba::Composites::new(n),
            factors: Factors { matrix: copies(if tree.is_shallow { n * n } else { 0 }, S::zero()), inverse: copies(n, S::zero()) },
            columns: copies(n, Column::default()),
            slopes: copies(n, Slope::default()),
            motion: copies(n, (Vector3::zero(), Vector3::zero())),
            subtrees: copies(n, (S::zero(), Vector3::zero())),
            spread: Spread::new(tree),
        }
    }
}
