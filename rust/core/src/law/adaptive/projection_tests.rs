use super::*;
use crate::linalg::gain::{AnyGain, Gain};
use crate::trace::function::recorded;
use crate::trace::{Jacobian, Sym};

/// A body with a heavy core and four point masses, and a body that is physically impossible.
const BODY: [f64; 10] = [3.0, 0.3, -0.2, 0.6, 0.9, 0.05, 0.8, -0.1, 0.07, 0.5];
const WRONG: [f64; 10] = [-0.5, 0.1, 0.3, 0.2, 0.1, -0.03, 0.9, 0.04, -0.02, 0.3];

fn projection() -> Projection {
    let least: Vec<f64> = BODY.iter().map(|x| 0.1 * x).chain(BODY.map(|x| 0.05 * x)).collect();
    Projection::new(20, &least).unwrap()
}

fn square(pi: &[f64]) -> f64 {
    let p = projection();
    let part = |(k, pi): (usize, &[f64])| {
        let n = negative_part(&relative(&inverse(&p.factors[k]), &matrix_of(pi, 2.0)));
        n.as_flattened().iter().map(|x| x * x).sum::<f64>()
    };
    pi.chunks_exact(10).enumerate().map(part).sum()
}

#[test]
fn negative_parts_of_matrices() {
    // The test uses zero, negative and indefinite matrices. A matrix minus its negative part is positive, and orthogonal to the negative
    // part.
    let full = [[1.0, 2.0, 0.5, -1.0], [2.0, -1.0, 0.3, 0.2], [0.5, 0.3, 0.1, 4.0], [-1.0, 0.2, 4.0, 1e-3]];
    let zero = [[0.0; 4]; 4];
    let minus = std::array::from_fn(|i| std::array::from_fn(|j| if i == j { -2.0 } else { 0.0 }));
    assert_eq!(negative_part(&zero), zero);
    assert_eq!(negative_part(&minus), minus);
    let n = negative_part(&full);
    let rest: Pseudo<f64> = std::array::from_fn(|i| std::array::from_fn(|j| full[i][j] - n[i][j]));
    let cross = product(&n, &rest);
    // The tolerance is the rounding error of a few products, because the eigenvalues are at most five.
    assert!(cross.as_flattened().iter().all(|x| x.abs() < 1e-13), "{cross:?}");
    assert!(negative_part(&rest).as_flattened().iter().all(|x| x.abs() < 1e-14));
    assert!((least_pivot(&full) > 0.0) == (n == zero) && least_pivot(&product(&full, &transposed(&full))) > 0.0);
}

/// The derivative of the negative part along `d`, from its recording.
fn slope(a: &Pseudo<f64>, d: &Pseudo<f64>) -> Pseudo<f64> {
    let part = |(), a: &[Sym]| negative_part(&std::array::from_fn(|i| std::array::from_fn(|j| a[4 * i + j]))).as_flattened().to_vec();
    let mut rates = [[0.0; 4]; 4];
    Jacobian::new(recorded(16, || (), part).unwrap(), 16).along(a.as_flattened(), d.as_flattened(), rates.as_flattened_mut());
    rates
}

#[test]
fn derivatives_where_eigenvalues_are_equal() {
    let d = [[1.0, 2.0, 0.5, -1.0], [2.0, -1.0, 0.3, 0.2], [0.5, 0.3, 0.1, 4.0], [-1.0, 0.2, 4.0, 1e-3]];
    let diagonal = |x: [f64; 4]| -> Pseudo<f64> { std::array::from_fn(|i| std::array::from_fn(|j| if i == j { x[i] } else { 0.0 })) };
    // All eigenvalues are equal. If they are negative, the derivative is the direction itself. If they are positive, it is zero.
    assert_eq!(slope(&diagonal([-0.5; 4]), &d), d);
    assert_eq!(slope(&diagonal([0.5; 4]), &d), [[0.0; 4]; 4]);
    // Two pairs of eigenvalues, rotated by `V`: the derivative along `D` is `V (F o V' D V) V'`, where `o` multiplies entry by entry. `F`
    // is 1 in the negative pair, 0 in the other pair, and 2/5 between -2 and 3.
    let (c, s) = (0.6, 0.8);
    let v: Pseudo<f64> = [[c, 0.0, s, 0.0], [0.0, c, 0.0, -s], [-s, 0.0, c, 0.0], [0.0, s, 0.0, c]];
    let inside = |a: &Pseudo<f64>| product(&product(&transposed(&v), a), &v);
    let outside = |a: &Pseudo<f64>| product(&product(&v, a), &transposed(&v));
    let mut expected = inside(&d);
    for (i, row) in expected.iter_mut().enumerate() {
        row.iter_mut().enumerate().for_each(|(j, x)| *x *= [1.0, 0.4, 0.0][i / 2 + j / 2]);
    }
    let expected = outside(&expected);
    let found = slope(&outside(&diagonal([-2.0, -2.0, 3.0, 3.0])), &d);
    for (x, y) in found.as_flattened().iter().zip(expected.as_flattened()) {
        // The derivatives of the eigenvectors cancel, up to rounding errors.
        assert!((x - y).abs() < 1e-8, "{found:?} {expected:?}");
    }
}

