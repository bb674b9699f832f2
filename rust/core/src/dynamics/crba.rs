//! Mass matrix by composite bodies (Walker and Orin 1982; Featherstone 2008, section 6.2), in body axes.
//!
//! `I_j^c` is the inertia of the subtree of joint `j` about the joint origin, in the axes of body `j`. Then `F_j = I_j^c S_j` is the
//! momentum of the subtree per unit rate of `j`. `F_j` is transformed from body to body towards the base. Then `M_ij = S_i . F_j` for every
//! ancestor `i` of `j`, and `M_jj = S_j . F_j + armature_j`. Inertias are stored as second moments
//! `P = integral of r r' dm = tr(I)/2 1 - I`, because their shift takes fewer products. For a revolute joint, `S_j = e_z` selects one
//! column: `I e_z = tr(P) e_z - P e_z`.

use super::hinge::{congruence, over, reach, rotation, to_parent};
use crate::arm::{BASE, Body, Tree};
use crate::interrupt;
use crate::kinematics::Pose;
use crate::memory::{copies, set};
use crate::scalar::Real;
use crate::spatial::{Matrix, Matrix3, QuarterTurn, Spatial, Sym3, Vector, Vector3};

/// Mass, first and second moment of a subtree about its joint origin, in the axes of its first body.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moments<S: Real> {
    mass: S,
    first: Vector3<S>,
    second: Sym3<S>,
}

impl<S: Real> Moments<S> {
    fn of(body: &Body<S>) -> Self {
        Moments { mass: body.inertia.mass, first: body.inertia.moment, second: body.second_moment }
    }
    fn plus(&self, b: &Self) -> Self {
        Moments { mass: self.mass + b.mass, first: self.first + b.first, second: self.second.plus(&b.second) }
    }
    /// The moments about a new point. `p` is the old point relative to the new point.
    fn shifted(&self, p: Vector3<S>) -> Self {
        let (h, moved) = (self.first, p.scale_add(self.mass, self.first));
        let [xx, xy, yy, xz, yz, zz] = self.second.0;
        let entry = |i: usize, j: usize, old: S| p[i].mul_add(moved[j], h[i].mul_add(p[j], old));
        let second = [entry(0, 0, xx), entry(0, 1, xy), entry(1, 1, yy), entry(0, 2, xz), entry(1, 2, yz), entry(2, 2, zz)];
        Moments { mass: self.mass, first: moved, second: Sym3(second) }
    }
}

/// The motion `[v; w]` at the world origin per unit rate of a joint.
pub(crate) fn joint_column<S: Real>(revolute: bool, pose: &Pose<S>) -> (Vector3<S>, Vector3<S>) {
    let z = pose.z();
    if revolute { (pose.origin.cross(z), z) } else { (z, Vector3::zero()) }
}

/// Buffers of the mass matrix.
#[derive(Clone, Debug)]
pub struct Composites<S: Real> {
    moments: Vec<Moments<S>>,
    /// The momentum `[f; n]` of every joint's subtree per unit rate. The recursion transforms it towards the base.
    momenta: Vec<Spatial<S>>,
    /// Rotations of the joints whose placement is not a quarter turn.
    rotations: Vec<Matrix3<S>>,
}

impl<S: Real> Composites<S> {
    pub fn new(n: usize) -> Self {
        Composites { moments: copies(n, Moments::default()), momenta: copies(n, Spatial::zero()), rotations: copies(n, Matrix3::zero()) }
    }
}

/// Compute the mass matrix `M(q)`, `(n, n)`.
pub fn mass_matrix<S: Real>(tree: &Tree<S>, composites: &mut Composites<S>, trig: &[(S, S)], q: &[S], m: &mut [S]) {
    set(m, S::zero());
    mass_matrix_on_zeros(tree, composites, trig, q, m);
}

