//! Joint limits as velocity bounds for one sample period `dt`, s (Flacco, De Luca, Khatib 2015, `flacco2015saturation`):
//!
//! `upper = min( (q_max - q)/dt, v_max, sqrt(2 a_max (q_max - q)) )`. The lower bound is the mirror image of this formula, with `q_min`.
//!
//! The last term is the speed from which the joint can still brake before the limit. Beyond a limit, the bound points back, at most with
//! `v_max`.

use crate::error::{Error, Result, positive};
use crate::scalar::Real;

/// Compute the velocity bounds of each joint, rad/s or m/s, and write them to `lower` and `upper`. All slices have shape `(n,)`. `dt` is in
/// s. An infinite `a_max` means no braking distance.
///
/// Errors: `WrongShape` for a wrong length. `Input` for a `dt` that is not positive, a `q` that is not finite, `q_min > q_max`, or a
/// negative `v_max` or `a_max`.
pub fn velocity_bounds(
    q: &[f64],
    (q_min, q_max): (&[f64], &[f64]),
    v_max: &[f64],
    a_max: &[f64],
    dt: f64,
    (lower, upper): (&mut [f64], &mut [f64]),
) -> Result<()> {
    positive("dt", dt)?;
    let n = q.len();
    for (name, x) in
        [("q", q), ("q_min", q_min), ("q_max", q_max), ("v_max", v_max), ("a_max", a_max), ("lower", &*lower), ("upper", &*upper)]
    {
        if x.len() != n {
            return Err(Error::wrong(name, "length", n, x.len()));
        }
    }
    for i in 0..n {
        let ordered = q[i].is_finite() && q_min[i] <= q_max[i] && v_max[i] >= 0.0 && a_max[i] >= 0.0;
        if !ordered {
            let got = format!("q {}, limits [{}, {}], v_max {}, a_max {}", q[i], q_min[i], q_max[i], v_max[i], a_max[i]);
            return Err(
                Error::input("limits", format!("is not ordered: expected q_min <= q_max, v_max >= 0, a_max >= 0, got {got}")).at([i])
            );
        }
        (lower[i], upper[i]) = joint_velocity_bounds(q[i], (q_min[i], q_max[i]), (-v_max[i], v_max[i]), |distance, _| {
            let speed = if distance > 0.0 { (2.0 * a_max[i] * distance).sqrt() } else { f64::INFINITY };
            (distance / dt).min(speed)
        });
    }
    Ok(())
}

/// Return the velocity bounds of one joint, rad/s or m/s, within `(v_min, v_max)`. `q`, `q_min` and `q_max`: rad or m. `allowed_speed` is the
/// largest velocity towards a limit at a distance from it. Its second argument is 1 for the upper limit and -1 for the lower one. Beyond the
/// limit, where the distance is negative, the bound points back.
pub fn joint_velocity_bounds<S: Real>(q: S, (q_min, q_max): (S, S), (v_min, v_max): (S, S), allowed_speed: impl Fn(S, S) -> S) -> (S, S) {
    let (zero, one) = (S::zero(), S::splat(1.0));
    let down = q - q_min;
    let (lower, upper) = ((-allowed_speed(down, -one)).max(v_min).min(v_max), allowed_speed(q_max - q, one).max(v_min).min(v_max));
    // Beyond one limit, the return speed is at most the speed from which the joint can stop before the other limit.
    let return_speed = S::select(down.lt(zero), upper, lower);
    let crossed = upper.lt(lower);
    (S::select(crossed, return_speed, lower), S::select(crossed, return_speed, upper))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_the_limit_the_way_out_is_closed_and_beyond_it_points_back() {
        let inf = f64::INFINITY;
        let (mut lower, mut upper) = ([0.0; 3], [0.0; 3]);
        velocity_bounds(&[1.0, 0.0, 1.5], (&[-1.0; 3], &[1.0; 3]), &[2.0; 3], &[inf, 0.5, inf], 0.01, (&mut lower, &mut upper)).unwrap();
        assert_eq!((lower[0], upper[0]), (-2.0, 0.0));
        // The value sqrt(2 * 0.5 * 1) is exact.
        assert_eq!((lower[1], upper[1]), (-1.0, 1.0));
        assert_eq!((lower[2], upper[2]), (-2.0, -2.0));
        // Far beyond a limit with weak brakes, the return speed allows a stop before the other limit: sqrt(2 * 0.5 * 4).
        velocity_bounds(&[3.0], (&[-1.0], &[1.0]), &[9.0], &[0.5], 0.01, (&mut lower[..1], &mut upper[..1])).unwrap();
        assert_eq!((lower[0], upper[0]), (-2.0, -2.0));
        assert!(velocity_bounds(&[f64::NAN], (&[0.0], &[1.0]), &[1.0], &[1.0], 0.1, (&mut [0.0], &mut [0.0])).is_err());
    }
}
