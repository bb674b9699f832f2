//! The accelerations of one sample after which a joint can still stop within its limits (Del Prete 2018, `delprete2018joint`).
//!
//! The acceleration is held for the sample period `h`. `d` is the distance to a position limit, `v` the velocity towards it, and `w` the
//! velocity at the end of the sample. From `w`, samples with a deceleration of at most `a` stop the joint after the distance
//!
//! `D(w) = a h^2 (k^2/2 + (k + 1/2) (w/(a h) - k))`,  `k = floor(w/(a h))`.
//!
//! This is `w^2/(2 a)` where `w` is a multiple of `a h`, and linear between. The largest `w` uses all of the distance,
//! `(v + w) h/2 + D(w) = d`:
//!
//! `w = r/((k + 1) h) + k a h/2`,  `r = d - v h/2`,  `k = floor((sqrt(1 + 8 r/(a h^2)) - 1)/2)`.
//!
//! If `r < 0`, then `k = 0`. So a joint beyond its limit returns to it in two samples, or with the largest acceleration and speed. A
//! joint that can stop never has empty bounds, because it can brake as in `D`. This holds for every `h`, every `a` and all limits.

use crate::scalar::Real;

/// A number that is added and subtracted to round a number below 2^51 to an integer.
const ROUND: f64 = 6755399441055744.0;

/// The largest `k`, which is exact in rounding.
const MOST_SAMPLES: f64 = 1e15;

/// The largest velocity towards a limit at the end of a sample of length `h`, from which the joint can stop at the limit. `d` and `v` are the
/// distance to the limit and the velocity towards it, and `a_max` is the largest deceleration.
pub fn last_velocity<S: Real>(d: S, v: S, a_max: S, h: S) -> S {
    let (zero, one, half) = (S::zero(), S::splat(1.0), S::splat(0.5));
    let r = d - v * h * half;
    let samples = ((one + S::splat(8.0) * r.max(zero) / (a_max * h * h)).sqrt() - one) * half;
    // Two neighbouring `k` give the same velocity where the rounding decides between them.
    let k = S::as_written(|| (samples - half) + S::splat(ROUND) - S::splat(ROUND)).max(zero).min(S::splat(MOST_SAMPLES));
    // Without a limit of the deceleration, `k` is zero and `a_max` infinite.
    let braked = S::select(zero.lt(k), k * a_max * h * half, zero);
    S::select(d.lt(S::splat(f64::INFINITY)), r / ((k + one) * h) + braked, d)
}

#[cfg(test)]
mod tests {
    use super::last_velocity;

    /// The distance in which samples of deceleration stop a joint from velocity `w`, without a closed form.
    fn stopping_distance(mut w: f64, a: f64, h: f64) -> f64 {
        let mut sum = 0.0;
        while w > 0.0 {
            let next = (w - a * h).max(0.0);
            (sum, w) = (sum + (w + next) * h / 2.0, next);
        }
        sum
    }

    #[test]
    fn the_stop_uses_all_of_the_distance() {
        for (d, v, a, h) in
            [(1.0, 0.0, 4.0, 0.01), (0.3, 0.2, 4.0, 0.05), (1e-3, 0.02, 10.0, 0.02), (0.5, -2.0, 3.0, 0.1), (2.0, 1.0, 0.7, 0.3)]
        {
            let w: f64 = last_velocity(d, v, a, h);
            assert!(w > 0.0 && ((v + w) * h / 2.0 + stopping_distance(w, a, h) - d).abs() < 1e-12, "{d} {v} {a} {h}");
        }
        // Beyond the limit, at the limit, without a limit, and without a limit of the deceleration.
        assert_eq!(last_velocity(-0.2, 0.0, 4.0, 0.1), -2.0);
        assert_eq!(last_velocity(0.0, 0.0, 4.0, 0.1), 0.0);
        assert_eq!(last_velocity(f64::INFINITY, 3.0, 4.0, 0.1), f64::INFINITY);
        assert!((last_velocity(0.5, 1.0, f64::INFINITY, 0.1) - 4.5).abs() < 1e-14);
    }
}
