//! Vectors with three components, of nalgebra's type: `a . b`, `a x b`, and sums. Sums of products use [`Real::mul_add`].
//!
//! [`Vector`] has the products whose bits depend on the order of operations and on fusing. Its methods take `self` by value. So they take
//! precedence over nalgebra's methods of the same names, which take references.

use crate::scalar::Real;
use nalgebra::Vector3;

/// Products of [`Vector3`] over any [`Real`].
///
/// ```
/// use armlet_core::spatial::{Vector, Vector3};
///
/// let p = Vector3::new(3.0, 4.0, 0.0);
/// assert_eq!(Vector::dot(p, p), 25.0);
/// let (x, y) = (Vector3::<f64>::x(), Vector3::y());
/// assert_eq!(x.cross(y).scale(2.0).array(), [0.0, 0.0, 2.0]);
/// ```
pub trait Vector<S: Real>: Copy {
    fn zero() -> Self;
    /// Return the three components.
    fn array(self) -> [S; 3];
    fn dot(self, b: Self) -> S;
    fn cross(self, b: Self) -> Self;
    /// Return `self x b + c`.
    fn cross_add(self, b: Self, c: Self) -> Self;
    fn scale(self, k: S) -> Self;
    /// Return `self k + c`.
    fn scale_add(self, k: S, c: Self) -> Self;
    /// Return `c - self k`.
    fn scale_sub(self, k: S, c: Self) -> Self;
}

impl<S: Real> Vector<S> for Vector3<S> {
    #[inline]
    fn zero() -> Self {
        Vector3::from([S::zero(); 3])
    }
    #[inline]
    fn array(self) -> [S; 3] {
        self.into()
    }
    #[inline]
    fn dot(self, b: Self) -> S {
        self[0].mul_add(b[0], self[1].mul_add(b[1], self[2] * b[2]))
    }
    #[inline]
    fn cross(self, b: Self) -> Self {
        let entry = |i: usize, j: usize| self[i].mul_add(b[j], -(self[j] * b[i]));
        Vector3::new(entry(1, 2), entry(2, 0), entry(0, 1))
    }
    #[inline]
    fn cross_add(self, b: Self, c: Self) -> Self {
        let entry = |i: usize, j: usize, k: usize| self[i].mul_add(b[j], self[j].neg_mul_add(b[i], c[k]));
        Vector3::new(entry(1, 2, 0), entry(2, 0, 1), entry(0, 1, 2))
    }
    #[inline]
    fn scale(self, k: S) -> Self {
        Vector3::new(self[0] * k, self[1] * k, self[2] * k)
    }
    #[inline]
    fn scale_add(self, k: S, c: Self) -> Self {
        Vector3::new(self[0].mul_add(k, c[0]), self[1].mul_add(k, c[1]), self[2].mul_add(k, c[2]))
    }
    #[inline]
    fn scale_sub(self, k: S, c: Self) -> Self {
        Vector3::new(self[0].neg_mul_add(k, c[0]), self[1].neg_mul_add(k, c[1]), self[2].neg_mul_add(k, c[2]))
    }
}

/// Conversion of vectors and matrices of `f64` to another number type.
///
/// ```
/// use armlet_core::scalar::{Array8, Real};
/// use armlet_core::spatial::{Lift, Vector, Vector3};
///
/// // One point for eight lanes.
/// let p = Vector3::new(1.0, 2.0, 3.0).lift::<Array8>();
/// assert_eq!((p.x.lane(0), p.dot(p).lane(7)), (1.0, 14.0));
/// ```
pub trait Lift {
    type Of<S: Real>;
    /// Return the numbers as constants of the type `S`.
    fn lift<S: Real>(&self) -> Self::Of<S>;
}

impl Lift for Vector3<f64> {
    type Of<S: Real> = Vector3<S>;
    #[inline]
    fn lift<S: Real>(&self) -> Vector3<S> {
        self.map(S::splat)
    }
}

/// Return the unit vector along `v`. The result is `None` for a vector that is zero or not finite. A unit vector of this function has the
/// same result again, so that a stored vector keeps its bits.
///
/// ```
/// use armlet_core::spatial::unit_vector;
///
/// assert_eq!(unit_vector([0.0, -3.0, 0.0]), Some([0.0, -1.0, 0.0]));
/// assert_eq!(unit_vector([0.0; 3]), None);
/// let unit = unit_vector([1.0, -2.0, 0.3]);
/// assert_eq!(unit.and_then(unit_vector), unit);
/// ```
pub fn unit_vector(v: [f64; 3]) -> Option<[f64; 3]> {
    // The vector is scaled first, so that tiny and huge vectors neither underflow nor overflow.
    let largest = v.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    if largest == 0.0 || !v.iter().all(|x| x.is_finite()) {
        return None;
    }
    // Each component is divided, because the reciprocal of a subnormal `largest` can be infinite.
    let scaled = Vector3::from(v.map(|x| x / largest));
    let unit = Vector3::from(scaled.array().map(|x| x / scaled.norm()));
    // A unit vector up to rounding is returned unchanged.
    if (Vector3::from(v).norm() - 1.0).abs() <= 4.0 * f64::EPSILON { Some(v) } else { Some(unit.array()) }
}
