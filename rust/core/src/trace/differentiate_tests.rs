//! Tests of derivatives of recordings against the rule of each operation on numbers: single operations, corners, and random recordings.

use super::adjoint::adjoint;
use super::differentiate::Differentiation;
use super::sym::{self, Sym};
use super::tangents::{Tangents, tangents};
use super::tape::{Op, Tape};
use super::tests::Random;
use crate::scalar::Real;

/// Return the values of all entries.
fn values(ops: &[Op], inputs: &[f64]) -> Vec<f64> {
    let mut all: Vec<f64> = Vec::new();
    for &op in ops {
        let at = |a: u32| all[a as usize];
        let value = match op {
            Op::Const(bits) => f64::from_bits(bits),
            Op::Input(k) => inputs[k as usize],
            Op::Add(a, b) => at(a) + at(b),
            Op::Sub(a, b) => at(a) - at(b),
            Op::Mul(a, b) => at(a) * at(b),
            Op::Div(a, b) => at(a) / at(b),
            Op::Neg(a) => -at(a),
            Op::Fma(a, b, c) => Real::mul_add(at(a), at(b), at(c)),
            Op::Fnma(a, b, c) => at(a).neg_mul_add(at(b), at(c)),
            Op::Sqrt(a) => at(a).sqrt(),
            Op::Abs(a) => at(a).abs(),
            Op::Max(a, b) => Real::max(at(a), at(b)),
            Op::Min(a, b) => Real::min(at(a), at(b)),
            Op::Sin(a) => Real::sin_cos(at(a)).0,
            Op::Cos(a) => Real::sin_cos(at(a)).1,
            Op::Less(a, b) => f64::from(u8::from(at(a) < at(b))),
            Op::Select(mask, yes, no) => {
                if at(mask) > 0.0 {
                    at(yes)
                } else {
                    at(no)
                }
            }
            Op::Decided(_, given, _) => at(given),
            Op::Argument(..) | Op::Decide(..) => 0.0,
        };
        all.push(value);
    }
    all
}

/// Return the rates of all entries at `x` along `x_dot`, by the rule of each operation on numbers.
fn rates(ops: &[Op], x: &[f64], x_dot: &[f64]) -> Vec<f64> {
    let values = values(ops, x);
    let mut all: Vec<f64> = Vec::new();
    for (&op, &value) in ops.iter().zip(&values) {
        let (at, rate) = (|a: u32| values[a as usize], |a: u32| all[a as usize]);
        let product = |a: u32, b: u32| rate(a) * at(b) + at(a) * rate(b);
        let new = match op {
            Op::Const(_) | Op::Less(..) | Op::Argument(..) | Op::Decide(..) => 0.0,
            Op::Input(k) => x_dot[k as usize],
            Op::Add(a, b) => rate(a) + rate(b),
            Op::Sub(a, b) => rate(a) - rate(b),
            Op::Mul(a, b) => product(a, b),
            Op::Div(a, b) => (rate(a) - value * rate(b)) / at(b),
            Op::Neg(a) => -rate(a),
            Op::Fma(a, b, c) => product(a, b) + rate(c),
            Op::Fnma(a, b, c) => rate(c) - product(a, b),
            Op::Sqrt(a) if rate(a) == 0.0 => 0.0,
            Op::Sqrt(a) => 0.5 / value * rate(a),
            Op::Abs(a) => {
                if at(a) < 0.0 {
                    -rate(a)
                } else {
                    rate(a)
                }
            }
            Op::Max(a, b) => {
                if at(a) < at(b) {
                    rate(b)
                } else {
                    rate(a)
                }
            }
            Op::Min(a, b) => {
                if at(b) < at(a) {
                    rate(b)
                } else {
                    rate(a)
                }
            }
            Op::Sin(a) => at(a).cos() * rate(a),
            Op::Cos(a) => -at(a).sin() * rate(a),
            Op::Select(mask, yes, no) => {
                if at(mask) > 0.0 {
                    rate(yes)
                } else {
                    rate(no)
                }
            }
            Op::Decided(_, given, _) => rate(given),
        };
        all.push(new);
    }
    all
}