/// Compute [`mass_matrix`], but write only the entries that can differ from zero. Before the call, `m` contains zeros, or an earlier `M` of
/// this tree.
pub fn mass_matrix_on_zeros<S: Real>(tree: &Tree<S>, composites: &mut Composites<S>, trig: &[(S, S)], q: &[S], m: &mut [S]) {
    let n = tree.bodies.len();
    let m = &mut m[..n * n];
    mass_matrix_entries(tree, composites, trig, q, |i, j, x| {
        m[i * n + j] = x;
        m[j * n + i] = x;
    });
}

/// Call `put(i, j, M_ij)` for the entries with `i <= j` that can differ from zero.
pub(super) fn mass_matrix_entries<S: Real>(
    tree: &Tree<S>,
    composites: &mut Composites<S>,
    trig: &[(S, S)],
    q: &[S],
    mut put: impl FnMut(usize, usize, S),
) {
    let n = tree.bodies.len();
    let Composites { moments, momenta, rotations } = composites;
    let (bodies, moments, momenta) = (&tree.bodies[..n], &mut moments[..n], &mut momenta[..n]);
    let (rotations, trig, q) = (&mut rotations[..n], &trig[..n], &q[..n]);
    // A local variable has the sum for the parent if the parent is the next body. So the sum can stay in registers.
    let (mut next, mut next_at) = (Moments::default(), BASE);
    for i in (0..n).rev() {
        interrupt::check_at_row(i);
        let body = &bodies[i];
        let moments_of_subtree = if body.end == i + 1 {
            Moments::of(body)
        } else if next_at == i {
            next
        } else {
            moments[i]
        };
        let Moments { mass, first, second: Sym3([xx, _, yy, xz, yz, _]) } = moments_of_subtree;
        let [hx, hy, _] = first.array();
        let zero = S::zero();
        let (linear, angular, own) = if body.revolute {
            (Vector3::from([-hy, hx, zero]), Vector3::from([-xz, -yz, xx + yy]), xx + yy)
        } else {
            (Vector3::from([zero, zero, mass]), Vector3::from([hy, -hx, zero]), mass)
        };
        momenta[i] = Spatial { linear, angular };
        put(i, i, own + body.armature);
        for j in i + 1..body.end {
            put(i, j, if body.revolute { momenta[j].angular[2] } else { momenta[j].linear[2] });
        }
        let parent = body.parent;
        if parent == BASE {
            continue;
        }
        let p = reach(body, q[i]);
        if body.quarter.is_none() {
            rotations[i] = rotation(body, trig[i]);
        }
        let (e, turn) = (&rotations[i], trig[i]);
        // This macro repeats the loop over bodies for three kinds of quarter turns, so that these loops have no branch on the kind.
        macro_rules! carry {
            ($($quarter:pat => $known:expr),+) => {
                match body.quarter {
                    $($quarter => for j in i..body.end {
                        let [linear, angular] = over($known, body.revolute, e, turn, [momenta[j].linear, momenta[j].angular]);
                        momenta[j] = Spatial { linear, angular: if body.concentric { angular } else { p.cross_add(linear, angular) } };
                    })+
                }
            };
        }
        carry!(
            Some(QuarterTurn::None) => Some(QuarterTurn::None),
            Some(QuarterTurn::X90) => Some(QuarterTurn::X90),
            Some(QuarterTurn::X270) => Some(QuarterTurn::X270),
            quarter => quarter
        );
        let [first] = to_parent(body, e, trig[i], [moments_of_subtree.first]);
        let mut moved = Moments { mass, first, second: congruence(body, e, trig[i], moments_of_subtree.second) };
        if !body.concentric {
            moved = moved.shifted(p);
        }
        // The loop runs from the tips to the base, so a body's last branch comes first.
        let up = &bodies[parent];
        let sum = if body.end == up.end { Moments::of(up) } else { moments[parent] }.plus(&moved);
        if parent + 1 == i {
            (next, next_at) = (sum, parent);
        } else {
            moments[parent] = sum;
        }
    }
}
