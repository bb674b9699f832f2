//! Tests of every number type against `f64`: trigonometric functions inside and outside of their range, selections, and fused operations.

use super::dispatch::on;
use super::*;

/// Difficult angles for a reduction: zero, limits of quadrants, large angles, angles beyond the range, and numbers that are not finite.
const ANGLES: [f64; 16] = [
    0.0,
    -0.0,
    1e-300,
    0.5,
    std::f64::consts::FRAC_PI_4,
    std::f64::consts::FRAC_PI_2,
    std::f64::consts::PI,
    -3.0 * std::f64::consts::FRAC_PI_2,
    12_345.678,
    -999_999.0,
    1.0e6,
    1.0e9,
    -3.0e300,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::NAN,
];

fn ulps_apart(a: f64, b: f64) -> f64 {
    if a == b || (a.is_nan() && b.is_nan()) {
        return 0.0;
    }
    (a - b).abs() / (f64::EPSILON * b.abs().max(f64::MIN_POSITIVE))
}

#[derive(Clone, Copy)]
struct SinCos;
impl GenericKernel for SinCos {
    type Output = ();
    fn run<S: Real>(self) {
        for (k, &x) in ANGLES.iter().enumerate() {
            // The other lanes have other angles, because no lane may affect another one.
            let lanes = S::from_lanes(|i| ANGLES[(k + i) % ANGLES.len()]);
            let (s, c) = lanes.sin_cos();
            let alone = S::splat(x).sin_cos();
            for (lane, single, want) in [(s, alone.0, x.sin()), (c, alone.1, x.cos())] {
                // The polynomials have an error of 1 unit in the last place. The last rounding of the reduction adds half a unit.
                assert!(ulps_apart(lane.lane(0), want) <= 1.5, "{x}: {} {want}", lane.lane(0));
                assert_eq!(lane.lane(0).to_bits() & !(1 << 63), single.lane(0).to_bits() & !(1 << 63), "{x}");
            }
        }
        let mut x = -7.3;
        while x < 7.3 {
            let (s, c) = S::splat(x).sin_cos();
            assert!(ulps_apart(s.lane(0), x.sin()) <= 1.5 && ulps_apart(c.lane(0), x.cos()) <= 1.5, "{x}");
            x += 0.000_913;
        }
    }
}

#[derive(Clone, Copy)]
struct Arithmetic;
impl GenericKernel for Arithmetic {
    type Output = ();
    fn run<S: Real>(self) {
        let a = S::from_lanes(|i| 1.5 + i as f64);
        let b = S::from_lanes(|i| -0.75 * i as f64);
        let c = S::splat(0.3);
        for i in 0..S::LANES {
            let (x, y) = (1.5 + i as f64, -0.75 * i as f64);
            assert!((a.mul_add(b, c).lane(i) - (x * y + 0.3)).abs() < 1e-13);
            assert!((a.neg_mul_add(b, c).lane(i) - (0.3 - x * y)).abs() < 1e-13);
            assert!(ulps_apart(a.recip().lane(i), 1.0 / x) <= 1.0);
            assert_eq!(((a / c).lane(i), a.sqrt().lane(i), b.abs().lane(i)), (x / 0.3, x.sqrt(), y.abs()));
            assert_eq!((a.max(c).lane(i), b.min(c).lane(i), (-b).lane(i)), (x.max(0.3), y.min(0.3), -y));
            let chosen = S::select(b.lt(S::splat(-1.0)), a, c);
            assert_eq!(chosen.lane(i), if y < -1.0 { x } else { 0.3 });
        }
        assert!(!S::any(S::splat(f64::NAN).lt(a)) && S::any(c.lt(a)));
        // A single different lane decides the result.
        let last = S::from_lanes(|i| if i + 1 == S::LANES { 2.0 } else { 0.0 });
        assert!(S::any(S::splat(1.0).lt(last)) && S::all(last.lt(S::splat(3.0))));
        assert!(!S::all(last.lt(S::splat(1.0))) && !S::any(last.lt(S::zero())));
    }
}

fn on_every_number<T: GenericKernel + Copy>(task: T) {
    on::<f64, T>(task);
    on::<Array8, T>(task);
    #[cfg(target_arch = "x86_64")]
    {
        on::<lanes::Sse2, T>(task);
        on::<lanes::Pair<lanes::Sse2>, T>(task);
        if Isa::best() >= Isa::Avx2 {
            on::<lanes::Avx2, T>(task);
            on::<lanes::Pair<lanes::Avx2>, T>(task);
        }
        if Isa::best() >= Isa::Avx512 {
            on::<lanes::Avx512, T>(task);
            on::<lanes::Pair<lanes::Avx512>, T>(task);
        }
    }
}

#[test]
fn sine_and_cosine() {
    on_every_number(SinCos);
}

#[derive(Clone, Copy)]
struct Reach;
impl GenericKernel for Reach {
    type Output = ();
    fn run<S: Real>(self) {
        let limit = trig::REDUCTION_LIMIT;
        // Close to a multiple of pi/2, the reduction cancels most digits. It cancels the most for the largest multiples.
        let last = (limit * std::f64::consts::FRAC_2_PI) as u32;
        for k in last - 1000..=last {
            let angle = f64::from(k) * std::f64::consts::FRAC_PI_2;
            for x in [angle.next_down(), angle, angle.next_up(), -angle] {
                let (s, c) = S::splat(x).sin_cos();
                // The tolerance is explained in `SinCos`.
                assert!(ulps_apart(s.lane(0), x.sin()) <= 1.5 && ulps_apart(c.lane(0), x.cos()) <= 1.5, "{x}");
            }
        }
        // From the limit on, the library function is called.
        for x in [limit, limit.next_up(), -limit, 1.0e7, 3.0e12] {
            let (s, c) = S::splat(x).sin_cos();
            assert_eq!((s.lane(0), c.lane(0)), trig::sin_cos_far(x), "{x}");
        }
    }
}

#[test]
fn reach_of_the_reduction() {
    on_every_number(Reach);
}

#[test]
fn arithmetic() {
    on_every_number(Arithmetic);
}
