//! The dynamics of an arm with joints that follow others: `q_b = G q + c`, with a constant `G`. `q_b` has the positions of all joints, and
//! `q` those of the joints that follow no other. The prime is the transpose. The dynamics of the bodies, with the subscript `b`, are
//! projected:
//!
//! `M = G' M_b G`, `C = G' C_b G` (again the Christoffel matrix, because `G` is constant), `g = G' g_b`, `Y = G' Y_b`. Forward dynamics
//! uses a Cholesky factor of `M`.

use super::{Workspace, body_derivatives, coriolis, crba, energy, newton_euler, regressor};
use crate::arm::Tree;
use crate::linalg::cholesky;
use crate::memory::set;
use crate::scalar::Real;
use crate::spatial::PARAMETERS;

/// The projection of a result. The projected result is added to the caller's array.
#[derive(Clone, Copy)]
enum Form {
    /// A vector `x` over all joints becomes `G' x`.
    Vector,
    /// A square matrix `X` becomes `G' X G`.
    Square,
    /// A matrix `X` becomes `G' X`. The two numbers are the row lengths of `X` and of the result.
    Rows(usize, usize),
    /// No projection: the result is a number that is the same for all joints and for the coordinates.
    Scalar,
}

/// A tree with joints that follow others.
#[derive(Clone, Copy)]
pub struct Joined<'a, S: Real> {
    tree: &'a Tree<S>,
}

/// A configuration: (sin, cos) and position of each coordinate.
type Place<'a, S> = (&'a [(S, S)], &'a [S]);

impl<'a, S: Real> Joined<'a, S> {
    /// The view of a tree; `None` if no joint follows another.
    #[inline]
    pub fn of(tree: &'a Tree<S>) -> Option<Self> {
        tree.joining.is_some().then_some(Joined { tree })
    }

    /// Compute a result in the coordinates of all joints, project it, and add it to `out`.
    fn project<const K: usize>(
        self,
        ws: &mut Workspace<S>,
        (trig, q): Place<S>,
        rates: [&[S]; K],
        form: Form,
        out: &mut [S],
        compute: impl FnOnce(&mut Workspace<S>, Place<S>, [&[S]; K], &mut [S]),
    ) {
        let (n, bodies) = (self.tree.n(), self.tree.bodies.len());
        // `spread` is moved out of the workspace, because the algorithms write to the workspace.
        let mut spread = std::mem::take(&mut ws.spread);
        for i in 0..bodies {
            (spread.trig[i], spread.q[i]) = self.tree.position(i, trig, q);
            for (to, from) in spread.rates.iter_mut().zip(rates) {
                to[i] = self.tree.rate(i, from);
            }
        }
        let width = match form {
            Form::Vector => 1,
            Form::Square => bodies,
            Form::Rows(width, _) => width,
            Form::Scalar => 0,
        };
        let answer = &mut spread.answer[..bodies * width];
        compute(ws, (&spread.trig, &spread.q), std::array::from_fn(|k| &spread.rates[k][..]), answer);
        for (i, row) in answer.chunks_exact(width.max(1)).enumerate() {
            let (k, multiplier) = self.tree.mover(i);
            let factor = S::splat(multiplier);
            match form {
                Form::Scalar => {}
                Form::Vector => out[k] = factor.mul_add(row[0], out[k]),
                Form::Rows(_, columns) => row.iter().zip(&mut out[k * columns..]).for_each(|(&x, y)| *y = factor.mul_add(x, *y)),
                Form::Square => {
                    for (j, &x) in row.iter().enumerate() {
                        let (l, multiplier) = self.tree.mover(j);
                        out[k * n + l] = (factor * S::splat(multiplier)).mul_add(x, out[k * n + l]);
                    }
                }
            }
        }
        ws.spread = spread;
    }

    pub fn mass_matrix(self, ws: &mut Workspace<S>, at: Place<S>, m: &mut [S]) {
        m.fill(S::zero());
        self.project(ws, at, [], Form::Square, m, |ws, (trig, q), [], m| crba::mass_matrix(self.tree, &mut ws.mass, trig, q, m));
    }

