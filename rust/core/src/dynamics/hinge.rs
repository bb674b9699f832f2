//! Transforms across a joint, between the axes of a body and the axes of its parent: `x_parent = R_0 Rz(q) x + p`, or for a prismatic joint
//! `x_parent = R_0 x + p + R_0 e_z q`. `R_0` and `p` are the placement of the joint at `q = 0`. If `R_0` is a quarter turn, only `Rz`
//! requires multiplications.

use crate::arm::Body;
use crate::scalar::Real;
use crate::spatial::{Lift, Matrix, Matrix3, QuarterTurn, Sym3, Vector, Vector3};

/// The rotation `R_0 Rz(q)` of a revolute joint, or `R_0` of a prismatic joint. It is used only if the placement is not a quarter turn.
pub(crate) fn rotation<S: Real>(body: &Body<S>, trig: (S, S)) -> Matrix3<S> {
    if body.revolute { body.rotation.lift::<S>().rotate_z(trig) } else { body.rotation.lift() }
}

/// The joint's origin relative to the parent's, in the axes of the parent.
pub(crate) fn reach<S: Real>(body: &Body<S>, q: S) -> Vector3<S> {
    let p = body.translation.lift();
    if body.revolute { p } else { body.rotation.axis(2).lift().scale_add(q, p) }
}

/// Transform vectors from the axes of the body to the axes of its parent. `e` is [`rotation`].
pub(crate) fn to_parent<S: Real, const K: usize>(body: &Body<S>, e: &Matrix3<S>, trig: (S, S), v: [Vector3<S>; K]) -> [Vector3<S>; K] {
    over(body.quarter, body.revolute, e, trig, v)
}

/// Transform as [`to_parent`] does. The quarter turn is an argument, so that a loop can select it before the loop begins.
pub(crate) fn over<S: Real, const K: usize>(
    quarter: Option<QuarterTurn>,
    revolute: bool,
    e: &Matrix3<S>,
    (s, c): (S, S),
    mut v: [Vector3<S>; K],
) -> [Vector3<S>; K] {
    match quarter {
        Some(quarter) => {
            if revolute {
                for k in 0..K {
                    let [x, y, z] = v[k].array();
                    v[k] = Vector3::from([x.mul_add(c, -(y * s)), x.mul_add(s, y * c), z]);
                }
            }
            quarter.apply(v)
        }
        None => {
            for k in 0..K {
                v[k] = e.apply(v[k]);
            }
            v
        }
    }
}

/// Transform vectors from the axes of the parent to the axes of the body. `e` is [`rotation`].
pub(crate) fn to_body<S: Real, const K: usize>(body: &Body<S>, e: &Matrix3<S>, (s, c): (S, S), mut v: [Vector3<S>; K]) -> [Vector3<S>; K] {
    match body.quarter {
        Some(quarter) => {
            v = quarter.apply_transposed(v);
            if body.revolute {
                for k in 0..K {
                    let [x, y, z] = v[k].array();
                    v[k] = Vector3::from([x.mul_add(c, y * s), y.mul_add(c, -(x * s)), z]);
                }
            }
            v
        }
        None => {
            for k in 0..K {
                v[k] = e.apply_transposed(v[k]);
            }
            v
        }
    }
}

/// Transform a symmetric matrix from the axes of the body to the axes of its parent. `e` is [`rotation`].
pub(crate) fn congruence<S: Real>(body: &Body<S>, e: &Matrix3<S>, (s, c): (S, S), m: Sym3<S>) -> Sym3<S> {
    match body.quarter {
        Some(quarter) if body.revolute => {
            let [xx, xy, yy, xz, yz, zz] = m.0;
            // First compute the product `Rz M`. Then multiply it by `Rz'`, which rotates its first two columns.
            let (a, b) = (xx.mul_add(c, -(xy * s)), xy.mul_add(c, -(yy * s)));
            let (d, f) = (xx.mul_add(s, xy * c), xy.mul_add(s, yy * c));
            let turned =
                [a.mul_add(c, -(b * s)), a.mul_add(s, b * c), d.mul_add(s, f * c), xz.mul_add(c, -(yz * s)), xz.mul_add(s, yz * c), zz];
            quarter.congruence(Sym3(turned))
        }
        Some(quarter) => quarter.congruence(m),
        None => m.rotated(*e),
    }
}
