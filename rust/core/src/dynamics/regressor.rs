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
use crate::scalar::rows::Aside;
use crate::spatial::{Inertia, M3, PARAMETERS, V3};

/// The field `a + U r` of a body in the axes of its parameters, `U = [d]x + sym U`.
struct Field<S> {
    a: V3<S>,
    u: M3<S>,
    d: V3<S>,
    /// Entries xy, xz, yz of `sym U`, then the differences xx - yy, zz - xx, yy - zz of its diagonal.
    off: V3<S>,
    differences: V3<S>,
}

impl<S: Real> Field<S> {
    #[inline(always)]
    fn of(body: &Body<S>, pose: &Pose<S>, motion: &Motion<S>) -> Self {
        let r = body_axes(body, pose);
        let (a, d) = (r.apply_transposed(motion.a), r.apply_transposed(motion.wd));
        let u = acceleration_matrix::<S, true>(r.apply_transposed(motion.w), r.apply_transposed(motion.wr), d);
        let [x, y, z] = u.0;
        let off = V3([x[1] - d[2], x[2] + d[1], y[2] - d[0]]);
        Field { a, u, d, off, differences: V3([x[0] - y[1], z[2] - x[0], y[1] - z[2]]) }
    }

    /// `tau` per unit parameter, SPEC order, under the motion `(v, w)`.
    #[inline(always)]
    fn coefficients(&self, v: V3<S>, w: V3<S>, y: &mut [S]) {
        let Field { a, u, d, off, differences } = self;
        y[0] = v.dot(*a);
        let h = a.cross_add(w, u.apply_transposed(v));
        (y[1], y[2], y[3]) = (h[0], h[1], h[2]);
        // <sym([w]x' U), tr(I)/2 - I>, sorted by the components of w.
        let [ux, uy, uz] = u.0;
        let [xy, xz, yz] = off.0;
        let three = |x: S, y: S, z: S| w[0].mul_add(x, w[1].mul_add(y, w[2] * z));
        y[4] = three(d[0], xz, -xy);
        y[5] = three(-ux[2], uy[2], differences[0]);
        y[6] = three(-yz, d[1], xy);
        y[7] = three(ux[1], differences[1], -uz[1]);
        y[8] = three(differences[2], -uy[0], uz[0]);
        y[9] = three(yz, -xz, d[2]);
    }

    /// The same under the unit turn about the z axis at the origin.
    #[inline(always)]
    fn about_z(&self, y: &mut [S]) {
        let Field { a, u, d, off, differences } = self;
        (y[1], y[2]) = (a[1], -a[0]);
        (y[4], y[5], y[6]) = (-off[0], differences[0], off[0]);
        (y[7], y[8], y[9]) = (-u.0[2][1], u.0[2][0], d[2]);
    }

    /// The same under the motion `v` without a turn.
    #[inline(always)]
    fn along(&self, v: V3<S>, y: &mut [S]) {
        let h = self.u.apply_transposed(v);
        (y[0], y[1], y[2], y[3]) = (v.dot(self.a), h[0], h[1], h[2]);
    }
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
    regressor_on_zeros(tree, width, poses, links, trig, q, v, vr, ar, y, &mut ());
}

/// As [`regressor`], where `y` holds zeros or an earlier `Y` of this tree: what vanishes is the same in every state. There is a step
/// `aside` for every body.
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
    aside: &mut impl Aside,
) {
    fields(tree, poses, links, trig, q, v, vr, ar);
    for i in 0..tree.n() {
        let body = &tree.bodies[i];
        let field = Field::of(body, &poses[i], &links[i].motion);
        let r = body_axes(body, &poses[i]);
        let origin = poses[i].origin;
        let mut j = i;
        while j != BASE {
            let z = poses[j].z();
            let row = &mut y[j * width + PARAMETERS * i..][..PARAMETERS];
            if !tree.bodies[j].revolute {
                field.along(r.apply_transposed(z), row);
            } else if j == i && body.turn.is_none() {
                field.about_z(row);
            } else {
                let at_origin = z.cross(origin - poses[j].origin);
                field.coefficients(r.apply_transposed(at_origin), r.apply_transposed(z), row);
            }
            j = tree.bodies[j].parent;
        }
        aside.step();
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
        let field = Field::of(body, &poses[i], &links[i].motion);
        let given = Inertia::from_parameters(&pi[PARAMETERS * i..][..PARAMETERS]);
        let h = given.moment;
        let f = field.u.apply_add(h, field.a.scale(given.mass));
        let moment = moment_of(field.u, &second_moment(&given.inertia), h.cross(field.a));
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
        field.coefficients(r.apply_transposed(sv), r.apply_transposed(sw), &mut yt_s[PARAMETERS * i..][..PARAMETERS]);
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