    pub fn coriolis_matrix(self, ws: &mut Workspace<S>, at: Place<S>, v: &[S], c: &mut [S]) {
        c.fill(S::zero());
        self.project(ws, at, [v], Form::Square, c, |ws, (trig, q), [v], c| {
            coriolis::coriolis_matrix(self.tree, ws, trig, q, v, c);
        });
    }

    pub fn gravity(self, ws: &mut Workspace<S>, at: Place<S>, g: &mut [S]) {
        g.fill(S::zero());
        self.project(ws, at, [], Form::Vector, g, |ws, (trig, q), [], g| {
            energy::gravity(self.tree, &mut ws.poses, &mut ws.composites, trig, q, g);
        });
    }

    /// Compute the inverse dynamics. `a = None` means zero acceleration.
    pub fn inverse_dynamics(self, ws: &mut Workspace<S>, at: Place<S>, v: &[S], a: Option<&[S]>, tau: &mut [S]) {
        tau.fill(S::zero());
        self.project(ws, at, [v, a.unwrap_or(v)], Form::Vector, tau, |ws, (trig, q), [v, own], tau| {
            newton_euler::newton_euler(self.tree, &mut ws.links, trig, q, v, a.map(|_| own), tau);
        });
    }

    pub fn forward_dynamics(self, ws: &mut Workspace<S>, at: Place<S>, v: &[S], tau: &[S], a: &mut [S]) {
        let (mut mass, mut factor) = (std::mem::take(&mut ws.spread.mass), std::mem::take(&mut ws.spread.factor));
        self.mass_matrix(ws, at, &mut mass);
        cholesky::factor_into(a.len(), &mass, &mut factor);
        self.inverse_dynamics(ws, at, v, None, a);
        for (a, &tau) in a.iter_mut().zip(tau) {
            *a = tau - *a;
        }
        cholesky::solve(a.len(), &factor, a);
        (ws.spread.mass, ws.spread.factor) = (mass, factor);
    }

    /// Compute the regressor `Y`, in rows of `width` numbers.
    pub fn regressor(self, ws: &mut Workspace<S>, at: Place<S>, rates: [&[S]; 3], width: usize, y: &mut [S]) {
        let columns = PARAMETERS * self.tree.bodies.len();
        y.fill(S::zero());
        self.project(ws, at, rates, Form::Rows(columns, width), y, |ws, (trig, q), rates, y| {
            set(y, S::zero());
            regressor::regressor(self.tree, columns, ws, trig, q, rates, y);
        });
    }

    /// Add `Y pi` to `y_pi`, and write `Y' s` to `yt_s`, for the regressor `Y`. `rates` are `v`, `v_r`, `a_r` and `s`.
    pub fn regressor_products(self, ws: &mut Workspace<S>, at: Place<S>, rates: [&[S]; 4], pi: &[S], y_pi: &mut [S], yt_s: &mut [S]) {
        self.project(ws, at, rates, Form::Vector, y_pi, |ws, (trig, q), [v, v_r, a_r, s], y_pi| {
            y_pi.fill(S::zero());
            regressor::regressor_products(self.tree, &mut ws.links, trig, q, [v, v_r, a_r], (pi, y_pi), (s, yt_s));
        });
    }

    pub fn energy(self, ws: &mut Workspace<S>, at: Place<S>, v: &[S]) -> (S, S) {
        let mut out = (S::zero(), S::zero());
        self.project(ws, at, [v], Form::Scalar, &mut [], |ws, (trig, q), [v], _| {
            out = energy::energy(self.tree, &mut ws.poses, &mut ws.columns, trig, q, v);
        });
        out
    }

    pub fn inverse_dynamics_by_q(self, ws: &mut Workspace<S>, at: Place<S>, v: &[S], a: &[S], d: &mut [S]) {
        d.fill(S::zero());
        self.project(ws, at, [v, a], Form::Square, d, |ws, (trig, q), [v, a], d| {
            body_derivatives::bodies_by_q(self.tree, ws, trig, q, v, a, d);
        });
    }
}
