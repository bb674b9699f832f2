//! Tests of every integration method on the same problems: order, dense output, ends, Jacobians.

use crate::integrate_support::*;
use armlet_core::integrate::*;
use armlet_core::status::Status;

/// Return the observed order: the binary logarithm of the ratio of errors for the steps `h` and `h / 2`.
fn order(error: impl Fn(f64) -> f64, h: f64) -> f64 {
    (error(h) / error(h / 2.0)).log2()
}

fn fixed_error<P: Exact>(name: &str, t_end: f64, h: f64) -> f64 {
    let (mut system, mut method, mut x) = (twin::<P>(), fixed::<P>(name), P::start());
    let steps = (t_end / h).round() as usize;
    for k in 0..steps {
        let t = k as f64 * h;
        method.step(&mut system, t, h, t + h, &mut x);
    }
    distance(&x, &P::exact(t_end))
}

/// Return the largest error at the ends of steps of size `h`, and the largest error of the dense output.
fn adaptive_errors<P: Exact + 'static>(name: &str, t_end: f64, h: f64) -> (f64, f64) {
    let mut method = adaptive::<P>(name, 1e6, 1e6);
    let mut system = twin::<P>();
    method.limit_step(h);
    method.first_step(h);
    method.begin(&mut system, 0.0, t_end, t_end).unwrap();
    let (mut ends, mut dense, mut out) = (0.0f64, 0.0f64, P::start());
    loop {
        let done = method.step(&mut system).unwrap();
        ends = ends.max(distance(method.x(), &P::exact(method.t())));
        for k in 0..8 {
            let t = method.t_old() + (method.t() - method.t_old()) * k as f64 / 8.0;
            method.interpolate(&mut system, t, &mut out);
            dense = dense.max(distance(&out, &P::exact(t)));
        }
        if done {
            break;
        }
    }
    assert_eq!(method.work().steps, (t_end / h).round() as u64, "{name}");
    (ends, dense)
}

// At these step sizes, the leading term of the error is much larger than the next term and than rounding. The tolerance 0.1 is a
// requirement of the project.
#[test]
fn methods_have_their_order() {
    for (name, expected, h) in
        [("euler", 1.0, 1.0 / 1024.0), ("semi_implicit", 1.0, 1.0 / 1024.0), ("rk4", 4.0, 1.0 / 64.0), ("ros2", 2.0, 1.0 / 512.0)]
    {
        if name != "semi_implicit" {
            let found = [order(|h| fixed_error::<Circle>(name, 2.0, h), h), order(|h| fixed_error::<Riccati>(name, 2.0, h), h)];
            assert!(found.iter().all(|p| (p - expected).abs() < 0.1), "{name}: {found:?}");
        }
        let found = order(|h| fixed_error::<Oscillator>(name, 2.0, h), h);
        assert!((found - expected).abs() < 0.1, "{name}: {found}");
    }
    for (name, expected, h) in
        [("dopri5", 5.0, 1.0 / 32.0), ("dop853", 8.0, 0.25), ("radau5", 5.0, 1.0 / 16.0), ("rodas4", 4.0, 1.0 / 64.0)]
    {
        let found = [order(|h| adaptive_errors::<Circle>(name, 2.0, h).0, h), order(|h| adaptive_errors::<Riccati>(name, 2.0, h).0, h)];
        assert!(found.iter().all(|p| (p - expected).abs() < 0.1), "{name}: {found:?}");
    }
}

/// A polynomial of degree d has a local error of order d + 1. So the largest error decreases with h^(d + 1), if the method is accurate
/// enough.
#[test]
fn dense_outputs_have_their_order() {
    for (name, expected, h) in [("dopri5", 5.0, 1.0 / 16.0), ("dop853", 8.0, 0.25), ("rodas4", 4.0, 1.0 / 64.0)] {
        let found = order(|h| adaptive_errors::<Circle>(name, 2.0, h).1, h);
        assert!((found - expected).abs() < 0.2, "{name}: {found}");
    }
}

#[test]
fn errors_fall_with_the_tolerance() {
    for (name, _) in ADAPTIVE {
        let mut last = f64::INFINITY;
        for exponent in [4, 6, 8, 10] {
            let rtol = 10f64.powi(-exponent);
            let mut method = adaptive::<Circle>(name, rtol, rtol);
            run(&mut method, 0.0, 10.0).unwrap();
            let error = distance(method.x(), &Circle::exact(10.0));
            // This problem is neutrally stable. Its global error is a moderate multiple of the tolerance.
            assert!(error < 100.0 * rtol && error < last / 10.0, "{name} {rtol:e}: {error:e}");
            last = error;
        }
    }
}

#[test]
fn symplectic_euler_keeps_its_invariant() {
    let (mut system, mut method, mut x) = (twin::<Oscillator>(), fixed::<Oscillator>("semi_implicit"), Oscillator::start());
    let h = 0.1;
    let invariant = |x: &[f64]| x[0] * x[0] + x[1] * x[1] - h * x[0] * x[1];
    let before = invariant(&x);
    for k in 0..10_000 {
        method.step(&mut system, k as f64 * h, h, (k + 1) as f64 * h, &mut x);
    }
    // Only the rounding errors of 1e4 steps remain.
    assert!((invariant(&x) - before).abs() < 1e-11);
    assert!(SemiImplicit::new::<f64, _>(&twin::<Circle>(), Circle::start(), 0.0).is_err());
}

