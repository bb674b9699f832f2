//! Tests of the derivatives of closed loops, from programs (recorded computations), against central differences of order 6 of the rates.

use crate::loop_derivative_cases::{Case, N, cases, full, gain, numbers, six_axis};
use armlet_core::integrate::{Differentiable, System};
use armlet_core::law::{LawSpec, PdGravitySpec};
use armlet_core::plant::{PlantSpec, RigidSpec, Touch};
use armlet_core::simulate::{Exogenous, Method, Options, Problem, RatesLoop, SteppedLoop, Times};
use std::f64::consts::PI;

/// The time at which derivatives are computed, s.
const T: f64 = 0.3;
/// The step of differences in a state or in time. The truncation error is `H^6/140`, or 5e-19, times the seventh derivative. The rounding
/// error is 2e-16 / H.
const H: f64 = 2e-3;
/// The step of differences in an estimated parameter. The rate of the estimate has a kink at a boundary, which a larger step may cross. The
/// rate is a polynomial of low degree, so that the truncation error is small.
const H_PARAMETER: f64 = 1e-5;
/// The step of differences in an estimated parameter, if the estimates are below those of the smallest body (1e-5 kg m^2). The rounding
/// error is 2e-16 / `H_BELOW`, relative to the size of a row.
const H_BELOW: f64 = 1e-8;

/// Return the largest errors of rows of `df/dx` and of `df/dt`, relative to the size of the row.
fn worst(
    loops: &mut impl Differentiable<f64, Input = Exogenous<f64>>,
    instant: Exogenous<f64>,
    x: &[f64],
    states: usize,
    in_parameter: f64,
) -> (f64, f64) {
    let n = x.len();
    let mut u = instant.clone();
    let (mut dx, mut j, mut dft) = (vec![0.0; n], vec![0.0; n * n], vec![0.0; n]);
    loops.input(T, &mut u);
    loops.linearise(T, &u, x, &mut dx, &mut j);
    loops.time_derivative(T, &u, x, &mut dft);
    let mut f = |t: f64, x: &[f64]| {
        let (mut u, mut dx) = (instant.clone(), vec![0.0; n]);
        loops.input(t, &mut u);
        loops.rhs(&u, x, &mut dx);
        dx
    };
    let mut difference = |h: f64, along: &mut dyn FnMut(f64) -> (f64, Vec<f64>)| {
        let mut sum = vec![0.0; n];
        for (k, weight) in [(1.0, 45.0), (2.0, -9.0), (3.0, 1.0)] {
            for sign in [1.0, -1.0] {
                let (t, x) = along(sign * k * h);
                sum.iter_mut().zip(f(t, &x)).for_each(|(sum, f)| *sum += sign * weight * f / (60.0 * h));
            }
        }
        sum
    };
    let columns: Vec<Vec<f64>> = (0..n)
        .map(|c| {
            difference(if c < states { H } else { in_parameter }, &mut |by| {
                let mut moved = x.to_vec();
                moved[c] += by;
                (T, moved)
            })
        })
        .collect();
    let by_time = difference(H, &mut |by| (T + by, x.to_vec()));
    let (mut in_state, mut in_time) = (0.0f64, 0.0f64);
    for i in 0..n {
        let size = columns.iter().fold(1.0 + dx[i].abs(), |most, column| most.max(column[i].abs()));
        (0..n).for_each(|c| in_state = in_state.max((j[i * n + c] - columns[c][i]).abs() / size));
        in_time = in_time.max((dft[i] - by_time[i]).abs() / (size + by_time[i].abs()));
    }
    (in_state, in_time)
}