/// Return derivatives of `outputs` at `x` along `x_dot`, from the differentiated recording and from [`rates`].
fn both(ops: &[Op], outputs: &[u32], x: &[f64], x_dot: &[f64]) -> Vec<(f64, f64)> {
    let mut differentiation = Differentiation::new(ops.to_vec(), x.len());
    let entries = differentiation.along(&(0..x.len() as u32).collect::<Vec<_>>(), outputs);
    let got = values(&differentiation.finish(), &[x, x_dot].concat());
    let expected = rates(ops, x, x_dot);
    outputs.iter().zip(entries).map(|(&y, rate)| (got[rate as usize], expected[y as usize])).collect()
}

/// Return two derivatives of a function of two numbers, at `x` along `x_dot`: from the differentiated recording and from [`rates`].
fn pair(f: impl Fn(Sym, Sym) -> Sym, x: [f64; 2], x_dot: [f64; 2]) -> (f64, f64) {
    sym::begin();
    sym::end_set_up();
    let y = f(sym::input(), sym::input());
    both(&sym::finish().ops, &[y.index()], &x, &x_dot)[0]
}

#[test]
fn every_operation_has_its_derivative() {
    let (a, b) = (0.7f64, -1.3f64);
    let (da, db) = (0.9f64, 0.4f64);
    type Operation = fn(Sym, Sym) -> Sym;
    let cases: [(Operation, f64); 16] = [
        (|a, b| a + b, da + db),
        (|a, b| a - b, da - db),
        (|a, b| a * b, da * b + a * db),
        (|a, _| a * a, 2.0 * a * da),
        (|a, b| a / b, (da * b - a * db) / (b * b)),
        (|a, _| a.recip(), -da / (a * a)),
        (|_, b| -b, -db),
        (|a, b| a.mul_add(b, b), da * b + a * db + db),
        (|a, b| a.neg_mul_add(b, a), da - da * b - a * db),
        (|a, _| a.sqrt(), 0.5 * da / a.sqrt()),
        (|_, b| b.abs(), -db),
        (|a, b| a.max(b), da),
        (|a, b| a.min(b), db),
        (|a, _| a.sin_cos().0, a.cos() * da),
        (|_, b| b.sin_cos().1, -b.sin() * db),
        (|a, b| Sym::select(a.lt(b), a, b), db),
    ];
    for (k, (operation, expected)) in cases.into_iter().enumerate() {
        let (got, by_rule) = pair(operation, [a, b], [da, db]);
        // The tolerance covers a few roundings of numbers below 2.
        assert!((got - expected).abs() < 4e-16 * (1.0 + expected.abs()), "{k}: {got} {expected}");
        assert!((by_rule - expected).abs() < 4e-16 * (1.0 + expected.abs()), "{k}: {by_rule} {expected}");
    }
}

#[test]
fn corners_have_the_derivative_of_the_selected_branch() {
    let same = |f: fn(Sym, Sym) -> Sym, x: [f64; 2], x_dot: [f64; 2]| {
        let (got, expected) = pair(f, x, x_dot);
        assert!(got == expected || got.is_nan() && expected.is_nan(), "{x:?} {x_dot:?}: {got} {expected}");
        got
    };
    assert_eq!(same(|a, _| a.sqrt(), [0.0, 0.0], [0.0, 1.0]), 0.0, "the root of zero does not move along nothing");
    assert_eq!(same(|a, _| a.sqrt(), [0.0, 0.0], [1.0, 0.0]), f64::INFINITY);
    assert_eq!(same(|a, _| a.abs(), [0.0, 0.0], [1.0, 0.0]), 1.0);
    // If both arguments are equal, `max` has the derivative of its first argument.
    assert_eq!(same(|a, b| a.max(b), [1.0, 1.0], [2.0, 3.0]), 2.0);
    assert_eq!(same(|a, b| a.min(b), [1.0, 1.0], [2.0, 3.0]), 2.0);
    assert_eq!(same(|a, b| Sym::select(a.lt(b), a, b), [1.0, 1.0], [2.0, 3.0]), 3.0);
}

