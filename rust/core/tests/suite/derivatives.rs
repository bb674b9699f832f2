//! Derivatives of recorded functions of the small algebra, against formulas and central differences.

use armlet_core::linalg::ClampedInverse;
use armlet_core::scalar::Real;
use armlet_core::scalar::hyperbolic::{decay, tanh};
use armlet_core::spatial::{Matrix, Matrix3, Vector, Vector3, rotation_exp, rotation_log, rotation_rate};
use armlet_core::trace::function::recorded;
use armlet_core::trace::{Jacobian, Sym};

const AXIS: [f64; 3] = [2.0 / 7.0, -3.0 / 7.0, 6.0 / 7.0];
const RATE: [f64; 3] = [0.3, -0.2, 0.5];

/// Record `f`, and return its values at `x` and their rates along `x_dot`.
fn derived(x: &[f64], x_dot: &[f64], f: impl FnOnce(&[Sym]) -> Vec<Sym>) -> (Vec<f64>, Vec<f64>) {
    let f = recorded(x.len(), || (), |(), x| f(x)).expect("it does not branch");
    let rows = f.answer.len();
    let mut f = Jacobian::new(f, rows);
    let mut rates = vec![0.0; rows];
    f.along(x, x_dot, &mut rates);
    (f.value(x).to_vec(), rates)
}

fn three<S: Real>(x: &[S]) -> [S; 3] {
    [x[0], x[1], x[2]]
}

/// The columns of a matrix, one after another.
fn columns<S: Real>(m: &Matrix3<S>) -> Vec<S> {
    (0..3).flat_map(|k| m.axis(k).array()).collect()
}

#[test]
fn hyperbolic_functions() {
    for x in [0.0f64, 1e-9, 0.01, 0.3, 1.0, 3.0, -0.7] {
        let t = derived(&[x], &[1.0], |x| vec![tanh(x[0])]).1[0];
        assert!((t - (1.0 - x.tanh().powi(2))).abs() <= 1e-14, "{x}");
        // `decay` is defined for `x >= 0`. At zero, its derivative is the one-sided one.
        let e = derived(&[x.abs()], &[1.0], |x| vec![decay(x[0])]).1[0];
        assert!((e + (-x.abs()).exp()).abs() <= 1e-14, "{x}");
    }
}

/// `d exp(r) = [J dr]x exp(r)` with the left Jacobian `J = 1 + (1 - cos t)/t^2 [r]x + (t - sin t)/t^3 [r]x^2`.
#[test]
fn exp_turns_at_the_rate_of_the_left_jacobian() {
    for angle in [0.0f64, 1e-9, 9.9e-5, 1.01e-4, 0.1, 1.0, 3.0] {
        let r = Vector3::from(AXIS.map(|a| a * angle));
        let plain = rotation_exp(r.array());
        let (values, rates) = derived(&r.array(), &RATE, |r| columns(&rotation_exp(three(r))));
        let square = angle * angle;
        let (b, c) = if angle < 0.2 {
            (0.5 - square / 24.0 + square * square / 720.0, 1.0 / 6.0 - square / 120.0 + square * square / 5040.0)
        } else {
            ((1.0 - angle.cos()) / square, (angle - angle.sin()) / (square * angle))
        };
        let across = Vector::cross(r, Vector3::from(RATE));
        let spin = Vector3::from(RATE) + Vector::scale(across, b) + Vector::scale(Vector::cross(r, across), c);
        assert_eq!(values, columns(&plain));
        for column in 0..3 {
            let expected = Vector::cross(spin, plain.axis(column));
            for k in 0..3 {
                // At its threshold t = 1e-4, the series has an error below t^4. The closed form divides 1 - cos t, which has the rounding
                // error 1e-16, by t^2. The quotient is multiplied by terms of size t, so that the rate has the error 1e-16 / t.
                let got = rates[3 * column + k];
                assert!((got - expected[k]).abs() < 1e-12, "{angle}: {got} against {}", expected[k]);
            }
        }
    }
}

