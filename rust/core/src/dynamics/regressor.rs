//! The Slotine-Li regressor `Y(q, v, vr, ar) pi = M ar + C(q, v) vr + g`, with the Christoffel factorisation `C`.
//!
//! A body with the acceleration field `a + U r` (`newton_euler`) resists the unit motion of a joint with the torque below. `(v, w)` are the
//! velocity of the body's origin and the angular velocity in this motion:
//!
//! `tau = m (v.a) + h.(U' v + a x w) + <sym([w]x' U), integral of r r' dm>`,
//!
//! which is linear in the ten parameters of the body. `m` and `h` are mass and first moment. `<A, B> = tr(A' B)`, the prime is the
//! transpose, and `[w]x` is a cross-product matrix. Fields and motions are computed outwards, in body axes. `Y' s` is the same expression,
//! for the motion `(v, w)` of the body under the joint rates `s`.

use super::hinge::to_body;
use super::newton_euler::{inwards, moment_of, outwards};
use super::workspace::{BodyMotion, Field, Link, Workspace};
use crate::arm::{BASE, Body, Tree, second_moment};
use crate::interrupt;
use crate::scalar::Real;
use crate::spatial::{Inertia, Lift, Matrix, PARAMETERS, Spatial, Vector, Vector3};

impl<S: Real> Field<S> {
    fn of(body: &Body<S>, motion: &BodyMotion<S>) -> Self {
        let BodyMotion { mut a, mut u, wd: mut d, .. } = *motion;
        if let Some(turn) = body.turn {
            let back = turn.lift::<S>().transpose();
            (a, d, u) = (back.apply_transposed(a), back.apply_transposed(d), back.congruence_transposed(u));
        }
        let [x, y, z] = u.axes();
        let off = Vector3::from([x[1] - d[2], x[2] + d[1], y[2] - d[0]]);
        Field { a, u, d, off, differences: Vector3::from([x[0] - y[1], z[2] - x[0], y[1] - z[2]]) }
    }

    /// The torque per unit parameter, in the order of the parameters, under the motion `(v, w)`.
    fn coefficients(&self, v: Vector3<S>, w: Vector3<S>) -> [S; PARAMETERS] {
        let Field { a, u, d, off, differences } = self;
        let h = a.cross_add(w, u.apply_transposed(v));
        // The terms <sym([w]x' U), tr(I)/2 1 - I>, ordered by the components of w.
        let [ux, uy, uz] = u.axes();
        let [xy, xz, yz] = off.array();
        let three = |x: S, y: S, z: S| w[0].mul_add(x, w[1].mul_add(y, w[2] * z));
        [
            v.dot(*a),
            h[0],
            h[1],
            h[2],
            three(d[0], xz, -xy),
            three(-ux[2], uy[2], differences[0]),
            three(-yz, d[1], xy),
            three(ux[1], differences[1], -uz[1]),
            three(differences[2], -uy[0], uz[0]),
            three(yz, -xz, d[2]),
        ]
    }

    /// The torque per unit parameter under the unit rotation about the z axis at the origin.
    fn about_z(&self) -> [S; PARAMETERS] {
        let Field { a, u, d, off, differences } = self;
        let zero = S::zero();
        [zero, a[1], -a[0], zero, -off[0], differences[0], off[0], -u[(1, 2)], u[(0, 2)], d[2]]
    }

    /// The torque per unit parameter under the translation `v`.
    fn along(&self, v: Vector3<S>) -> [S; PARAMETERS] {
        let (h, zero) = (self.u.apply_transposed(v), S::zero());
        [v.dot(self.a), h[0], h[1], h[2], zero, zero, zero, zero, zero, zero]
    }
}

/// Convert a vector from the internal axes of a body to the axes of its parameters.
fn turned<S: Real>(body: &Body<S>, v: Vector3<S>) -> Vector3<S> {
    match body.turn {
        None => v,
        Some(turn) => turn.lift::<S>().apply(v),
    }
}

/// The unit motion of a joint, in the axes of its body.
fn unit<S: Real>(revolute: bool) -> Spatial<S> {
    let (still, along) = (Vector3::zero(), Vector3::from([S::zero(), S::zero(), S::splat(1.0)]));
    if revolute { Spatial { linear: still, angular: along } } else { Spatial { linear: along, angular: still } }
}

/// Convert a motion of the parent, at the parent's origin, to the motion of the body at the body's origin.
fn carried<S: Real>(body: &Body<S>, link: &Link<S>, trig: (S, S), t: Spatial<S>) -> Spatial<S> {
    let at_joint = if body.concentric { t.linear } else { t.angular.cross_add(link.p, t.linear) };
    let [linear, angular] = to_body(body, &link.e, trig, [at_joint, t.angular]);
    Spatial { linear, angular }
}

