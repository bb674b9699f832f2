//! Forward dynamics by articulated bodies (Featherstone 2008, chapter 7), in world axes. The quantities of a body refer to its joint
//! origin. Accelerations are accelerations of material points, so no linear velocity occurs. Spatial vectors have the linear part first.
//!
//! ```text
//! F_i = IA_i A_i + b_i,   A_i = X A_p + c_i + S a_i,   c = (w_p x (w_p x p) [+ 2 w_p x z v], w_p x z v)
//! U = IA S,  D = S.U + armature,  a_i = (tau - S.b - U.(X A_p + c)) / D
//! IA_p += X' (IA - U U'/D) X,   b_p += X' (b + (IA - U U'/D) c + U (tau - S.b) / D)
//! ```
//!
//! `F_i` is the spatial force of joint `i` on its body, `A_i` the spatial acceleration of the body, and `a_i` the joint acceleration. The
//! index `p` is the parent body. The vector `p` is the joint origin relative to the joint origin of the parent. `S` is the unit motion of
//! the joint, `z` its axis, `v` its rate, and `w_p` the angular velocity of the parent. `IA` is the articulated inertia, `b` its bias
//! force, and `X` the change of the reference point by `p`. The prime is the transpose. In `c`, the term in brackets is for prismatic
//! joints, and the angular part `w_p x z v` for revolute joints. The base has the acceleration `-gravity`.

use super::workspace::{Articulated, Handle, Workspace};
use crate::arm::{BASE, Tree};
use crate::kinematics::{Pose, from_parent, place_body};
use crate::scalar::Real;
use crate::spatial::{Inertia, Lift, Matrix, Matrix3, Sym3, Vector, Vector3};

/// Compute `a = M^-1 (tau - C v - g)`, `(n,)`.
pub fn forward_dynamics<S: Real>(tree: &Tree<S>, ws: &mut Workspace<S>, trig: &[(S, S)], q: &[S], v: &[S], tau: &[S], a: &mut [S]) {
    let (poses, bodies) = (&mut ws.poses[..], &mut ws.articulated[..]);
    place(tree, poses, bodies, trig, q, v);
    gather(tree, poses, bodies, tau);
    accelerate(tree, poses, bodies, a);
}

/// Pass outwards: compute poses and velocities, and the inertia and the forces of each body alone.
fn place<S: Real>(tree: &Tree<S>, poses: &mut [Pose<S>], bodies: &mut [Articulated<S>], trig: &[(S, S)], q: &[S], v: &[S]) {
    let base = || (Pose::identity(), Vector3::zero());
    let mut last = base();
    for i in 0..tree.bodies.len() {
        let body = &tree.bodies[i];
        let (parent, w_p) = from_parent(body.parent, i, last, |p| (poses[p], bodies[p].w), base);
        let pose = place_body(body, &parent, trig[i], q[i]);
        let p = pose.origin - parent.origin;
        let z = pose.z();
        let out = &mut bodies[i];
        out.p = p;
        let mut ca = w_p.cross(w_p.cross(p));
        let wz = w_p.cross(z);
        let w = if body.revolute {
            out.cw = wz.scale(v[i]);
            z.scale_add(v[i], w_p)
        } else {
            out.cw = Vector3::zero();
            ca = wz.scale_add(v[i] + v[i], ca);
            w_p
        };
        (out.ca, out.w) = (ca, w);
        let Inertia { mass: m, moment: h, inertia } = body.inertia.rotated(pose.rotation);
        let zero = S::zero();
        out.handle = Handle {
            mass: Sym3([m, zero, m, zero, zero, m]),
            // The columns of the matrix `-[h]x`, because the angular acceleration `wd` contributes `wd x h = -[h]x wd`.
            h: Matrix3::from_columns(&[
                Vector3::from([zero, -h[2], h[1]]),
                Vector3::from([h[2], zero, -h[0]]),
                Vector3::from([-h[1], h[0], zero]),
            ]),
            inertia,
            f: w.cross(w.cross(h)),
            n: w.cross(inertia.apply(w)),
        };
        poses[i] = pose;
        last = (pose, w);
    }
}

