//! Position limits of a path: the extrema of every polynomial piece `q_j(x)`, `0 <= x <= 1`, are compared with `q_min` and `q_max`.
//!
//! The roots of a polynomial's derivative divide [0, 1] into parts where the polynomial is monotone. Bisection finds the root in each part,
//! if there is one. This is repeated from the highest derivative down to `q' = dq/dx`. So an extremum of `q` is exact up to rounding.

use super::mover::Mover;
use super::reason::{LimitKind, PathReason, Shortfall};
use super::tuning::POSITION_ROUNDING;
use crate::interrupt;
use crate::motion::{Path, TERMS};

type Polynomial = [f64; TERMS];

fn value(c: &Polynomial, x: f64) -> f64 {
    c.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

fn derivative(c: &Polynomial) -> Polynomial {
    std::array::from_fn(|k| if k + 1 < TERMS { (k + 1) as f64 * c[k + 1] } else { 0.0 })
}

/// Places in [0, 1] that include all extrema of the polynomial `c`.
fn extrema(c: &Polynomial, places: &mut Vec<f64>) {
    let mut order = [*c; TERMS];
    for k in 1..TERMS {
        order[k] = derivative(&order[k - 1]);
    }
    *places = vec![0.0, 1.0];
    for slope in order[1..].iter().rev() {
        let mut roots = vec![0.0];
        for part in places.windows(2) {
            let (mut low, mut high) = (part[0], part[1]);
            let rising = value(slope, high) > value(slope, low);
            if value(slope, low) * value(slope, high) < 0.0 {
                while low < 0.5 * (low + high) && 0.5 * (low + high) < high {
                    let middle = 0.5 * (low + high);
                    if (value(slope, middle) < 0.0) == rising { low = middle } else { high = middle }
                }
                roots.push(low);
            } else if part[1] < 1.0 {
                // Without a change of sign, the part has no root inside. Its end stays in the list, because the polynomial may touch zero there.
                roots.push(part[1]);
            }
        }
        roots.push(1.0);
        *places = roots;
    }
}

/// The place where the path exceeds a position limit most; `None` if it exceeds none.
pub(super) fn largest_violation(mover: Mover, path: &Path, lower: &[f64], upper: &[f64]) -> Option<PathReason> {
    let n = path.dof();
    let (knots, coefficients) = (path.knots(), path.coefficients());
    let (mut places, mut worst): (Vec<f64>, Option<PathReason>) = (Vec::new(), None);
    for (p, piece) in coefficients.chunks_exact(TERMS * n).enumerate() {
        interrupt::check();
        for j in 0..n {
            let c: Polynomial = std::array::from_fn(|k| piece[k * n + j]);
            let reach: f64 = c[1..].iter().map(|c| c.abs()).sum();
            if c[0] + reach <= upper[j] && c[0] - reach >= lower[j] {
                continue;
            }
            extrema(&c, &mut places);
            for &x in &places {
                let q = value(&c, x);
                for (past, limit, bound) in
                    [(q - upper[j], upper[j], LimitKind::PositionMax), (lower[j] - q, lower[j], LimitKind::PositionMin)]
                {
                    let range = upper[j] - lower[j];
                    let size = if range.is_finite() { range } else { limit.abs() };
                    let most = worst.as_ref().map_or(0.0, |worst| worst.missing_units);
                    if past > most && past > POSITION_ROUNDING * size.max(q.abs()) {
                        worst = Some(PathReason {
                            what: Shortfall::Position,
                            joint: Some(j),
                            joint_name: mover.joint_names().get(j).cloned().unwrap_or_default(),
                            s: knots[p] + x * (knots[p + 1] - knots[p]),
                            limit: bound,
                            missing: past / size,
                            missing_units: past,
                            speed: f64::NAN,
                            position: q,
                        });
                    }
                }
            }
        }
    }
    worst
}