/// The system of the method is a [`Twin`], which must report that its time is reversed.
#[test]
fn symplectic_euler_integrates_in_reversed_time() {
    let found = order(|h| fixed_error::<Rewound>("semi_implicit", 2.0, h), 1.0 / 1024.0);
    // The tolerance is as in `methods_have_their_order`.
    assert!((found - 1.0).abs() < 0.1, "{found}");
}

#[test]
fn jacobians_of_recordings_match_central_differences() {
    let (mut system, x, t, eps) = (twin::<Chain>(), Chain::start(), 0.3, 1e-6);
    let (mut dx, mut j, mut dft) = (vec![0.0; 10], vec![0.0; 100], vec![0.0; 10]);
    system.linearise(t, &t, &x, &mut dx, &mut j);
    system.time_derivative(t, &t, &x, &mut dft);
    let f = |t: f64, x: &[f64]| {
        let mut dx = vec![0.0; 10];
        <Chain as Problem>::f(t, x, &mut dx);
        dx
    };
    assert_eq!(dx, f(t, &x));
    for k in 0..10 {
        let (mut up, mut down) = (x.clone(), x.clone());
        up[k] += eps;
        down[k] -= eps;
        let (up, down) = (f(t, &up), f(t, &down));
        for i in 0..10 {
            // The rounding error is about 1e-16 / eps = 1e-10.
            assert!((j[i * 10 + k] - (up[i] - down[i]) / (2.0 * eps)).abs() < 1e-8, "{i} {k}");
        }
    }
    let (up, down) = (f(t + eps, &x), f(t - eps, &x));
    for i in 0..10 {
        assert!((dft[i] - (up[i] - down[i]) / (2.0 * eps)).abs() < 1e-8, "{i}");
    }
}

/// `x' = -1e6 (x - cos t)` with steps of 1 ms. The transient of the pole with h lambda = -1000 vanishes in a few steps. Only the slow
/// solution remains.
struct Stiff;
impl Problem for Stiff {
    const N: usize = 1;
    fn f<S: armlet_core::scalar::Real>(t: S, x: &[S], dx: &mut [S]) {
        dx[0] = S::splat(-1e6) * (x[0] - t.sin_cos().1);
    }
    fn start() -> Vec<f64> {
        vec![2.0]
    }
}

#[test]
fn ros2_damps_what_it_cannot_resolve() {
    let (mut system, mut method, mut x) = (twin::<Stiff>(), fixed::<Stiff>("ros2"), Stiff::start());
    let h = 1e-3;
    for k in 0..1000 {
        method.step(&mut system, k as f64 * h, h, (k + 1) as f64 * h, &mut x);
    }
    // The slow solution is cos t + O(1e-6). The method adds an error O(h^2) = 1e-6.
    assert!((x[0] - 1f64.cos()).abs() < 1e-5, "{}", x[0] - 1f64.cos());
}

/// A right-hand side with a fault that `KIND` selects. 0: it is never finite. 1 and 2: it is not finite after 0.5 s. 3: the solution is
/// infinite at 1 s.
struct Bad<const KIND: u8>;
impl<const KIND: u8> Problem for Bad<KIND> {
    const N: usize = 2;
    fn f<S: armlet_core::scalar::Real>(t: S, x: &[S], dx: &mut [S]) {
        dx[0] = x[1];
        dx[1] = -x[0];
        match KIND {
            0 => dx[0] = S::splat(f64::NAN),
            1 => dx[1] = S::select(S::splat(0.5).lt(t), S::splat(f64::NAN), dx[1]),
            2 => dx[1] = S::select(S::splat(0.5).lt(t), S::splat(f64::INFINITY), dx[1]),
            // The solution is x = 1 / (1 - t).
            3 => (dx[0], dx[1]) = (x[0] * x[0], S::zero()),
            _ => {}
        }
    }
    fn start() -> Vec<f64> {
        vec![1.0, 0.0]
    }
}

fn ends<const KIND: u8>(at: f64, allowed: &[Status]) {
    for (name, _) in ADAPTIVE {
        let began = std::time::Instant::now();
        let mut method = adaptive::<Bad<KIND>>(name, 1e-8, 1e-10);
        let status = run(&mut method, 0.0, 2.0).unwrap_err();
        assert!(allowed.contains(&status), "{name} {KIND}: {status:?}");
        assert!((method.t() - at).abs() < 1e-3 && method.x().iter().all(|x| x.is_finite()), "{name} {KIND}: {}", method.t());
        assert!(began.elapsed().as_secs_f64() < 1.0, "{name} {KIND}");
    }
}

