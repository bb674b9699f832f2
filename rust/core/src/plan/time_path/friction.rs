//! Viscous friction `d q' r` in the rows, which are linear in `x = r^2`. A line in `x` replaces the root `r`:
//!
//! ```text
//! chord:     r = sqrt(x)  ~  x / sqrt(x0)                         exact at 0 and x0
//! tangent:   r = sqrt(x)  ~  sqrt(x0)/2 + x / (2 sqrt(x0))        exact at x0, with its slope
//! ```
//!
//! `d` is the viscous coefficient of a joint, `q' = dq/ds`, `r = ds/dt`, and `x0` is the value of `x` in an earlier profile.

use super::lines::LimitRows;
use super::passes::Infeasible;
use super::problem::PathProblem;
use super::search::Search;
use super::tuning::{CHORD_PASSES, CHORD_SHORTENING, FRICTION_CONVERGED, TANGENT_PASSES, TANGENTS_FROM};

/// The line in `x` that replaces `sqrt(x)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Line {
    Chord,
    Tangent,
}

impl PathProblem<'_> {
    /// Remove viscous friction from the rows of the limits, `A u + B x + g`.
    pub fn remove_friction(&mut self) {
        if self.friction.is_none() {
            return;
        }
        self.rows.moving.iter_mut().for_each(Vec::clear);
        let (n, w) = (self.n, self.rows.width);
        for i in 0..self.rows.s.len() {
            for j in 0..n {
                let c = &mut self.rows.coefficients[i * 3 * w..];
                (c[w + j], c[2 * w + j]) = (self.bare[2 * i * n + j], self.bare[(2 * i + 1) * n + j]);
            }
        }
        self.set_middles();
    }

    /// Add viscous friction `d dq/ds sqrt(x)` to the torque rows. A line in `x` replaces the root.
    ///
    /// `x`: the squared path speeds at the grid points, `(N + 1,)`, at which the line is exact. With `Line::Chord`, low speeds remain
    /// feasible. The error of `Line::Tangent` is of second order in the change of `x`.
    fn linearise_friction(&mut self, x: &[f64], line: Line) {
        if self.friction.is_none() {
            return;
        }
        self.remove_friction();
        let Some(friction) = &self.friction else { return };
        let (n, w, last) = (self.n, self.rows.width, x.len() - 1);
        let (slope, constant) = match line {
            Line::Chord => (1.0, 0.0),
            Line::Tangent => (0.5, 0.5),
        };
        let (varying, path, pieces, points) = (&self.along, &self.path, &self.pieces, self.rows.s.clone());
        let limit = |i: usize, j: usize| varying.limit(path, 0, j, pieces[i.min(pieces.len() - 1)], points[i]);
        let LimitRows { coefficients, middles, moving, s, u_slope, .. } = &mut self.rows;
        moving[0].resize((last + 1) * w, 0.0);
        moving[1].resize(last * w, 0.0);
        for k in 0..=2 * last {
            // An even `k` is a grid point, an odd `k` the midpoint between two of them. At rest there is no viscous friction.
            let (i, between) = (k / 2, k % 2 == 1);
            let here = if between { 0.5 * (x[i] + x[i + 1]) - 0.25 * (s[i + 1] - s[i]).powi(2) * u_slope[i] } else { x[i] };
            if !(here > 0.0) {
                continue;
            }
            let root = here.sqrt();
            let c = if between { &mut middles[i * 3 * w..] } else { &mut coefficients[i * 3 * w..] };
            let part = &mut moving[usize::from(between)][i * w..];
            for j in 0..n {
                let along = |i: usize| self.slopes[i * self.stride + j] / limit(i, j);
                let push = friction.viscous[j] * if between { 0.5 * (along(i) + along(i + 1)) } else { along(i) };
                c[w + j] += slope * push / root;
                part[j] = constant * push * root;
            }
        }
    }
}

/// The largest relative change of an entry from `old` to `new`.
fn change(new: &[f64], old: &[f64]) -> f64 {
    new.iter().zip(old).map(|(new, old)| (new - old).abs() / new.max(*old).max(f64::MIN_POSITIVE)).fold(0.0, f64::max)
}

impl Search<'_> {
    /// Compute the profile with viscous friction. Chords come first, because low speeds remain feasible under a chord. When the profile
    /// changes little, or after `CHORD_PASSES` passes, tangents follow. The error of a tangent is proportional to the square of the change.
    pub fn iterate_friction(&mut self) -> Result<(), Infeasible> {
        if self.problem.friction.is_none() {
            return Ok(());
        }
        let mut x = self.profile.x.clone();
        for _ in 0..CHORD_PASSES {
            if self.passes_with_friction(&x, Line::Chord).is_err() {
                // No profile is feasible with this chord. Try a chord at smaller `x`.
                x.iter_mut().for_each(|x| *x *= CHORD_SHORTENING);
                continue;
            }
            let change = change(&self.profile.x, &x);
            x.copy_from_slice(&self.profile.x);
            if change < TANGENTS_FROM {
                break;
            }
        }
        self.profile.x.copy_from_slice(&x);
        self.iterate_tangents()
    }

    /// Compute the profile with tangents of viscous friction. Repeat until the profile converges, at most `TANGENT_PASSES` times. The
    /// repetition is necessary, because the check of the limits counts the error of a tangent as an excess.
    pub fn iterate_tangents(&mut self) -> Result<(), Infeasible> {
        for _ in 0..TANGENT_PASSES {
            let x = self.profile.x.clone();
            if self.passes_with_friction(&x, Line::Tangent).is_err() {
                // With this tangent no speed is feasible. Return to the chord.
                return self.passes_with_friction(&x, Line::Chord);
            }
            if change(&self.profile.x, &x) < FRICTION_CONVERGED {
                break;
            }
        }
        Ok(())
    }

    /// Repeat the passes with viscous friction replaced by lines that are exact at `x`.
    fn passes_with_friction(&mut self, x: &[f64], line: Line) -> Result<(), Infeasible> {
        self.problem.linearise_friction(x, line);
        self.profile.recompute_all = true;
        self.passes()
    }
}
