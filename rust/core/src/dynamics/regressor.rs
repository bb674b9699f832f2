//! The Slotine-Li regressor `Y(q, v, vr, ar) pi = M ar + C(q, v) vr + g`, C the Christoffel factorisation.
//!
//! A body with acceleration field `a + U r` (see `newton_euler`) resists the unit motion `(v, w)` of a joint with
//!
//! `tau = m (v.a) + h.(U' v + a x w) + <sym([w]x' U), integral of r r' dm>`,
//!
//! linear in the ten parameters. The field is propagated in world axes and read in body axes, where the
//! parameters stand; `Y' s` is the same expression for the motion `(v, w)` of the body under joint rates `s`.

use super::newton_euler::{acceleration_matrix, moment_of};
use super::workspace::{Link, Motion};
use crate::arm::{BASE, Body, Tree, second_moment};
use crate::kinematics::{Pose, from_parent, place_body};
use crate::scalar::Real;
use crate::spatial::{Inertia, M3, PARAMETERS, V3};

/// `tau` per unit parameter, SPEC order, of a body with field `a + U r` under the motion `(v, w)`.
#[inline(always)]
fn coefficients<S: Real>(u: M3<S>, a: V3<S>, v: V3<S>, w: V3<S>, y: &mut [S]) {
    y[0] = v.dot(a);
    let h = a.cross_add(w, u.apply_transposed(v));
    (y[1], y[2], y[3]) = (h[0], h[1], h[2]);
    // G = [w]x' U, column k is U_k x w; integral of r r' dm = tr(I)/2 - I.
    let g = M3([u.0[0].cross(w), u.0[1].cross(w), u.0[2].cross(w)]).0;
    let half = S::splat(0.5) * (g[0][0] + g[1][1] + g[2][2]);
    y[4] = half - g[0][0];
    y[5] = -(g[1][0] + g[0][1]);
    y[6] = half - g[1][1];
    y[7] = -(g[2][0] + g[0][2]);
    y[8] = -(g[2][1] + g[1][2]);
    y[9] = half - g[2][2];
}

/// The rotation from the axes in which a body's parameters stand to world axes.
#[inline(always)]
fn body_axes<S: Real>(body: &Body<S>, pose: &Pose<S>) -> M3<S> {
    match body.turn {
        None => pose.rotation,
        Some(turn) => pose.rotation.times(turn.lift::<S>().transpose()),
    }
}

/// Poses, and the polarised field `(a, U)` of every body in world axes, into `links`.
#[inline(always)]
fn fields<S: Real>(tree: &Tree<S>, poses: &mut [Pose<S>], links: &mut [Link<S>], trig: &[(S, S)], q: &[S], v: &[S], vr: &[S], ar: &[S]) {
    let half = S::splat(0.5);
    let ground = Motion { a: -tree.gravity.lift::<S>(), ..Motion::default() };
    let mut last = Pose::identity();
    for i in 0..tree.n() {
        let body = &tree.bodies[i];
        let parent = from_parent(body.parent, i, last, |p| poses[p], Pose::identity);
        let up = if body.parent == BASE { &ground } else { &links[body.parent].motion };
        let pose = place_body(body, &parent, trig[i], q[i]);
        let (z, p) = (pose.z(), pose.origin - parent.origin);
        let (mut w, mut wr, mut wd) = (up.w, up.wr, up.wd);
        let mut a = up.u.apply_add(p, up.a);
        let twice = w.scale(vr[i]) + wr.scale(v[i]);
        if body.revolute {
            wd = z.scale_add(ar[i], twice.scale(half).cross_add(z, wd));
            w = z.scale_add(v[i], w);
            wr = z.scale_add(vr[i], wr);
        } else {
            a = z.scale_add(ar[i], twice.cross_add(z, a));
        }
        let motion = Motion { w, wr, wd, a, u: acceleration_matrix::<S, true>(w, wr, wd) };
        (links[i].p, links[i].motion, poses[i]) = (p, motion, pose);
        last = pose;
    }
}

