//! The inertia of a body about the origin of its frame: mass `m`, first moment `h = m c`, and moment of inertia `I`. `c` is the centre of
//! mass. The force `f` and the moment `n` on the body are
//!
//! `f = m a + wd x h + w x (w x h)`, `n = I wd + w x I w + h x a`. Here `a` is the acceleration of the origin, and `w, wd` are angular
//! velocity and acceleration.
//!
//! If the reference point moves by `-p`, the old origin is at `p` relative to the new origin. Then `h_new = h + m p` and `I_new = I + (h.p
//! + p.h_new) 1 - (p h_new' + h p')`, where the prime is the transpose (Huygens-Steiner).

use super::{Matrix, Matrix3, Placement, Sym3, Vector, Vector3};
use crate::scalar::Real;

/// The number of inertial parameters of a body.
pub const PARAMETERS: usize = 10;

/// The index of each parameter: `m`, `h`, then the inertia in the order of `Sym3`.
pub mod parameter {
    pub const MASS: usize = 0;
    pub const FIRST_MOMENT: usize = 1;
    pub const INERTIA: usize = 4;
    pub const NAMES: [&str; 10] = ["m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz"];
}

/// The inertia of a body about the origin of its frame.
///
/// ```
/// use armlet_core::spatial::{Inertia, Sym3, Vector3};
///
/// // A point mass of 2 kg at x = 0.5 m.
/// let point = Inertia::about_com(2.0, Vector3::new(0.5, 0.0, 0.0), Sym3::zero());
/// assert_eq!((point.moment.x, point.inertia.0), (1.0, [0.0, 0.0, 0.5, 0.0, 0.0, 0.5]));
/// // About the point x = -1 m.
/// let shifted = point.shifted(Vector3::new(1.0, 0.0, 0.0));
/// assert_eq!((shifted.moment.x, shifted.inertia.0[5]), (3.0, 4.5));
/// assert_eq!(shifted.com().0, Some(Vector3::new(1.5, 0.0, 0.0)));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inertia<S: Real> {
    pub mass: S,
    pub moment: Vector3<S>,
    pub inertia: Sym3<S>,
}

impl<S: Real> Inertia<S> {
    #[inline]
    pub fn zero() -> Self {
        Inertia { mass: S::zero(), moment: Vector3::zero(), inertia: Sym3::zero() }
    }
    /// Return the inertia with these ten parameters, in the order of [`crate::spatial`].
    #[inline]
    pub fn from_parameters(p: &[S]) -> Self {
        Inertia { mass: p[0], moment: Vector3::from([p[1], p[2], p[3]]), inertia: Sym3([p[4], p[5], p[6], p[7], p[8], p[9]]) }
    }
    #[inline]
    pub fn write_parameters(&self, p: &mut [S]) {
        p[0] = self.mass;
        p[1..4].copy_from_slice(&self.moment.array());
        p[4..10].copy_from_slice(&self.inertia.0);
    }
    #[inline]
    pub fn plus(&self, b: &Inertia<S>) -> Inertia<S> {
        Inertia { mass: self.mass + b.mass, moment: self.moment + b.moment, inertia: self.inertia.plus(&b.inertia) }
    }
    /// Return the inertia of the body in axes rotated by `r` (`x_new = r x_old`), about the same point.
    #[inline]
    pub fn rotated(&self, r: Matrix3<S>) -> Inertia<S> {
        Inertia { mass: self.mass, moment: r.apply(self.moment), inertia: self.inertia.rotated(r) }
    }
    /// Return the inertia of the body about a new point. `p` is the old origin relative to the new point, m.
    #[inline]
    pub fn shifted(&self, p: Vector3<S>) -> Inertia<S> {
        let h = self.moment;
        let moment = p.scale_add(self.mass, h);
        // `moment` is the first moment about the new point. The matrix t = p moment' + h p' is symmetric.
        let t = |i: usize, j: usize| p[i].mul_add(moment[j], h[i] * p[j]);
        let (xx, yy, zz) = (t(0, 0), t(1, 1), t(2, 2));
        let i = self.inertia.0;
        let inertia = Sym3([i[0] + (yy + zz), i[1] - t(0, 1), i[2] + (xx + zz), i[3] - t(0, 2), i[4] - t(1, 2), i[5] + (xx + yy)]);
        Inertia { mass: self.mass, moment, inertia }
    }
}

impl Inertia<f64> {
    /// Return the inertia for a mass, kg, a centre of mass, m, and an inertia about the centre of mass, kg m^2. All are in the axes of the
    /// body.
    pub fn about_com(mass: f64, com: Vector3<f64>, inertia: Sym3<f64>) -> Self {
        Inertia { mass, moment: Vector3::zero(), inertia }.shifted(com)
    }
    /// Return the inertia in the frame A, for a body whose frame has the placement `x` in A.
    pub fn placed(&self, x: &Placement) -> Self {
        self.rotated(x.rotation).shifted(x.translation)
    }
    /// Return the centre of mass, m, and the inertia about it, kg m^2. If one of them is not finite, as for a body without mass, return
    /// `None` and the inertia about the origin.
    pub fn com(&self) -> (Option<Vector3<f64>>, Sym3<f64>) {
        // Each component is divided separately, because the reciprocal of a subnormal mass can be infinite.
        let com = Vector3::from(self.moment.array().map(|h| h / self.mass));
        let central = self.shifted(-com).inertia;
        if com.array().iter().chain(&central.0).all(|x| x.is_finite()) { (Some(com), central) } else { (None, self.inertia) }
    }
    pub fn is_zero(&self) -> bool {
        self.mass == 0.0 && self.moment.array() == [0.0; 3] && self.inertia.0 == [0.0; 6]
    }
}
