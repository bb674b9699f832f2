//! Forward dynamics by articulated bodies (Featherstone 2008, chapter 7), in world axes, every body about its
//! own joint origin, with accelerations of material points so that no linear velocity is needed:
//!
//! ```text
//! F_i = IA_i A_i + b_i,   A_i = X A_p + c_i + S a_i,   c = (w_p x (w_p x p) [+ 2 w_p x z v], w_p x z v)
//! U = IA S,  D = S.U + armature,  a_i = (tau - S.b - U.(X A_p + c)) / D
//! IA_p += X' (IA - U U'/D) X,   b_p += X' (b + (IA - U U'/D) c + U (tau - S.b) / D)
//! ```

use super::workspace::Articulated;
use crate::arm::{BASE, Tree};
use crate::kinematics::{Pose, place_body};
use crate::scalar::Real;
use crate::spatial::{M3, Sym3, V3};

#[inline(always)]
pub fn forward_dynamics<S: Real>(
    tree: &Tree<S>,
    poses: &mut [Pose<S>],
    bodies: &mut [Articulated<S>],
    trig: &[(S, S)],
    q: &[S],
    v: &[S],
    tau: &[S],
    a: &mut [S],
) {
    let n = tree.n();
    let root = Pose::identity();
    for i in 0..n {
        let body = &tree.bodies[i];
        let (parent, w_p) = if body.parent == BASE { (root, V3::zero()) } else { (poses[body.parent], bodies[body.parent].w) };
        let pose = place_body(body, &parent, trig[i], q[i]);
        let p = pose.origin - parent.origin;
        let z = pose.z();
        let out = &mut bodies[i];
        out.p = p;
        out.ca = w_p.cross(w_p.cross(p));
        let wz = w_p.cross(z);
        if body.revolute {
            out.cw = wz.scale(v[i]);
            out.w = z.scale_add(v[i], w_p);
        } else {
            out.cw = V3::zero();
            out.ca = wz.scale_add(v[i] + v[i], out.ca);
            out.w = w_p;
        }
        let inertia = body.inertia.rotated(pose.rotation);
        let (w, h, zero) = (out.w, inertia.moment, S::zero());
        out.f = w.cross(w.cross(h));
        out.n = w.cross(inertia.inertia.apply(w));
        let m = inertia.mass;
        out.mass = Sym3([m, zero, m, zero, zero, m]);
        // wd x h = -[h]x wd, by columns.
        out.h = M3([V3([zero, -h[2], h[1]]), V3([h[2], zero, -h[0]]), V3([-h[1], h[0], zero])]);
        out.inertia = inertia.inertia;
        poses[i] = pose;
    }
    for i in (0..n).rev() {
        let body = &tree.bodies[i];
        let z = poses[i].z();
        let me = &mut bodies[i];
        let (uf, un, d, bias) = if body.revolute {
            let un = me.inertia.apply(z);
            (me.h.apply(z), un, z.dot(un), z.dot(me.n))
        } else {
            let uf = me.mass.apply(z);
            (uf, me.h.apply_transposed(z), z.dot(uf), z.dot(me.f))
        };
        me.inverse = (d + S::splat(body.armature)).recip();
        me.u = tau[i] - bias;
        (me.uf, me.un) = (uf, un);
        if body.parent == BASE {
            continue;
        }
        let minus = -me.inverse;
        let mass = me.mass.add_outer(uf, minus);
        let inertia = me.inertia.add_outer(un, minus);
        let scaled = un.scale(me.inverse);
        let h = M3([uf.scale_sub(scaled[0], me.h.0[0]), uf.scale_sub(scaled[1], me.h.0[1]), uf.scale_sub(scaled[2], me.h.0[2])]);
        let gain = me.u * me.inverse;
        let f = mass.apply_add(me.ca, h.apply_add(me.cw, uf.scale_add(gain, me.f)));
        let moment = inertia.apply_add(me.cw, h.apply_transposed(me.ca) + un.scale_add(gain, me.n));
        let p = me.p;
        let (h, inertia) = shifted(&mass, h, &inertia, p);
        let up = &mut bodies[body.parent];
        up.mass = up.mass.add(&mass);
        for k in 0..3 {
            up.h.0[k] += h.0[k];
        }
        up.inertia = up.inertia.add(&inertia);
        up.f += f;
        up.n = p.cross_add(f, up.n + moment);
    }
    let ground = -tree.gravity.lift::<S>();
    for i in 0..n {
        let body = &tree.bodies[i];
        let (a_p, wd_p) = if body.parent == BASE { (ground, V3::zero()) } else { (bodies[body.parent].a, bodies[body.parent].wd) };
        let z = poses[i].z();
        let me = &mut bodies[i];
        let lin = wd_p.cross_add(me.p, a_p + me.ca);
        let ang = wd_p + me.cw;
        let rate = (me.u - (me.uf.dot(lin) + me.un.dot(ang))) * me.inverse;
        a[i] = rate;
        if body.revolute {
            (me.a, me.wd) = (lin, z.scale_add(rate, ang));
        } else {
            (me.a, me.wd) = (z.scale_add(rate, lin), ang);
        }
    }
}

/// Blocks of an articulated inertia about the point from which its old origin is seen at `p`:
/// `H' = H - M [p]x`, `I' = I - H' [p]x + [p]x H'` with the first `H` transposed.
#[inline(always)]
fn shifted<S: Real>(mass: &Sym3<S>, h: M3<S>, inertia: &Sym3<S>, p: V3<S>) -> (M3<S>, Sym3<S>) {
    let [x, y, z] = p.0;
    let (m0, m1, m2) = (mass.column(0), mass.column(1), mass.column(2));
    // Column k of M [p]x is M (p x e_k).
    let moved =
        M3([m1.scale_sub(z, m2.scale_add(y, h.0[0])), m2.scale_sub(x, m0.scale_add(z, h.0[1])), m0.scale_sub(y, m1.scale_add(x, h.0[2]))]);
    // (H' [p]x) with H transposed: entry (i, k) is column i of H dotted with p x e_k.
    let first = |i: usize, k: usize, from: S| {
        let c = h.0[i];
        match k {
            0 => c[1].neg_mul_add(z, c[2].mul_add(y, from)),
            1 => c[2].neg_mul_add(x, c[0].mul_add(z, from)),
            _ => c[0].neg_mul_add(y, c[1].mul_add(x, from)),
        }
    };
    // ([p]x H'): entry (i, k) is component i of p x (column k).
    let second = |i: usize, k: usize, from: S| {
        let c = moved.0[k];
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