/// Return a random recording with three inputs. Its values have moderate magnitudes.
fn random(random: &mut Random) -> (Vec<Op>, Vec<u32>) {
    let mut tape = Tape::new();
    tape.set_up = false;
    let mut known: Vec<u32> = (0..3).map(|_| tape.new_input()).collect();
    known.push(tape.constant(0.75));
    for _ in 0..40 {
        let mut any = || known[known.len() - 1 - random.below(known.len().min(12))];
        let (a, b, c) = (any(), any(), any());
        let new = match random.below(12) {
            0 => tape.add(a, b),
            1 => tape.sub(a, b),
            2 => tape.mul(a, b),
            3 => tape.fma(a, b, c),
            4 => tape.fnma(a, b, c),
            5 => {
                let (square, one) = (tape.mul(b, b), tape.constant(1.0));
                let below = tape.add(square, one);
                tape.div(a, below)
            }
            6 => {
                let size = tape.unary(a, f64::abs, Op::Abs);
                tape.unary(size, f64::sqrt, Op::Sqrt)
            }
            7 => tape.extreme(a, b, f64::max, Op::Max),
            8 => tape.extreme(a, b, f64::min, Op::Min),
            9 => {
                let mask = tape.less(a, b);
                tape.select(mask, c, a)
            }
            10 => tape.neg(a),
            _ => tape.unary(a, f64::sin, Op::Sin),
        };
        let two = tape.constant(2.0);
        let turned = tape.mul(two, new);
        known.push(tape.unary(turned, f64::sin, Op::Sin));
        known.push(tape.unary(turned, f64::cos, Op::Cos));
    }
    let outputs = known.split_off(known.len() - 6);
    (tape.ops, outputs)
}

#[test]
fn derivatives_of_random_recordings_are_those_of_the_rules() {
    let mut numbers = Random(5);
    let mut most = 0.0f64;
    for trial in 0..300 {
        let (ops, outputs) = random(&mut numbers);
        let mut three = || (0..3).map(|_| numbers.number()).collect::<Vec<f64>>();
        let (x, x_dot) = (three(), three());
        for (k, (got, expected)) in both(&ops, &outputs, &x, &x_dot).into_iter().enumerate() {
            most = most.max(expected.abs());
            // The tolerance covers the rounding of some hundred operations on numbers that may cancel.
            assert!((got - expected).abs() <= 1e-11 * (1.0 + expected.abs()), "{trial} {k}: {got} {}", expected);
        }
    }
    assert!(most > 1.0, "the outputs move: {most}");
}

#[test]
fn tangents_along_several_directions_are_those_along_each_alone() {
    let (mut numbers, mut most) = (Random(7), 0.0f64);
    for trial in 0..100 {
        let (ops, outputs) = random(&mut numbers);
        let mut some = |count: usize| (0..count).map(|_| numbers.number()).collect::<Vec<f64>>();
        let x = some(3);
        // The directions have rates of inputs 2 and 0. The rate of input 1 is zero.
        let given = some(6);
        let Tangents { ops: all, values: entries, rates } = tangents(&ops, 3, &outputs, 4, &[2, 0], 3);
        let got = values(&all, &[x.clone(), given.clone()].concat());
        for (&entry, &output) in entries.iter().zip(&outputs) {
            assert_eq!(got[entry as usize], values(&ops, &x)[output as usize]);
        }
        for (rates, along) in rates.chunks_exact(4).zip(given.chunks_exact(2)) {
            for (&rate, (_, expected)) in rates.iter().zip(both(&ops, &outputs, &x, &[along[1], 0.0, along[0]])) {
                most = most.max(expected.abs());
                // The tolerance covers the rounding of some hundred operations on numbers that may cancel.
                assert!((got[rate as usize] - expected).abs() <= 1e-11 * (1.0 + expected.abs()), "{trial}");
            }
        }
    }
    assert!(most > 1.0, "the outputs move: {most}");
}