#[test]
fn the_gradient_is_that_of_half_the_square() {
    let pi: Vec<f64> = WRONG.iter().chain(&BODY.map(|x| -x)).copied().collect();
    let p = projection();
    for k in 0..20 {
        let at = |h: f64| {
            let mut moved = pi.clone();
            moved[k] += h;
            square(&moved)
        };
        let slope = (at(1e-5) - at(-1e-5)) / 4e-5;
        let body = k / 10;
        let i = inverse(&p.factors[body]);
        let n = negative_part(&relative(&i, &matrix_of(&pi[10 * body..][..10], 2.0)));
        let mut g = [0.0; 10];
        gradient_of(&product(&product(&transposed(&i), &n), &i), &mut g);
        // Central differences of a function of size 1e5 have errors of 1e-10 from the step, and of 1e-11 / 1e-5 from rounding.
        assert!((slope - g[k % 10]).abs() < 1e-5 * (1.0 + slope.abs()), "{k} {slope} {}", g[k % 10]);
    }
}

/// The rate of the estimate `pi` for the vector `y = Y' s`, with the projection.
fn corrected_rate(gamma: &Gain, pi: &[f64], y: &[f64]) -> Vec<f64> {
    let gain = AnyGain::new(gamma);
    let mut rate = vec![0.0; 20];
    gain.multiply(y, &mut rate);
    Projector::new(&projection()).correct(&gain, pi, y, &mut rate);
    rate
}

#[test]
fn the_correction_satisfies_the_inequality_of_the_proof() {
    let truth: Vec<f64> = BODY.iter().chain(&BODY).copied().collect();
    let gamma: Vec<f64> = (0..20).map(|k| 0.1 + 0.01 * f64::from(k)).collect();
    for (share, sign) in [(0.9, 1.0), (0.3, 1.0), (0.02, 1.0), (0.02, -1.0), (-1.0, 1.0)] {
        let pi: Vec<f64> = truth.iter().map(|x| share * x).collect();
        // `y` moves the estimate towards the boundary, or away from it.
        let y: Vec<f64> = (0..20).map(|k| -sign * truth[k] * (1.0 + 0.1 * f64::from(k as i32 % 3))).collect();
        let rate = corrected_rate(&Gain::diagonal("gamma", gamma.clone()).unwrap(), &pi, &y);
        let taken: f64 = (0..20).map(|k| (pi[k] - truth[k]) / gamma[k] * (gamma[k] * y[k] - rate[k])).sum();
        let f2 = square(&pi);
        let changed = (0..20).any(|k| rate[k] != gamma[k] * y[k]);
        assert!(taken >= 0.0 && changed == (f2 > 0.0), "{share} {sign}: {taken}");
        // Beyond the layer, the estimate returns at the rate PULL or faster.
        let h = 1e-6;
        let moved: Vec<f64> = (0..20).map(|k| pi[k] + h * rate[k]).collect();
        let slope = (square(&moved) - f2) / h;
        assert!(f2 < LAYER * LAYER || slope <= -1.99 * PULL * f2, "{share} {sign}: {slope} {f2}");
    }
}

#[test]
fn starts_are_moved_inside_and_no_further() {
    let p = projection();
    let mut pi: Vec<f64> = WRONG.iter().chain(&BODY).copied().collect();
    p.start(&mut pi);
    assert_eq!(pi[10..], BODY, "what is inside keeps its bits");
    let z = relative(&inverse(&p.factors[0]), &matrix_of(&pi[..10], 2.0));
    // The estimate is on the boundary, up to rounding errors. The tolerance is larger because entries of `Z` are up to a hundred.
    assert!(negative_part(&z).as_flattened().iter().all(|x| x.abs() < 1e-11));
    assert!(least_pivot(&z).abs() < 1e-9, "{}", least_pivot(&z));
    let mut nothing = vec![0.0; 20];
    p.start(&mut nothing);
    assert!((0..20).all(|k| (nothing[k] - BODY[k % 10] * if k < 10 { 0.1 } else { 0.05 }).abs() < 1e-15), "no estimate: the least bodies");
    let pr = Projection::new(3, &[0.2, 0.0, 0.05]).unwrap();
    let mut three = [0.0, 5.0, 0.0];
    pr.start(&mut three);
    let z = relative(&inverse(&pr.factors[0]), &matrix_of(&three, 2.0));
    assert!(negative_part(&z).as_flattened().iter().all(|x| x.abs() < 1e-12) && (three[1] - 2.5).abs() < 0.1, "{three:?}");
}

#[test]
fn bounds_of_a_mass_require_a_positive_length() {
    for p in [3, 20] {
        assert!(Projection::of_mass(p, 0.1, 0.05).is_ok());
        for (mass, length) in [(0.1, -0.05), (0.1, 0.0), (0.1, f64::NAN), (-0.1, 0.05)] {
            assert!(Projection::of_mass(p, mass, length).is_err(), "{mass} kg, {length} m");
        }
    }
}