/// `Y`, `(n, width)` row-major with `width >= 10 n`; columns beyond the inertial parameters are zero.
#[inline(always)]
pub fn regressor<S: Real>(
    tree: &Tree<S>,
    width: usize,
    poses: &mut [Pose<S>],
    links: &mut [Link<S>],
    trig: &[(S, S)],
    q: &[S],
    v: &[S],
    vr: &[S],
    ar: &[S],
    y: &mut [S],
) {
    y.fill(S::zero());
    regressor_on_zeros(tree, width, poses, links, trig, q, v, vr, ar, y);
}

/// As [`regressor`], where `y` holds zeros or an earlier `Y` of this tree: what vanishes is the same in every state.
#[inline(always)]
pub fn regressor_on_zeros<S: Real>(
    tree: &Tree<S>,
    width: usize,
    poses: &mut [Pose<S>],
    links: &mut [Link<S>],
    trig: &[(S, S)],
    q: &[S],
    v: &[S],
    vr: &[S],
    ar: &[S],
    y: &mut [S],
) {
    fields(tree, poses, links, trig, q, v, vr, ar);
    for i in 0..tree.n() {
        let r = body_axes(&tree.bodies[i], &poses[i]);
        let (u, a) = (r.congruence_transposed(links[i].motion.u), r.apply_transposed(links[i].motion.a));
        let origin = poses[i].origin;
        let mut j = i;
        while j != BASE {
            let z = poses[j].z();
            let row = &mut y[j * width + PARAMETERS * i..][..PARAMETERS];
            if tree.bodies[j].revolute {
                let at_origin = z.cross(origin - poses[j].origin);
                coefficients(u, a, r.apply_transposed(at_origin), r.apply_transposed(z), row);
            } else {
                coefficients(u, a, r.apply_transposed(z), V3::zero(), row);
            }
            j = tree.bodies[j].parent;
        }
    }
}

/// `Y pi` and `Y' s` for any `pi`, in O(n).
#[inline(always)]
pub fn regressor_products<S: Real>(
    tree: &Tree<S>,
    poses: &mut [Pose<S>],
    links: &mut [Link<S>],
    trig: &[(S, S)],
    q: &[S],
    v: &[S],
    vr: &[S],
    ar: &[S],
    pi: &[S],
    s: &[S],
    y_pi: &mut [S],
    yt_s: &mut [S],
) {
    let n = tree.n();
    fields(tree, poses, links, trig, q, v, vr, ar);
    let still = || (V3::zero(), V3::zero());
    let mut last = still();
    for i in 0..n {
        let body = &tree.bodies[i];
        let r = body_axes(body, &poses[i]);
        let (u, a) = (r.congruence_transposed(links[i].motion.u), r.apply_transposed(links[i].motion.a));
        let given = Inertia::from_parameters(&pi[PARAMETERS * i..][..PARAMETERS]);
        let h = given.moment;
        let f = u.apply_add(h, a.scale(given.mass));
        let moment = moment_of(u, &second_moment(&given.inertia), h.cross(a));
        // The motion (v, w) of this body under joint rates s.
        let z = poses[i].z();
        let (sv, sw) = from_parent(body.parent, i, last, |p| (links[p].motion.wr, links[p].motion.w), still);
        let mut sv = sw.cross_add(links[i].p, sv);
        let mut sw = sw;
        if body.revolute {
            sw = z.scale_add(s[i], sw);
        } else {
            sv = z.scale_add(s[i], sv);
        }
        coefficients(u, a, r.apply_transposed(sv), r.apply_transposed(sw), &mut yt_s[PARAMETERS * i..][..PARAMETERS]);
        // Stored where the field is no longer needed.
        let me = &mut links[i];
        (me.motion.w, me.motion.wr, me.f, me.n) = (sw, sv, r.apply(f), r.apply(moment));
        last = (sv, sw);
    }
    for i in (0..n).rev() {
        let body = &tree.bodies[i];
        let Link { p, f, n: moment, .. } = links[i];
        let z = poses[i].z();
        y_pi[i] += if body.revolute { z.dot(moment) } else { z.dot(f) };
        if body.parent != BASE {
            let up = &mut links[body.parent];
            up.f += f;
            up.n = p.cross_add(f, up.n + moment);
        }
    }
}
