//! Buffers of the tree algorithms, made once per tree.

use super::crba;
use super::derivatives::Slope;
use super::regressor::Field;
use crate::arm::Tree;
use crate::kinematics::Pose;
use crate::scalar::Real;
use crate::spatial::{Inertia, M3, Spatial, Sym3, V3};

/// Angular velocities, and the acceleration field `a + U r` of a body.
#[derive(Clone, Copy, Debug, Default)]
pub struct Motion<S> {
    pub w: V3<S>,
    pub wr: V3<S>,
    pub wd: V3<S>,
    pub a: V3<S>,
    pub u: M3<S>,
}

/// What one body needs in the Newton-Euler recursions.
#[derive(Clone, Copy, Debug, Default)]
pub struct Link<S> {
    /// Rotation to the parent's axes where it is not a quarter turn and `Rz`, and the joint origin in them.
    pub e: M3<S>,
    pub p: V3<S>,
    pub motion: Motion<S>,
    pub f: V3<S>,
    pub n: V3<S>,
    /// Its motion under given joint rates.
    pub twist: Spatial<S>,
}

/// Composite quantities of a subtree, world axes, about the joint origin.
#[derive(Clone, Copy, Debug, Default)]
pub struct Composite<S> {
    pub inertia: Inertia<S>,
    /// Linear momentum relative to the joint origin.
    pub momentum: V3<S>,
    /// `integral of u r' dm`, `u` the velocity relative to the joint origin.
    pub k: M3<S>,
}

impl<S: Real> Composite<S> {
    #[inline(always)]
    pub fn plus(&self, b: &Composite<S>) -> Composite<S> {
        let k = M3([self.k.0[0] + b.k.0[0], self.k.0[1] + b.k.0[1], self.k.0[2] + b.k.0[2]]);
        Composite { inertia: self.inertia.plus(&b.inertia), momentum: self.momentum + b.momentum, k }
    }
}

/// An articulated inertia and bias force, world axes, about the joint origin: `f = M a + H wd + b_f`,
/// `n = H' a + I wd + b_n`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Handle<S> {
    pub mass: Sym3<S>,
    pub h: M3<S>,
    pub inertia: Sym3<S>,
    pub f: V3<S>,
    pub n: V3<S>,
}

impl<S: Real> Handle<S> {
    #[inline(always)]
    pub fn plus(&self, b: &Handle<S>) -> Handle<S> {
        let h = M3([self.h.0[0] + b.h.0[0], self.h.0[1] + b.h.0[1], self.h.0[2] + b.h.0[2]]);
        Handle { mass: self.mass.plus(&b.mass), h, inertia: self.inertia.plus(&b.inertia), f: self.f + b.f, n: self.n + b.n }
    }
}

/// What one body needs in the articulated-body recursion.
#[derive(Clone, Copy, Debug, Default)]
pub struct Articulated<S> {
    pub handle: Handle<S>,
    pub p: V3<S>,
    pub ca: V3<S>,
    pub cw: V3<S>,
    pub uf: V3<S>,
    pub un: V3<S>,
    pub u: S,
    pub inverse: S,
    pub w: V3<S>,
    pub a: V3<S>,
    pub wd: V3<S>,
}

/// A joint's share of motion at the world origin: `[v; w]` per unit rate, and its rate of change.
#[derive(Clone, Copy, Debug, Default)]
pub struct Column<S> {
    pub linear: V3<S>,
    pub angular: V3<S>,
    pub w: V3<S>,
    pub velocity: V3<S>,
    pub alpha: V3<S>,
    pub gamma: V3<S>,
}

/// The factors of a mass matrix: `L` above the diagonal of `matrix` `(n, n)`, by columns of joints, and the inverse of `D`.
#[derive(Clone, Debug)]
pub struct Factors<S> {
    pub matrix: Vec<S>,
    pub inverse: Vec<S>,
}

#[derive(Clone, Debug)]
pub struct Workspace<S> {
    pub poses: Vec<Pose<S>>,
    pub links: Vec<Link<S>>,
    pub fields: Vec<Field<S>>,
    pub composites: Vec<Composite<S>>,
    pub articulated: Vec<Articulated<S>>,
    pub mass: crba::Composites<S>,
    pub factors: Factors<S>,
    pub columns: Vec<Column<S>>,
    pub slopes: Vec<Slope<S>>,
    /// Angular velocity of each body and velocity of its origin.
    pub motion: Vec<(V3<S>, V3<S>)>,
    /// Mass of each subtree and its first moment about the joint.
    pub subtrees: Vec<(S, V3<S>)>,
}

impl<S: Real> Workspace<S> {
    pub fn new(tree: &Tree<S>) -> Self {
        let n = tree.n();
        Workspace {
            poses: vec![Pose::identity(); n],
            links: vec![Link::default(); n],
            fields: vec![Field::default(); n],
            composites: vec![Composite::default(); n],
            articulated: vec![Articulated::default(); n],
            mass: crba::Composites::new(n),
            factors: Factors { matrix: vec![S::zero(); if tree.is_shallow { n * n } else { 0 }], inverse: vec![S::zero(); n] },
            columns: vec![Column::default(); n],
            slopes: vec![Slope::default(); n],
            motion: vec![(V3::zero(), V3::zero()); n],
            subtrees: vec![(S::zero(), V3::zero()); n],
        }
    }
}
