//! Tests of chattering, which must end a run within its budget. Steep smooth slopes, rounding errors and single jumps must not end a run.

use crate::integrate_support::*;
use armlet_core::scalar::{Real, sign};
use armlet_core::status::Status;

const BUDGET: u64 = 2_000;

/// Two states that slide along `x_0 = 0` and `x_1 = 0.3`.
struct Switch;
impl Problem for Switch {
    const N: usize = 2;
    fn f<S: Real>(_: S, x: &[S], dx: &mut [S]) {
        dx[0] = -sign(x[0]);
        dx[1] = S::splat(-2.0) * sign(x[1] - S::splat(0.3));
    }
    fn start() -> Vec<f64> {
        vec![1.0, 1.0]
    }
    fn chatter_budget() -> u64 {
        BUDGET
    }
}

/// A smooth sign function with a layer of width 1e-5, in which an explicit method needs tiny steps.
struct Steep;
impl Problem for Steep {
    const N: usize = 1;
    fn f<S: Real>(_: S, x: &[S], dx: &mut [S]) {
        dx[0] = -(x[0] * x[0].mul_add(x[0], S::splat(1e-10)).sqrt().recip());
    }
    fn start() -> Vec<f64> {
        vec![0.1]
    }
    fn chatter_budget() -> u64 {
        BUDGET
    }
}

/// The solution is `x = cos t`. The stiffness is so high that the rounding error of `x` changes the slope by 2e-4.
struct Noisy;
impl Problem for Noisy {
    const N: usize = 1;
    fn f<S: Real>(t: S, x: &[S], dx: &mut [S]) {
        let (s, c) = t.sin_cos();
        dx[0] = -s - S::splat(1e12) * (x[0] - c);
    }
    fn start() -> Vec<f64> {
        vec![1.0]
    }
    fn chatter_budget() -> u64 {
        BUDGET
    }
}

/// A triangular wave. The slope jumps 63 times, and the solution continues after each jump.
struct Wave;
impl Problem for Wave {
    const N: usize = 2;
    fn f<S: Real>(_: S, x: &[S], dx: &mut [S]) {
        dx[0] = S::splat(1.0);
        dx[1] = sign((S::splat(100.0) * x[0]).sin_cos().0);
    }
    fn start() -> Vec<f64> {
        vec![0.001, 0.0]
    }
    fn chatter_budget() -> u64 {
        BUDGET
    }
}

#[test]
fn a_slide_along_a_jump_ends_within_the_budget() {
    for (name, _) in ADAPTIVE {
        for (rtol, atol) in [(1e-8, 1e-10), (1e-3, 1e-6)] {
            let mut method = adaptive::<Switch>(name, rtol, atol);
            let status = run(&mut method, 0.0, 10.0);
            assert!(matches!(status, Err(Status::Stalled | Status::StepUnderflow)), "{name} {rtol}: {status:?}");
            // Before the jump, the run takes fewer than a thousand attempts.
            let work = method.work();
            assert!(work.steps + work.rejections < BUDGET + 1_000, "{name} {rtol}: {work:?}");
        }
    }
}

#[test]
fn a_slide_without_an_end_stalls_too() {
    for (name, _) in ADAPTIVE {
        let mut method = adaptive::<Switch>(name, 1e-4, 1e-6);
        assert!(matches!(run(&mut method, 0.0, f64::INFINITY), Err(Status::Stalled | Status::StepUnderflow)), "{name}");
    }
}

#[test]
fn a_steep_slope_is_no_jump() {
    let mut method = adaptive::<Steep>("dopri5", 1e-6, 1e-8);
    assert_eq!(run(&mut method, 0.0, 1.0), Ok(()));
    assert!(method.work().steps > 10 * BUDGET, "{:?}", method.work());
}

#[test]
fn rounding_errors_are_no_jump() {
    for name in ["radau5", "rodas4"] {
        let mut method = adaptive::<Noisy>(name, 1e-4, 1e-6);
        method.limit_step(1e-4);
        assert_eq!(run(&mut method, 0.0, 1.0), Ok(()), "{name}");
        assert!(method.work().steps > 4 * BUDGET, "{name} {:?}", method.work());
    }
}

#[test]
fn jumps_that_are_passed_cost_steps_alone() {
    for (name, _) in ADAPTIVE {
        let mut method = adaptive::<Wave>(name, 1e-8, 1e-10);
        let status = run(&mut method, 0.0, 2.0);
        assert_eq!(status, Ok(()), "{name} {:?}", method.work());
        assert!(method.work().rejections > BUDGET / 4, "{name} {:?}", method.work());
    }
}