#[test]
fn what_does_not_move_costs_nothing() {
    sym::begin();
    sym::end_set_up();
    let (a, b) = (sym::input(), sym::input());
    let still = (a * a + Sym::splat(2.0)).sqrt().sin_cos().0;
    let y = still.mul_add(b, a);
    let ops = sym::finish().ops;
    let mut differentiation = Differentiation::new(ops.clone(), 2);
    let rates = differentiation.along(&[1], &[y.index(), still.index()]);
    assert_eq!(rates[1], 0);
    // The tape gains only the rate of b and one product.
    assert_eq!(differentiation.length() as usize, ops.len() + 2);
}

/// Return the derivative of `outputs` at `x` along `x_dot`, weighted by `y_bar`: first from the adjoint, then from forward differentiation.
fn weighed(ops: &[Op], outputs: &[u32], (x, x_dot, y_bar): (&[f64], &[f64], &[f64])) -> (f64, f64) {
    let moving: Vec<u32> = (0..x.len() as u32).collect();
    let (all, bars) = adjoint(ops.to_vec(), x.len(), outputs, &moving);
    let got = values(&all, &[x, y_bar].concat());
    let forward: f64 = both(ops, outputs, x, x_dot).iter().zip(y_bar).map(|((rate, _), weight)| rate * weight).sum();
    (bars.iter().zip(x_dot).map(|(&bar, rate)| got[bar as usize] * rate).sum(), forward)
}

#[test]
fn the_adjoint_of_random_recordings_is_that_of_their_derivatives() {
    let mut numbers = Random(11);
    let mut most = 0.0f64;
    for trial in 0..300 {
        let (ops, outputs) = random(&mut numbers);
        let mut some = |count: usize| (0..count).map(|_| numbers.number()).collect::<Vec<f64>>();
        let (x, x_dot, y_bar) = (some(3), some(3), some(outputs.len()));
        let (got, expected) = weighed(&ops, &outputs, (&x, &x_dot, &y_bar));
        most = most.max(expected.abs());
        // The tolerance covers the rounding of some hundred operations on numbers that may cancel.
        assert!((got - expected).abs() <= 1e-11 * (1.0 + expected.abs()), "{trial}: {got} {expected}");
    }
    assert!(most > 1.0, "the outputs move: {most}");
}

#[test]
fn the_branch_that_is_not_taken_has_no_part_in_the_adjoint() {
    // If a < 1, the function is a b. Otherwise it contains a division by a - 1/2, a square root and products.
    sym::begin();
    sym::end_set_up();
    let (a, b) = (sym::input(), sym::input());
    let far = (b / (a - Sym::splat(0.5))).mul_add(b, (a - Sym::splat(0.5)).sqrt() / b) * a;
    let y = Sym::select(a.lt(Sym::splat(1.0)), a * b, far);
    let ops = sym::finish().ops;
    for a in [0.25, 0.5, 1.5] {
        let (got, expected) = weighed(&ops, &[y.index()], (&[a, 2.0], &[0.3, 0.7], &[1.0]));
        assert!((got - expected).abs() < 1e-14, "{a}: {got} {expected}");
    }
}

#[test]
fn a_derivative_continues_the_recording() {
    sym::begin();
    sym::end_set_up();
    let [x, y, along] = [sym::input(), sym::input(), sym::input()];
    let sine = (x * y).sin_cos().0;
    let rates = sym::derivative(&[sine * x, y], &[x], &[along]);
    let later = rates[0] * y;
    let ops = sym::finish().ops;
    let (x, y, along) = (0.7f64, 1.3, 0.4);
    let expected = (y * (x * y).cos() * x + (x * y).sin()) * along;
    let found = values(&ops, &[x, y, along]);
    assert!((found[rates[0].index() as usize] - expected).abs() < 1e-14 && rates[1].index() == 0);
    assert!((found[later.index() as usize] - expected * y).abs() < 1e-14);
}