#[test]
fn log_has_the_rate_of_turning_at_the_identity() {
    // At R = 1, the derivative is R_dot = [rate]x R.
    let identity = rotation_exp([0.0; 3]);
    let moving: Vec<f64> = (0..3).flat_map(|k| Vector::cross(Vector3::from(RATE), identity.axis(k)).array()).collect();
    let (_, rates) = derived(&columns(&identity), &moving, |r| {
        let r = Matrix3::from_columns(&std::array::from_fn::<_, 3, _>(|k| Vector3::from(three(&r[3 * k..]))));
        rotation_log(&r).array().to_vec()
    });
    for (got, expected) in rates.iter().zip(RATE) {
        assert!((got - expected).abs() < 1e-15);
    }
}

/// The velocity is compared with the derivative of `exp`, and the acceleration with the derivative of the velocity, on both sides of the
/// threshold.
#[test]
fn rotation_rates_are_derivatives() {
    let acceleration = [-1.0, 0.4, 0.7];
    for angle in [0.0, 1e-9, 1e-4, 0.1, 0.99999, 1.00001, 2.0, 3.0, 3.2, 6.0] {
        let r = AXIS.map(|a| a * angle);
        let (w, w_dot) = rotation_rate(Vector3::from(r), Vector3::from(RATE), Vector3::from(acceleration));
        let turned = derived(&r, &RATE, |r| columns(&rotation_exp(three(r)))).1;
        let plain = rotation_exp(r);
        for column in 0..3 {
            let expected = Vector::cross(w, plain.axis(column));
            for k in 0..3 {
                // The derivatives of `exp` have an error of at most t^4 below its threshold of 1e-4, and of at most 1e-16 / t^2 above it.
                assert!((turned[3 * column + k] - expected[k]).abs() < 2e-8, "{angle}");
            }
        }
        let (velocity, rate) = derived(&[r, RATE].concat(), &[RATE, acceleration].concat(), |x| {
            let part = |k: usize| Vector3::from(three(&x[3 * k..]));
            rotation_rate(part(0), part(1), Vector3::zero()).0.array().to_vec()
        });
        for k in 0..3 {
            assert!((velocity[k] - w[k]).abs() < 1e-15 && (rate[k] - w_dot[k]).abs() < 1e-14, "{angle}: {rate:?}, {w_dot:?}");
        }
    }
}

/// A positive semidefinite matrix with entries of random size. Some matrices are almost singular.
fn matrix(m: usize, seed: u64) -> Vec<f64> {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    let mut g: Vec<f64> = (0..m * 7).map(|_| next()).collect();
    if seed.is_multiple_of(3) {
        // The first row and the last row are almost equal.
        g.copy_within(..7, 7 * (m - 1));
        g[7 * m - 1] += 1e-6;
    }
    (0..m * m).map(|at| (0..7).map(|k| g[at / m * 7 + k] * g[at % m * 7 + k]).sum()).collect()
}

#[test]
fn the_clamped_inverse_has_the_rate_of_its_function() {
    let rate_of = |m: usize, floor: f64, a: &[f64], rate: &[f64]| {
        derived(a, rate, |a| {
            let mut out = vec![Sym::zero(); m * m];
            ClampedInverse::new(m).compute(a, Sym::splat(floor), &mut out);
            out
        })
        .1
    };
    for m in 2..=6 {
        for seed in 0..30 {
            let (a, rate) = (matrix(m, 5 * seed + 1), matrix(m, 5 * seed + 2));
            let at = |h: f64| {
                let moved: Vec<f64> = a.iter().zip(&rate).map(|(a, r)| a + h * r).collect();
                let mut out = vec![0.0; m * m];
                ClampedInverse::new(m).compute(&moved, 0.05, &mut out);
                out
            };
            let (got, ahead, behind) = (rate_of(m, 0.05, &a, &rate), at(1e-5), at(-1e-5));
            for k in 0..m * m {
                let slope = (ahead[k] - behind[k]) / 2e-5;
                // The error of the difference with step h is below h^2 / c^4 = 2e-5, from the third derivative of 1/x at the floor c.
                assert!((got[k] - slope).abs() < 1e-4 * (1.0 + slope.abs()), "{m} {seed}: {} against {slope}", got[k]);
            }
        }
    }
    // For equal eigenvalues, the rate of 1/A at A = 1 is minus the rate of A.
    for (got, want) in rate_of(2, 1e-4, &[1.0, 0.0, 0.0, 1.0], &[0.3, 0.2, 0.2, -0.1]).iter().zip([-0.3, -0.2, -0.2, 0.1]) {
        assert!((got - want).abs() < 1e-15);
    }
}
