//! The identity, and rotations by 90, 180 or 270 degrees about x, and by 90 or 270 degrees about y. With z along the joint axis, the joint
//! placements of many robots are of this kind. A product with such a rotation needs no multiplications, because components only change
//! their places and signs. Example with `R = Rx(90)`:
//!
//! `R (x, y, z) = (x, -z, y)`, and `M R` has the columns `(m_x, m_z, -m_y)`.

use super::{Matrix, Matrix3, RotationMatrix, Sym3, Vector, Vector3};
use crate::scalar::Real;

/// The identity, or a rotation by 90, 180 or 270 degrees about x, or by 90 or 270 degrees about y. Its products permute components.
///
/// ```
/// use armlet_core::spatial::{Matrix3, QuarterTurn, RotationMatrix, Vector3};
/// use std::f64::consts::FRAC_PI_2;
///
/// let turn = QuarterTurn::of(&Matrix3::from_rpy([FRAC_PI_2, 0.0, 0.0])).expect("a right angle about x");
/// assert_eq!(turn, QuarterTurn::X90);
/// assert_eq!(turn.apply([Vector3::new(1.0, 2.0, 3.0)]), [Vector3::new(1.0, -3.0, 2.0)]);
/// assert_eq!(QuarterTurn::of(&Matrix3::from_rpy([0.1, 0.0, 0.0])), None);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QuarterTurn {
    None,
    X90,
    X180,
    X270,
    Y90,
    Y270,
}

impl QuarterTurn {
    pub const ALL: [QuarterTurn; 6] =
        [QuarterTurn::None, QuarterTurn::X90, QuarterTurn::X180, QuarterTurn::X270, QuarterTurn::Y90, QuarterTurn::Y270];

    /// Return the quarter turn that equals `r` exactly, if there is one.
    pub fn of(r: &Matrix3<f64>) -> Option<QuarterTurn> {
        QuarterTurn::ALL.into_iter().find(|turn| turn.after(Matrix3::IDENTITY) == *r)
    }

    /// Return `m R`, where `R` is the matrix of this rotation.
    #[inline]
    pub fn after<S: Real>(self, m: Matrix3<S>) -> Matrix3<S> {
        let [x, y, z] = m.axes();
        match self {
            QuarterTurn::None => m,
            QuarterTurn::X90 => Matrix3::from_columns(&[x, z, -y]),
            QuarterTurn::X180 => Matrix3::from_columns(&[x, -y, -z]),
            QuarterTurn::X270 => Matrix3::from_columns(&[x, -z, y]),
            QuarterTurn::Y90 => Matrix3::from_columns(&[-z, y, x]),
            QuarterTurn::Y270 => Matrix3::from_columns(&[z, y, -x]),
        }
    }

    /// Return `R v` for each vector `v`, where `R` is the matrix of this rotation.
    #[inline]
    pub fn apply<S: Real, const K: usize>(self, mut v: [Vector3<S>; K]) -> [Vector3<S>; K] {
        macro_rules! each {
            ($x:ident, $y:ident, $z:ident: $($to:expr),+) => {
                for k in 0..K {
                    let [$x, $y, $z] = v[k].array();
                    v[k] = Vector3::from([$($to),+]);
                }
            };
        }
        match self {
            QuarterTurn::None => {}
            QuarterTurn::X90 => each!(x, y, z: x, -z, y),
            QuarterTurn::X180 => each!(x, y, z: x, -y, -z),
            QuarterTurn::X270 => each!(x, y, z: x, z, -y),
            QuarterTurn::Y90 => each!(x, y, z: z, y, -x),
            QuarterTurn::Y270 => each!(x, y, z: -z, y, x),
        }
        v
    }

    /// Return `R' v` for each vector `v`, where `R` is the matrix of this rotation.
    #[inline]
    pub fn apply_transposed<S: Real, const K: usize>(self, v: [Vector3<S>; K]) -> [Vector3<S>; K] {
        let inverse = match self {
            QuarterTurn::X90 => QuarterTurn::X270,
            QuarterTurn::X270 => QuarterTurn::X90,
            QuarterTurn::Y90 => QuarterTurn::Y270,
            QuarterTurn::Y270 => QuarterTurn::Y90,
            own => own,
        };
        inverse.apply(v)
    }

    /// Return `R p R'`, where `R` is the matrix of this rotation.
    #[inline]
    pub fn congruence<S: Real>(self, p: Sym3<S>) -> Sym3<S> {
        let [xx, xy, yy, xz, yz, zz] = p.0;
        match self {
            QuarterTurn::None => p,
            QuarterTurn::X90 => Sym3([xx, -xz, zz, xy, -yz, yy]),
            QuarterTurn::X180 => Sym3([xx, -xy, yy, -xz, yz, zz]),
            QuarterTurn::X270 => Sym3([xx, xz, zz, -xy, -yz, yy]),
            QuarterTurn::Y90 => Sym3([zz, yz, yy, -xz, -xy, xx]),
            QuarterTurn::Y270 => Sym3([zz, -yz, yy, -xz, xy, xx]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_the_rotations_they_stand_for() {
        let half = std::f64::consts::FRAC_PI_2;
        let angles = [[0.0, 0.0], [half, 0.0], [2.0 * half, 0.0], [-half, 0.0], [0.0, half], [0.0, -half]];
        let m = Matrix3::from_columns(&[Vector3::from([1.0, 2.0, 3.0]), Vector3::from([-4.0, 5.0, 6.0]), Vector3::from([7.0, -8.0, 9.0])]);
        let p = Sym3([1.0, 2.0, -3.0, 4.0, 5.0, 6.0]);
        for (turn, [roll, pitch]) in QuarterTurn::ALL.into_iter().zip(angles) {
            let r = Matrix3::from_rpy([roll, pitch, 0.0]);
            assert_eq!(QuarterTurn::of(&r), Some(turn));
            assert_eq!(turn.after(m), m.times(r));
            assert_eq!(turn.apply(m.axes()), r.times(m).axes());
            assert_eq!(turn.apply_transposed(m.axes()), r.transpose().times(m).axes());
            assert_eq!(turn.congruence(p), p.rotated(r));
        }
        assert_eq!(QuarterTurn::of(&Matrix3::from_rpy([0.0, 0.0, half])), None);
        assert_eq!(QuarterTurn::of(&Matrix3::from_rpy([half - 1e-12, 0.0, 0.0])), None);
    }
}
