//! Two revolute joints in a vertical plane, in closed form:
//!
//! `M = [[a1 + 2 a2 c2, a3 + a2 c2], [a3 + a2 c2, a3]]`, `C v = a2 s2 (-v2 (2 v1 + v2), v1^2)`,
//! `g = (a4 c1 + a5 c12, a5 c12)`, `p = (l1 c1 + l2 c12, l1 s1 + l2 s12)` (Siciliano et al. 2009, section 7.3.2).
//!
//! Whether a tree of bodies is such an arm is found by asking it: the coefficients are read off a few configurations and
//! checked against the tree's own algorithms at others.

use super::{AnyArm, Dynamics, Model};
use crate::scalar::Real;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Planar2R {
    /// `a1 .. a5`, kg m^2 and N m.
    pub a: [f64; 5],
    /// `l1, l2` to the frame, m.
    pub l: [f64; 2],
}

/// What is compared: `M` (4), `C v` (2), `g` (2), `x y` of the frame and their Jacobian (6).
type Facts = [f64; 14];

/// Relative to the largest of its kind, what rounding and a tilted axis of no consequence leave.
const TOLERANCE: f64 = 1e-13;

impl Planar2R {
    /// The closed form of `model` with `frame` at its tip, if it is such an arm.
    pub fn of(model: &Model, frame: usize) -> Option<Self> {
        if model.n() != 2 || !model.angles().iter().all(|&angle| angle) || matches!(model, Model::PlanarPr(_)) {
            return None;
        }
        let arm = AnyArm::<f64>::from_lanes(|_| model);
        let mut ws = arm.workspace();
        let mut ask = |q: [f64; 2], v: [f64; 2]| -> Facts {
            let trig = q.map(Real::sin_cos);
            let (mut m, mut bias, mut g, mut j) = ([0.0; 4], [0.0; 2], [0.0; 2], [0.0; 12]);
            arm.mass_matrix(&mut ws, &trig, &q, &mut m);
            arm.bias(&mut ws, &trig, &q, &v, &mut bias);
            arm.gravity(&mut ws, &trig, &q, &mut g);
            let p = arm.jacobian(&mut ws, &trig, &q, frame, &mut j);
            [m[0], m[1], m[2], m[3], bias[0] - g[0], bias[1] - g[1], g[0], g[1], p.0[0], p.0[1], j[0], j[1], j[2], j[3]]
        };
        let (straight, folded, up) = (ask([0.0; 2], [0.0; 2]), ask([0.0, std::f64::consts::PI], [0.0; 2]), ask([0.0, 1.0], [0.0; 2]));
        let (a3, a2) = (straight[3], 0.5 * (straight[1] - folded[1]));
        let a5 = straight[7];
        let closed = Planar2R {
            a: [straight[0] - 2.0 * a2, a2, a3, straight[6] - a5, a5],
            l: [0.5 * (straight[8] + folded[8]), 0.5 * (straight[8] - folded[8])],
        };
        let scale: Facts = std::array::from_fn(|k| {
            let size = |facts: &Facts, range: std::ops::Range<usize>| facts[range].iter().fold(0.0f64, |most, x| most.max(x.abs()));
            // Coriolis terms at the rates below are of the size of the mass matrix.
            let kind = match k {
                0..6 => 0..4,
                6..8 => 6..8,
                _ => 8..10,
            };
            [&straight, &folded, &up].iter().map(|facts| size(facts, kind.clone())).fold(0.0, f64::max)
        });
        for (q, v) in [([0.3, 1.1], [1.0, -0.7]), ([-2.2, -0.4], [-0.5, 1.0]), ([1.4, 2.9], [0.8, 0.9])] {
            let (got, want) = (closed.facts(q, v), ask(q, v));
            let agree = (0..14).all(|k| (got[k] - want[k]).abs() <= TOLERANCE * scale[k]);
            if !agree {
                return None;
            }
        }
        Some(closed)
    }

    fn facts(&self, q: [f64; 2], v: [f64; 2]) -> Facts {
        let ([a1, a2, a3, a4, a5], [l1, l2]) = (self.a, self.l);
        let ((s1, c1), (s2, c2)) = (Real::sin_cos(q[0]), Real::sin_cos(q[1]));
        let (s12, c12) = (s1 * c2 + c1 * s2, c1 * c2 - s1 * s2);
        let m12 = a3 + a2 * c2;
        let h = a2 * s2;
        let (x, y) = (l1 * c1 + l2 * c12, l1 * s1 + l2 * s12);
        [
            a1 + 2.0 * a2 * c2,
            m12,
            m12,
            a3,
            -h * v[1] * (2.0 * v[0] + v[1]),
            h * v[0] * v[0],
            a4 * c1 + a5 * c12,
            a5 * c12,
            x,
            y,
            -y,
            -l2 * s12,
            x,
            l2 * c12,
        ]
    }
}
