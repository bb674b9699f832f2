//! Analytical derivatives of inverse dynamics in O(n d), with the depth `d` of the tree. The derivatives of forward dynamics take O(n^3)
//! operations.
//!
//! `d tau / d v = 2 C(q, v)` and `d tau / d a = M`. `body_derivatives` computes `d tau / d q`. For forward dynamics, `d a = -M^-1 d tau` and
//! `d a / d tau = M^-1`.

use super::Dynamics;
use super::body_derivatives::bodies_by_q;
use super::joined::Joined;
use super::workspace::Workspace;
use crate::arm::Tree;
use crate::interrupt;
use crate::memory::set;
use crate::scalar::Real;

/// Compute `d tau / d q` at `(q, v, a)`, `(n, n)`, row-major: the entry in row `i` and column `j` is `d tau_i / d q_j`.
pub fn inverse_dynamics_by_q<S: Real>(tree: &Tree<S>, ws: &mut Workspace<S>, trig: &[(S, S)], q: &[S], v: &[S], a: &[S], d: &mut [S]) {
    match Joined::of(tree) {
        Some(joined) => joined.inverse_dynamics_by_q(ws, (trig, q), v, a, d),
        None => bodies_by_q(tree, ws, trig, q, v, a, d),
    }
}

/// Compute `d tau / d v = 2 C(q, v)`, `(n, n)`. With `friction`, the viscous damping is added to the diagonal. The derivative of Coulomb
/// friction counts as zero.
pub fn inverse_dynamics_by_v<S: Real>(
    tree: &Tree<S>,
    ws: &mut Workspace<S>,
    trig: &[(S, S)],
    q: &[S],
    v: &[S],
    friction: bool,
    d: &mut [S],
) {
    tree.coriolis_matrix(ws, trig, q, v, d);
    let n = tree.n();
    for (i, row) in d.chunks_exact_mut(n.max(1)).enumerate() {
        interrupt::check_at_row(i);
        row.iter_mut().for_each(|x| *x = *x + *x);
    }
    if friction {
        for i in 0..n {
            d[i * n + i] += tree.leader(i).damping;
        }
    }
}

/// Compute `x <- factor M^-1 x` in place, for an `(n, n)` matrix `x`. `l` is the Cholesky factor of `M` from [`factor`].
pub(super) fn solve<S: Real>(n: usize, l: &[S], x: &mut [S], factor: S) {
    for c in 0..n {
        for i in 0..n {
            interrupt::check_at_row(i);
            let mut sum = x[i * n + c] * factor;
            for k in 0..i {
                sum = l[i * n + k].neg_mul_add(x[k * n + c], sum);
            }
            x[i * n + c] = sum * l[i * n + i];
        }
        for i in (0..n).rev() {
            interrupt::check_at_row(i);
            let mut sum = x[i * n + c];
            for k in i + 1..n {
                sum = l[k * n + i].neg_mul_add(x[k * n + c], sum);
            }
            x[i * n + c] = sum * l[i * n + i];
        }
    }
}

/// Compute the lower Cholesky factor in place, with an inverted diagonal. If `M` is not positive definite, entries are NaN or infinite.
pub(super) fn factor<S: Real>(n: usize, m: &mut [S]) {
    for j in 0..n {
        for k in 0..j {
            interrupt::check_at_row(k);
            let l = m[j * n + k];
            for i in j..n {
                m[i * n + j] = m[i * n + k].neg_mul_add(l, m[i * n + j]);
            }
        }
        let inverse = m[j * n + j].sqrt().recip();
        m[j * n + j] = inverse;
        for i in j + 1..n {
            m[i * n + j] *= inverse;
        }
    }
}

/// Compute `d a / d q`, `d a / d v` and `d a / d tau = M^-1` of forward dynamics at `(q, v)` and its acceleration `a`, each `(n, n)`,
/// row-major. With `friction`, the damping is part of `d a / d v`. `m` is memory for `(n, n)`.
pub fn forward_dynamics_derivatives<S: Real>(
    tree: &Tree<S>,
    ws: &mut Workspace<S>,
    (trig, q): (&[(S, S)], &[S]),
    (v, a): (&[S], &[S]),
    friction: bool,
    m: &mut [S],
    [by_q, by_v, by_tau]: [&mut [S]; 3],
) {
    let n = tree.n();
    tree.mass_matrix(ws, trig, q, m);
    factor(n, m);
    let minus = S::splat(-1.0);
    inverse_dynamics_by_q(tree, ws, trig, q, v, a, by_q);
    solve(n, m, by_q, minus);
    inverse_dynamics_by_v(tree, ws, trig, q, v, friction, by_v);
    solve(n, m, by_v, minus);
    set(by_tau, S::zero());
    for i in 0..n {
        by_tau[i * n + i] = S::splat(1.0);
    }
    solve(n, m, by_tau, S::splat(1.0));
}
