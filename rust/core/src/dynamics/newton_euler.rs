//! Newton-Euler recursion in body axes, without linear velocities (Luh, Walker and Paul 1980). Slotine and Li's law requires its
//! *polarised* form. There, products of the velocity `v` with itself are replaced by symmetric products of `v` and the reference velocity
//! `vr`:
//!
//! ```text
//! U = [wd]x + ([w]x [wr]x + [wr]x [w]x) / 2,   acceleration at r:  a + U r
//! w_i = R' w_p + z v,   wr_i = R' wr_p + z vr
//! wd_i = R' wd_p + z ar + ((w x z) vr + (wr x z) v) / 2,   a_i = R' (a_p + U_p p),   a_0 = -gravity
//! f_i = m a + U h,   n_i = integral of r x (U r) dm + h x a
//! ```
//!
//! These are the equations of a revolute joint. A prismatic joint has no terms with `v`, `vr` and `ar` in `w`, `wr` and `wd`. It adds
//! `z ar + (w x z) vr + (wr x z) v` to `a`. `ar` is the reference acceleration of the joint, `z` the joint axis, and `[w]x` a cross-product
//! matrix. `w`, `wr` and `wd` are the angular velocity, the reference angular velocity and the angular acceleration. `a` is the
//! acceleration of the body's origin, and `m` and `h` are mass and first moment. The index `p` is the parent, and the vector `p` the joint
//! origin in its axes. `R'` is the transpose of the rotation to these axes. `f_i` and `n_i` are the force and the moment of the body alone.
//! The bias is quadratic in the velocity, so its polarised form is `C(q, v) vr` with the Christoffel matrix `C`. With `vr = v` this is the
//! ordinary inverse dynamics.

use super::hinge::{reach, rotation, to_body, to_parent};
use super::workspace::{BodyMotion, Link, Workspace};
use crate::arm::{BASE, Body, Tree};
use crate::kinematics::place;
use crate::scalar::Real;
use crate::spatial::{Lift, Matrix, Matrix3, Sym3, Vector, Vector3};

/// The matrix `U = [wd]x + ([w]x [wr]x + [wr]x [w]x) / 2` of a body's acceleration field.
pub(crate) fn acceleration_matrix<S: Real, const POLAR: bool>(w: Vector3<S>, wr: Vector3<S>, wd: Vector3<S>) -> Matrix3<S> {
    let half = S::splat(0.5);
    let product = |i: usize, j: usize| if POLAR { half * w[i].mul_add(wr[j], w[j] * wr[i]) } else { w[i] * w[j] };
    let square = |i: usize| if POLAR { w[i] * wr[i] } else { w[i] * w[i] };
    let (xx, yy, zz) = (square(0), square(1), square(2));
    let (xy, xz, yz) = (product(0, 1), product(0, 2), product(1, 2));
    Matrix3::from_columns(&[
        Vector3::from([-(yy + zz), xy + wd[2], xz - wd[1]]),
        Vector3::from([xy - wd[2], -(xx + zz), yz + wd[0]]),
        Vector3::from([xz + wd[1], yz - wd[0], -(xx + yy)]),
    ])
}

/// Compute `integral of r x (U r) dm`, plus `c`, from the second moment `Sigma = integral of r r' dm`.
pub(crate) fn moment_of<S: Real>(u: Matrix3<S>, second: &Sym3<S>, c: Vector3<S>) -> Vector3<S> {
    // The integral is the axial vector of U Sigma - (U Sigma)', whose entries are computed here.
    let [xx, xy, yy, xz, yz, zz] = second.0;
    let row = |i: usize| (u[(i, 0)], u[(i, 1)], u[(i, 2)]);
    let ((x0, x1, x2), (y0, y1, y2), (z0, z1, z2)) = (row(0), row(1), row(2));
    let zy = z0.mul_add(xy, z1.mul_add(yy, z2.mul_add(yz, c[0])));
    let xz_ = x0.mul_add(xz, x1.mul_add(yz, x2.mul_add(zz, c[1])));
    let yx = y0.mul_add(xx, y1.mul_add(xy, y2.mul_add(xz, c[2])));
    Vector3::from([
        y0.neg_mul_add(xz, y1.neg_mul_add(yz, y2.neg_mul_add(zz, zy))),
        z0.neg_mul_add(xx, z1.neg_mul_add(xy, z2.neg_mul_add(xz, xz_))),
        x0.neg_mul_add(xy, x1.neg_mul_add(yy, x2.neg_mul_add(yz, yx))),
    ])
}