#[test]
fn what_is_not_finite_ends_with_a_status() {
    ends::<0>(0.0, &[Status::Diverged]);
    ends::<1>(0.5, &[Status::Diverged]);
    ends::<2>(0.5, &[Status::Diverged]);
    ends::<3>(1.0, &[Status::Diverged, Status::StepUnderflow]);
    for (name, _) in ADAPTIVE {
        let mut method = adaptive::<Oscillator>(name, 1e-8, 1e-10);
        method.x_mut()[0] = f64::NAN;
        assert_eq!(run(&mut method, 0.0, 1.0), Err(Status::Diverged), "{name}");
        // A time span of zero has no step.
        let mut method = adaptive::<Oscillator>(name, 1e-8, 1e-10);
        assert_eq!(run(&mut method, 1.0, 1.0), Ok(()), "{name}");
        assert_eq!((method.work().steps, method.x()[0]), (0, 1.0));
    }
}

/// Free fall onto an elastic floor. An event stops the run, the state jumps, and the run continues.
struct Fall;
impl Problem for Fall {
    const N: usize = 2;
    fn f<S: armlet_core::scalar::Real>(_: S, x: &[S], dx: &mut [S]) {
        dx[0] = x[1];
        dx[1] = S::splat(-9.81);
    }
    fn start() -> Vec<f64> {
        vec![1.0, 0.0]
    }
}

#[test]
fn events_stop_and_runs_go_on_after_jumps() {
    use armlet_core::integrate::events::{Event, Watch};
    for (name, _) in ADAPTIVE {
        let mut system = twin::<Fall>();
        let mut method = adaptive::<Fall>(name, 1e-10, 1e-12);
        let mut height = |_: usize, _: f64, x: &[f64]| x[0];
        let (mut t, mut at, g) = (0.0, Fall::start(), 9.81f64);
        // The speed after a bounce equals the speed before it. So the period is constant: one fall before the first bounce, then two falls
        // each.
        let fall = (2.0 / g).sqrt();
        for k in 0..5 {
            let mut watch = Watch::new(vec![Event { direction: -1.0, stop_after: 1 }], Fall::start());
            method.begin(&mut system, t, 10.0, 10.0).unwrap();
            watch.begin(&mut height, t, method.x()).unwrap();
            let hit = loop {
                let done = method.step(&mut system).unwrap();
                if let Some(hit) = watch.scan(&mut system, &mut *method, &mut height).unwrap() {
                    break hit;
                }
                assert!(!done, "{name} misses the floor");
            };
            let expected = fall * (2 * k + 1) as f64;
            // Every method computes a parabola exactly. Only rounding errors remain, which grow in the few steps of each flight.
            assert!((hit - expected).abs() < 1e-12 * (k + 1) as f64, "{name} {k}: {:e}", hit - expected);
            method.interpolate(&mut system, hit, &mut at);
            assert!(at[0] <= 0.0 && at[0] > -1e-13, "{name}: {:e}", at[0]);
            // The height is set to zero, because rounding may leave it below the floor.
            method.x_mut().copy_from_slice(&[0.0, -at[1]]);
            t = hit;
        }
    }
}

/// A link with an elastic joint under motor-inertia reduction. K = 1e6 N m/rad and B0 = 1e-5 kg m^2 give poles at 3e5 rad/s. The outer loop
/// has a natural frequency of 10 rad/s.
struct Elastic;
impl Problem for Elastic {
    const N: usize = 4;
    fn f<S: armlet_core::scalar::Real>(_: S, x: &[S], dx: &mut [S]) {
        let k = S::splat;
        let torque = k(1e6) * (x[2] - x[0]);
        let u = k(100.0) * (k(0.5) - x[0]) - k(14.0) * x[1];
        let (push, gravity) = (k(3.0), k(9.81) * x[0].sin_cos().0);
        (dx[0], dx[1]) = (x[1], torque + push - gravity);
        (dx[2], dx[3]) = (x[3], k(1e5) * (u + gravity - torque - k(1.4 * 10f64.sqrt()) * x[3]));
    }
    fn start() -> Vec<f64> {
        vec![-0.5, 0.0, -0.5, 0.0]
    }
    fn autonomous() -> bool {
        true
    }
}

#[test]
fn ros2_takes_elastic_joints_at_a_millisecond() {
    let mut exact = adaptive::<Elastic>("radau5", 1e-10, 1e-12);
    run(&mut exact, 0.0, 0.4).unwrap();
    let error = |h: f64| {
        let (mut system, mut method, mut x) = (twin::<Elastic>(), fixed::<Elastic>("ros2"), Elastic::start());
        for k in 0..(0.4 / h).round() as usize {
            method.step(&mut system, k as f64 * h, h, (k + 1) as f64 * h, &mut x);
        }
        distance(&x[..2], &exact.x()[..2])
    };
    let errors = [1e-3, 5e-4, 2.5e-4].map(error);
    // The motion has an amplitude of about 1 rad and a speed of about 5 rad/s. At 1 ms, the error is about (10 h)^2 of the amplitude. It
    // decreases almost with order 2, although the poles are much faster than the steps.
    assert!(errors[0] < 5e-4, "{errors:?}");
    assert!((errors[0] / errors[2]).log2() > 3.0, "{errors:?}");
}