/// Write the regressor `Y`, `(n, width)`, row-major, with `width >= 10 n`, to `y`, for a tree of `n` bodies. Before the call, `y` contains
/// zeros, or an earlier `Y` of this tree.
///
/// Entries that are not written are zero at every state. Columns after the inertial parameters do not change. The outer loop is over
/// joints, and the inner loop over the bodies outwards from the joint.
pub fn regressor<S: Real>(
    tree: &Tree<S>,
    width: usize,
    ws: &mut Workspace<S>,
    trig: &[(S, S)],
    q: &[S],
    [v, v_r, a_r]: [&[S]; 3],
    y: &mut [S],
) {
    let (links, fields) = (&mut ws.links[..], &mut ws.fields[..]);
    let n = tree.bodies.len();
    let mut put = |joint: usize, body: usize, block: &[S; PARAMETERS]| {
        y[joint * width + PARAMETERS * body..][..PARAMETERS].copy_from_slice(block);
    };
    let mut motion = BodyMotion::default();
    for i in 0..n {
        let body = &tree.bodies[i];
        if body.parent != BASE && body.parent + 1 != i {
            motion = links[body.parent].motion;
        }
        motion = outwards::<S, true>(tree, body, &motion, &mut links[i], (trig[i], q[i]), (v[i], v_r[i], Some(a_r[i])));
        if body.forks {
            links[i].motion = motion;
        }
        fields[i] = Field::of(body, &motion);
    }
    for j in 0..n {
        interrupt::check_at_row(j);
        let Body { revolute, end, turn, .. } = tree.bodies[j];
        let mut twist = unit(revolute);
        if tree.bodies[j].forks {
            links[j].twist = twist;
        }
        let own = if !revolute {
            fields[j].along(turned(&tree.bodies[j], twist.linear))
        } else if turn.is_none() {
            fields[j].about_z()
        } else {
            fields[j].coefficients(Vector3::zero(), turned(&tree.bodies[j], twist.angular))
        };
        put(j, j, &own);
        for i in j + 1..end {
            let body = &tree.bodies[i];
            if body.parent + 1 != i {
                twist = links[body.parent].twist;
            }
            twist = carried(body, &links[i], trig[i], twist);
            if body.forks {
                links[i].twist = twist;
            }
            let block = if revolute {
                fields[i].coefficients(turned(body, twist.linear), turned(body, twist.angular))
            } else {
                fields[i].along(turned(body, twist.linear))
            };
            put(j, i, &block);
        }
    }
}

/// Add `Y pi` to `y_pi`, and write `Y' s` to `yt_s`, in O(n). `Y` is the regressor, `pi` any parameters, and `s` any joint rates.
pub fn regressor_products<S: Real>(
    tree: &Tree<S>,
    links: &mut [Link<S>],
    trig: &[(S, S)],
    q: &[S],
    [v, v_r, a_r]: [&[S]; 3],
    (pi, y_pi): (&[S], &mut [S]),
    (s, yt_s): (&[S], &mut [S]),
) {
    let mut motion = BodyMotion::default();
    for i in 0..tree.bodies.len() {
        let body = &tree.bodies[i];
        if body.parent != BASE && body.parent + 1 != i {
            motion = links[body.parent].motion;
        }
        motion = outwards::<S, true>(tree, body, &motion, &mut links[i], (trig[i], q[i]), (v[i], v_r[i], Some(a_r[i])));
        let field = Field::of(body, &motion);
        let given = Inertia::from_parameters(&pi[PARAMETERS * i..][..PARAMETERS]);
        let h = given.moment;
        let f = field.u.apply_add(h, field.a.scale(given.mass));
        let moment = moment_of(field.u, &second_moment(&given.inertia), h.cross(field.a));
        // The motion of this body under the joint rates `s`.
        let mut twist = if body.parent == BASE { Spatial::zero() } else { carried(body, &links[i], trig[i], links[body.parent].twist) };
        if body.revolute {
            twist.angular[2] += s[i];
        } else {
            twist.linear[2] += s[i];
        }
        yt_s[PARAMETERS * i..][..PARAMETERS].copy_from_slice(&field.coefficients(turned(body, twist.linear), turned(body, twist.angular)));
        let link = &mut links[i];
        link.twist = twist;
        if body.forks {
            link.motion = motion;
        }
        (link.f, link.n) = match body.turn {
            None => (f, moment),
            Some(turn) => (turn.lift::<S>().apply_transposed(f), turn.lift::<S>().apply_transposed(moment)),
        };
    }
    inwards(tree, links, trig, |i, tau| y_pi[i] += tau);
}