/// Pass inwards: compute the articulated inertia and the bias force of each subtree, about its joint.
fn gather<S: Real>(tree: &Tree<S>, poses: &[Pose<S>], bodies: &mut [Articulated<S>], tau: &[S]) {
    // A local variable has the sum for the parent if the parent is the next body. So the sum can stay in registers.
    let (mut carried, mut carried_to) = (Handle::default(), BASE);
    for i in (0..tree.bodies.len()).rev() {
        let body = &tree.bodies[i];
        let z = poses[i].z();
        let me = &mut bodies[i];
        let mut ia = me.handle;
        if carried_to == i {
            ia = ia.plus(&carried);
        }
        let (uf, un, d, bias) = if body.revolute {
            let un = ia.inertia.apply(z);
            (ia.h.apply(z), un, z.dot(un), z.dot(ia.n))
        } else {
            let uf = ia.mass.apply(z);
            (uf, ia.h.apply_transposed(z), z.dot(uf), z.dot(ia.f))
        };
        let inverse = (d + body.armature).recip();
        let u = tau[i] - bias;
        (me.inverse, me.u, me.uf, me.un) = (inverse, u, uf, un);
        if body.parent == BASE {
            continue;
        }
        let mass = ia.mass.add_outer(uf, -inverse);
        let inertia = ia.inertia.add_outer(un, -inverse);
        let scaled = un.scale(inverse);
        let h = Matrix3::from_columns(&[
            uf.scale_sub(scaled[0], ia.h.axis(0)),
            uf.scale_sub(scaled[1], ia.h.axis(1)),
            uf.scale_sub(scaled[2], ia.h.axis(2)),
        ]);
        let gain = u * inverse;
        let f = mass.apply_add(me.ca, h.apply_add(me.cw, uf.scale_add(gain, ia.f)));
        let moment = inertia.apply_add(me.cw, h.apply_transposed(me.ca) + un.scale_add(gain, ia.n));
        let p = me.p;
        let (h, inertia) = shifted(&mass, h, &inertia, p);
        let moved = Handle { mass, h, inertia, f, n: p.cross_add(f, moment) };
        if body.parent + 1 == i {
            (carried, carried_to) = (moved, body.parent);
        } else {
            bodies[body.parent].handle = bodies[body.parent].handle.plus(&moved);
        }
    }
}

/// Pass outwards: compute the acceleration of each joint from the acceleration of its parent body.
fn accelerate<S: Real>(tree: &Tree<S>, poses: &[Pose<S>], bodies: &mut [Articulated<S>], a: &mut [S]) {
    let ground = || (-tree.gravity.lift::<S>(), Vector3::zero());
    let mut last = ground();
    for i in 0..tree.bodies.len() {
        let body = &tree.bodies[i];
        let (a_p, wd_p) = from_parent(body.parent, i, last, |p| (bodies[p].a, bodies[p].wd), ground);
        let z = poses[i].z();
        let me = &mut bodies[i];
        let lin = wd_p.cross_add(me.p, a_p + me.ca);
        let ang = wd_p + me.cw;
        let rate = (me.u - (me.uf.dot(lin) + me.un.dot(ang))) * me.inverse;
        a[i] = rate;
        last = if body.revolute { (lin, z.scale_add(rate, ang)) } else { (z.scale_add(rate, lin), ang) };
        (me.a, me.wd) = last;
    }
}

/// Move the blocks of an articulated inertia to a new point. `p` is the old point relative to the new one.
///
/// `H_new = H - M [p]x`, `I_new = I - H' [p]x + [p]x H_new`, where `H'` is `H` transposed, and `[p]x` is the cross-product matrix.
fn shifted<S: Real>(mass: &Sym3<S>, h: Matrix3<S>, inertia: &Sym3<S>, p: Vector3<S>) -> (Matrix3<S>, Sym3<S>) {
    let [x, y, z] = p.array();
    let (m0, m1, m2) = (mass.column(0), mass.column(1), mass.column(2));
    // Column `k` of `M [p]x` is `M (p x e_k)`.
    let moved = Matrix3::from_columns(&[
        m1.scale_sub(z, m2.scale_add(y, h.axis(0))),
        m2.scale_sub(x, m0.scale_add(z, h.axis(1))),
        m0.scale_sub(y, m1.scale_add(x, h.axis(2))),
    ]);
    // The matrix `H' [p]x`, where `H'` is the transpose of `H`: entry `(i, k)` is the dot product of column `i` of `H` with `p x e_k`.
    let first = |i: usize, k: usize, from: S| {
        let c = h.axis(i);
        match k {
            0 => c[1].neg_mul_add(z, c[2].mul_add(y, from)),
            1 => c[2].neg_mul_add(x, c[0].mul_add(z, from)),
            _ => c[0].neg_mul_add(y, c[1].mul_add(x, from)),
        }
    };
    // The matrix `[p]x H_new`: entry `(i, k)` is component `i` of `p x (column k of H_new)`.
    let second = |i: usize, k: usize, from: S| {
        let c = moved.axis(k);
        match i {
            0 => y.mul_add(c[2], z.neg_mul_add(c[1], from)),
            1 => z.mul_add(c[0], x.neg_mul_add(c[2], from)),
            _ => x.mul_add(c[1], y.neg_mul_add(c[0], from)),
        }
    };
    let e = inertia.0;
    let entry = |i: usize, k: usize, from: S| second(i, k, first(i, k, from));
    let inertia = Sym3([entry(0, 0, e[0]), entry(1, 0, e[1]), entry(1, 1, e[2]), entry(2, 0, e[3]), entry(2, 1, e[4]), entry(2, 2, e[5])]);
    (moved, inertia)
}
