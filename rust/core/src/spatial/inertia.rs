//! The inertia of a body about its frame origin: mass `m`, first moment `h = m c`, second moment `I`, with
//!
//! `f = m a + wd x h + w x (w x h)`, `n = I wd + w x I w + h x a`  (a: acceleration of the origin).
//!
//! A shift of the reference point by `-p` moves the old origin to `p` relative to the new one. Then `h' = h + m p` and
//! `I' = I + (h.p + p.h') 1 - (p h' + h p')`, symmetrised (Huygens-Steiner).

use super::{Matrix, Matrix3, Placement, Sym3, Vector, Vector3};
use crate::scalar::Real;

/// Inertial parameters per body.
pub const PARAMETERS: usize = 10;

/// The index of each parameter: `m`, `h`, then the inertia in `Sym3`'s order.
pub mod parameter {
    pub const MASS: usize = 0;
    pub const FIRST_MOMENT: usize = 1;
    pub const INERTIA: usize = 4;
    pub const NAMES: [&str; 10] = ["m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz"];
}

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
    /// The inertia from ten numbers in SPEC order.
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
    /// The same body in axes rotated by `r` (`x_new = r x_old`), about the same point.
    #[inline]
    pub fn rotated(&self, r: Matrix3<S>) -> Inertia<S> {
        Inertia { mass: self.mass, moment: r.apply(self.moment), inertia: self.inertia.rotated(r) }
    }
    /// The same body about a new point; `p` is the old origin relative to the new one.
    #[inline]
    pub fn shifted(&self, p: Vector3<S>) -> Inertia<S> {
        let h = self.moment;
        let moment = p.scale_add(self.mass, h);
        // p h'^T + h p^T is symmetric; twice its trace part is h.p + p.h'.
        let t = |i: usize, j: usize| p[i].mul_add(moment[j], h[i] * p[j]);
        let (xx, yy, zz) = (t(0, 0), t(1, 1), t(2, 2));
        let i = self.inertia.0;
        let inertia = Sym3([i[0] + (yy + zz), i[1] - t(0, 1), i[2] + (xx + zz), i[3] - t(0, 2), i[4] - t(1, 2), i[5] + (xx + yy)]);
        Inertia { mass: self.mass, moment, inertia }
    }
}

impl Inertia<f64> {
    /// The inertia from mass, centre of mass and inertia about the centre of mass, all in the body's axes.
    pub fn about_com(mass: f64, com: Vector3<f64>, inertia: Sym3<f64>) -> Self {
        Inertia { mass, moment: Vector3::zero(), inertia }.shifted(com)
    }
    /// The same body in the frame in which it is placed.
    pub fn placed(&self, x: &Placement) -> Self {
        self.rotated(x.rotation).shifted(x.translation)
    }
    /// Centre of mass, and the inertia about it. For a body without mass, `None` and the inertia about the origin.
    pub fn com(&self) -> (Option<Vector3<f64>>, Sym3<f64>) {
        // Divided entry by entry: the reciprocal of a subnormal mass is infinite.
        let com = Vector3::from(self.moment.array().map(|h| h / self.mass));
        let central = self.shifted(-com).inertia;
        if com.array().iter().chain(&central.0).all(|x| x.is_finite()) { (Some(com), central) } else { (None, self.inertia) }
    }
    pub fn is_zero(&self) -> bool {
        self.mass == 0.0 && self.moment.array() == [0.0; 3] && self.inertia.0 == [0.0; 6]
    }
}