/// The rounding error of the differences is 1e-13 of a row. Cancellation in a loop may increase it by a factor of 100. A missing term is at
/// least 1e-3. The rate of a desired acceleration is a difference in the loop itself, accurate to 1e-6.
#[test]
fn programs_and_duals_are_the_derivatives_of_every_loop() {
    let at = numbers(N, 0.2, 0.7);
    let (mut seen, mut pressed, mut wrong) = ([false; 11], false, Vec::new());
    for Case { name, plant, law, force, tau_max, estimate } in cases(&at) {
        let kind = match &law {
            LawSpec::Adaptive(_) => 0,
            LawSpec::ComputedTorque(_) => 1,
            LawSpec::PdGravity(_) => 2,
            LawSpec::CartesianImpedance(_) => 3,
            LawSpec::ElasticImpedance(_) => 4,
            LawSpec::JointImpedance(_) => 5,
            LawSpec::MotorPd(_) => 6,
            LawSpec::StateFeedback(_) => 7,
            // These laws have no derivatives, so that implicit methods refuse them.
            LawSpec::PriorityVelocity(_) | LawSpec::PriorityAcceleration(_) | LawSpec::External(_) => 8,
            // A guarded law requires sampling, and implicit methods then hold the input.
            LawSpec::Guarded(_) => 8,
            LawSpec::Pid(_) => 9,
            LawSpec::JointTracking(_) => 10,
        };
        seen[kind] = true;
        for still in [true, false] {
            let rates = |phase: f64| if still { vec![0.0; N] } else { numbers(N, phase, 0.6) };
            let mut x0 = [at.clone(), rates(0.3)].concat();
            if matches!(plant, PlantSpec::Elastic(_)) {
                x0.extend(at.iter().zip(numbers(N, 0.0, 1e-3)).map(|(q, d)| q + d).chain(rates(0.4)));
            }
            x0.extend(numbers(plant.bristles(), 0.7, 1e-3));
            // Friction has no derivative at rest, and a contact has none where it separates.
            if still && (name.contains("contact") || name.contains("friction")) {
                continue;
            }
            let options = rodas4(tau_max.clone(), true);
            let forces = force.iter().collect::<Vec<_>>();
            let frame = (!forces.is_empty()).then_some(6);
            let problem = Problem { plants: vec![&plant], laws: vec![&law], x0, forces, force_frame: frame, options, measures: None };
            problem.validate().unwrap_or_else(|error| panic!("{name}: {error}"));
            let (mut closed, mut x) = RatesLoop::stepped(&problem);
            if let Some(estimate) = &estimate {
                let states = plant.states();
                x[states..states + estimate.len()].copy_from_slice(estimate);
            }
            let instant = closed.instant();
            // The modes of contacts are inputs of the programs.
            let mut contacts = vec![0.0; 2 * plant.contacts()];
            closed.contacts(&x, &mut contacts);
            let touches: Vec<Touch> = contacts.as_chunks().0.iter().map(|&[depth, push]| Touch::at(depth, push)).collect();
            closed.hold_contacts(&touches);
            pressed |= touches.contains(&Touch::Pressed) && touches.contains(&Touch::Apart);
            assert!(closed.is_running(), "{name}");
            let below = kind == 0 && estimate.is_some();
            let (h, most) = if below { (H_BELOW, 1e-5) } else { (H_PARAMETER, 1e-10) };
            let (in_state, in_time) = worst(&mut closed, instant, &x, plant.states(), h);
            // NaN must also be reported as wrong.
            if !(in_state < most && in_time < 1e-6) {
                wrong.push(format!("{name}, still: {still}: df/dx by {in_state:.1e}, df/dt by {in_time:.1e}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(pressed, "a case has contacts in several modes");
    assert_eq!(seen, [true, true, true, true, true, true, true, true, false, true, true]);
}

fn rodas4(tau_max: Option<Vec<f64>>, monitors: bool) -> Options {
    Options {
        t_end: 1.0,
        dt: None,
        method: Method::Rodas4,
        rtol: 1e-6,
        atol: 1e-9,
        max_step: None,
        sampling: None,
        times: Times::Every(1),
        tau_max,
        monitors,
        state_limit: f64::INFINITY,
    }
}

/// Beyond the range of the sines of machine code, the interpreter computes rates and derivatives. A smaller angle, by a multiple of 2 pi,
/// gives the same results up to the rounding error of the angle, 1e-10 rad.
#[test]
fn the_interpreter_continues_a_loop_that_turns_far() {
    let model = six_axis();
    let plant = PlantSpec::Rigid(RigidSpec::new(model.clone()));
    // Practically without a spring, the rates depend on the angles only by their sines.
    let law = LawSpec::PdGravity(PdGravitySpec::new(model, numbers(N, 0.1, 0.4), full(N, 1e-15), gain(N, 20.0)).unwrap());
    let options = rodas4(None, false);
    let x0 = [numbers(N, 0.2, 0.7), vec![0.1; N]].concat();
    let problem = Problem { plants: vec![&plant], laws: vec![&law], x0, forces: vec![], force_frame: None, options, measures: None };
    for linearise in [false, true] {
        let (mut closed, mut x) = RatesLoop::stepped(&problem);
        let u = closed.instant();
        let evaluate = |closed: &mut RatesLoop, x: &[f64]| {
            let (mut dx, mut j) = (vec![0.0; 2 * N], vec![0.0; 4 * N * N]);
            if linearise {
                closed.linearise(0.0, &u, x, &mut dx, &mut j);
            } else {
                closed.rhs(&u, x, &mut dx);
            }
            [dx, j].concat()
        };
        x[3] = 0.5;
        let near = evaluate(&mut closed, &x);
        assert!(closed.is_running());
        x[3] += 200_000.0 * 2.0 * PI;
        let far = evaluate(&mut closed, &x);
        assert!(!closed.is_running());
        let (largest, most) =
            near.iter().zip(&far).fold((0.0f64, 0.0f64), |(size, most), (a, b)| (size.max(a.abs()), most.max((a - b).abs())));
        assert!(most < 1e-6 * largest, "{most:e} of {largest:e}");
        // A stepper goes back to a state within the range, and uses machine code again.
        x[3] = 0.5;
        closed.replace_state(0.0);
        assert_eq!(evaluate(&mut closed, &x), near);
        assert!(closed.is_running());
    }
}
