//! Three-vectors: `a . b`, `a x b`, and sums with a fused multiply-add per term.

use crate::scalar::Real;
use std::ops::{Add, AddAssign, Index, IndexMut, Neg, Sub, SubAssign};

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct V3<S>(pub [S; 3]);

impl<S: Real> V3<S> {
    #[inline(always)]
    pub fn zero() -> Self {
        V3([S::zero(); 3])
    }
    #[inline(always)]
    pub fn dot(self, b: Self) -> S {
        self[0].mul_add(b[0], self[1].mul_add(b[1], self[2] * b[2]))
    }
    #[inline(always)]
    pub fn cross(self, b: Self) -> Self {
        V3([self[1].mul_add(b[2], -(self[2] * b[1])), self[2].mul_add(b[0], -(self[0] * b[2])), self[0].mul_add(b[1], -(self[1] * b[0]))])
    }
    /// `self x b + c`.
    #[inline(always)]
    pub fn cross_add(self, b: Self, c: Self) -> Self {
        V3([
            self[1].mul_add(b[2], self[2].neg_mul_add(b[1], c[0])),
            self[2].mul_add(b[0], self[0].neg_mul_add(b[2], c[1])),
            self[0].mul_add(b[1], self[1].neg_mul_add(b[0], c[2])),
        ])
    }
    #[inline(always)]
    pub fn scale(self, k: S) -> Self {
        V3([self[0] * k, self[1] * k, self[2] * k])
    }
    /// `self k + c`.
    #[inline(always)]
    pub fn scale_add(self, k: S, c: Self) -> Self {
        V3([self[0].mul_add(k, c[0]), self[1].mul_add(k, c[1]), self[2].mul_add(k, c[2])])
    }
    /// `c - self k`.
    #[inline(always)]
    pub fn scale_sub(self, k: S, c: Self) -> Self {
        V3([self[0].neg_mul_add(k, c[0]), self[1].neg_mul_add(k, c[1]), self[2].neg_mul_add(k, c[2])])
    }
}

impl V3<f64> {
    /// The constant in every lane.
    #[inline(always)]
    pub fn lift<S: Real>(&self) -> V3<S> {
        V3([S::splat(self.0[0]), S::splat(self.0[1]), S::splat(self.0[2])])
    }
    pub fn norm(self) -> f64 {
        self.dot(self).sqrt()
    }
}

impl<S> Index<usize> for V3<S> {
    type Output = S;
    #[inline(always)]
    fn index(&self, i: usize) -> &S {
        &self.0[i]
    }
}
impl<S> IndexMut<usize> for V3<S> {
    #[inline(always)]
    fn index_mut(&mut self, i: usize) -> &mut S {
        &mut self.0[i]
    }
}
impl<S: Real> Add for V3<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        V3([self[0] + b[0], self[1] + b[1], self[2] + b[2]])
    }
}
impl<S: Real> Sub for V3<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        V3([self[0] - b[0], self[1] - b[1], self[2] - b[2]])
    }
}
impl<S: Real> Neg for V3<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        V3([-self[0], -self[1], -self[2]])
    }
}
impl<S: Real> AddAssign for V3<S> {
    #[inline(always)]
    fn add_assign(&mut self, b: Self) {
        *self = *self + b;
    }
}
impl<S: Real> SubAssign for V3<S> {
    #[inline(always)]
    fn sub_assign(&mut self, b: Self) {
        *self = *self - b;
    }
}