/// Compute the motion of a body, in its axes, from the motion of its parent. `link` receives the joint's rotation and the joint origin.
/// With `POLAR = false`, `vr` equals `v` and is not read.
pub(crate) fn outwards<S: Real, const POLAR: bool>(
    tree: &Tree<S>,
    body: &Body<S>,
    up: &BodyMotion<S>,
    link: &mut Link<S>,
    (trig, q): ((S, S), S),
    (v, vr, ar): (S, S, Option<S>),
) -> BodyMotion<S> {
    let half = S::splat(0.5);
    let p = reach(body, q);
    link.p = p;
    if body.quarter.is_none() {
        link.e = rotation(body, trig);
    }
    let (mut w, mut wr, mut wd) = (Vector3::zero(), Vector3::zero(), Vector3::zero());
    let mut a;
    if body.parent == BASE {
        [a] = to_body(body, &link.e, trig, [-tree.gravity.lift::<S>()]);
    } else {
        let at_joint = up.u.apply_add(p, up.a);
        if POLAR {
            [w, wr, wd, a] = to_body(body, &link.e, trig, [up.w, up.wr, up.wd, at_joint]);
        } else {
            [w, wd, a] = to_body(body, &link.e, trig, [up.w, up.wd, at_joint]);
            wr = w;
        }
    }
    // `((w x z) vr + (wr x z) v) / 2` is `(cx, -cy, 0)`, because `z` is the third axis.
    let (cx, cy) = if POLAR { (half * w[1].mul_add(vr, wr[1] * v), half * w[0].mul_add(vr, wr[0] * v)) } else { (w[1] * v, w[0] * v) };
    if body.revolute {
        wd[0] += cx;
        wd[1] -= cy;
        if let Some(ar) = ar {
            wd[2] += ar;
        }
        w[2] += v;
        if POLAR {
            wr[2] += vr;
        } else {
            wr = w;
        }
    } else {
        a[0] += cx + cx;
        a[1] -= cy + cy;
        if let Some(ar) = ar {
            a[2] += ar;
        }
    }
    BodyMotion { w, wr, wd, a, u: acceleration_matrix::<S, POLAR>(w, wr, wd) }
}

/// Compute the torque or force of every joint, and pass it to `tau`. `links` has the force `f` and moment `n` of each body, in body axes.
/// The joint input is the component along the joint axis of the sum of these over the subtree of the joint.
pub(crate) fn inwards<S: Real>(tree: &Tree<S>, links: &mut [Link<S>], trig: &[(S, S)], mut tau: impl FnMut(usize, S)) {
    for i in (0..tree.bodies.len()).rev() {
        let body = &tree.bodies[i];
        let Link { p, f, n: moment, .. } = links[i];
        tau(i, if body.revolute { moment[2] } else { f[2] });
        if body.parent != BASE {
            let [f, moment] = to_parent(body, &links[i].e, trig[i], [f, moment]);
            let up = &mut links[body.parent];
            up.f += f;
            up.n = p.cross_add(f, up.n + moment);
        }
    }
}

/// Compute the joint torques `tau = M a + C(q, v) v + g`. `a = None` means zero acceleration.
pub fn newton_euler<S: Real>(tree: &Tree<S>, links: &mut [Link<S>], trig: &[(S, S)], q: &[S], v: &[S], a: Option<&[S]>, tau: &mut [S]) {
    let mut motion = BodyMotion::default();
    for i in 0..tree.bodies.len() {
        let body = &tree.bodies[i];
        if body.parent != BASE && body.parent + 1 != i {
            motion = links[body.parent].motion;
        }
        let link = &mut links[i];
        motion = outwards::<S, false>(tree, body, &motion, link, (trig[i], q[i]), (v[i], v[i], a.map(|a| a[i])));
        let h = body.inertia.moment;
        link.f = motion.u.apply_add(h, motion.a.scale(body.inertia.mass));
        link.n = moment_of(motion.u, &body.second_moment, h.cross(motion.a));
        if body.forks {
            link.motion = motion;
        }
    }
    inwards(tree, links, trig, |i, force| tau[i] = force);
    if let Some(a) = a {
        for i in 0..tree.bodies.len() {
            tau[i] = tree.bodies[i].armature.mul_add(a[i], tau[i]);
        }
    }
}

/// The acceleration `[v; w]` of a frame at zero joint accelerations, in world axes: the product of the rate of its Jacobian and `v`.
pub fn bias_acceleration<S: Real>(
    tree: &Tree<S>,
    ws: &mut Workspace<S>,
    (trig, q): (&[(S, S)], &[S]),
    v: &[S],
    frame: usize,
) -> [Vector3<S>; 2] {
    let at = &tree.frames[frame];
    if at.body == BASE {
        return [Vector3::zero(); 2];
    }
    for i in 0..=at.body {
        let body = &tree.bodies[i];
        let up = if body.parent == BASE { BodyMotion::default() } else { ws.links[body.parent].motion };
        let (position, rate) = (tree.position(i, trig, q), tree.rate(i, v));
        ws.links[i].motion = outwards::<S, false>(tree, body, &up, &mut ws.links[i], position, (rate, rate, None));
    }
    let BodyMotion { u, a, wd, .. } = ws.links[at.body].motion;
    let poses = &mut ws.poses[..=at.body];
    place(tree, trig, q, poses);
    let r = poses[at.body].rotation;
    // The recursion adds the acceleration `-gravity` to every body.
    [r.apply_add(u.apply_add(at.placement.translation.lift(), a), tree.gravity.lift()), r.apply(wd)]
}
