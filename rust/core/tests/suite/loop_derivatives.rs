//! Tests of the derivatives of closed loops, from programs (recorded machine code) and from dual numbers, against central differences
//! of order 6 of the rates.

use armlet_core::arm::{Arm, STANDARD_GRAVITY, example_urdf};
use armlet_core::dynamics::Model;
use armlet_core::integrate::{Differentiable, System};
use armlet_core::kinematics::Coordinates;
use armlet_core::law::{
    Adaptation, AdaptiveSpec, CartesianImpedanceSpec, ComputedTorqueSpec, ElasticImpedanceSpec, Gain, JointColumn, JointColumns,
    JointImpedanceSpec, LawSpec, LeakageForm, MotorPdSpec, PdGravitySpec, PidOptions, PidSpec, Projection, ReductionSpec,
    StateFeedbackSpec,
};
use armlet_core::motion::{Motion, Sinusoid};
use armlet_core::plant::{ElasticSpec, FrictionCurve, JointFriction, LuGre, PlantSpec, RigidSpec, Stops, Touch, Wall};
use armlet_core::simulate::{Exogenous, Force, Method, Options, Problem, Solved, Times, recorded_loop};
use armlet_core::spatial::{Matrix, Vector, rotation_exp, rotation_log};
use std::sync::Arc;

const N: usize = 6;
const FRAME: &str = "flange";
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

fn six_axis() -> Model {
    Model::Tree(Arc::new(Arm::from_urdf(example_urdf("six_axis").unwrap(), "six_axis", STANDARD_GRAVITY, None, None).unwrap()))
}

/// Return reproducible numbers that are spread over a range.
fn numbers(n: usize, offset: f64, scale: f64) -> Vec<f64> {
    (0..n).map(|i| offset + scale * (1.0 + 2.3 * i as f64).sin()).collect()
}

fn gain(n: usize, scale: f64) -> Gain {
    Gain::diagonal("gain", (0..n).map(|i| scale * (1.0 + 0.1 * i as f64)).collect()).unwrap()
}

/// Return a gain that is not diagonal.
fn full(n: usize, scale: f64) -> Gain {
    Gain::full("gain", n, (0..n * n).map(|k| if k / n == k % n { scale } else { 0.05 * scale }).collect()).unwrap()
}

fn moving(offset: Vec<f64>) -> Motion {
    let n = offset.len();
    Motion::Sinusoid(Sinusoid::new(offset, 1, vec![0.2; n], numbers(n, 1.5, 0.5), numbers(n, 0.0, 1.0)).unwrap())
}

/// Return the flange's pose at `q`, `[p; log R]`, rotated by the rotation vector `turn` in world axes.
fn pose(model: &Model, q: &[f64], turn: [f64; 3]) -> Vec<f64> {
    let coordinates = Coordinates::new(model.tree("arm").unwrap(), FRAME, "xyz rx ry rz").unwrap();
    // For the target zero, the error of the flange is its negative pose.
    let (mut e, mut j) = (vec![0.0; N], vec![0.0; N * N]);
    model.at(q).error_and_jacobian(&coordinates, &[0.0; N], &mut e, &mut j);
    let vector = rotation_log(&rotation_exp(turn).times(rotation_exp([-e[3], -e[4], -e[5]])));
    [[-e[0], -e[1], -e[2]], vector.array()].concat()
}

struct Case {
    name: String,
    plant: PlantSpec,
    law: LawSpec,
    force: Option<Force>,
    tau_max: Option<Vec<f64>>,
    /// The law's state at which derivatives are computed. `None` selects its initial state.
    estimate: Option<Vec<f64>>,
}

fn case(name: &str, plant: PlantSpec, law: LawSpec) -> Case {
    Case { name: name.into(), plant, law, force: None, tau_max: None, estimate: None }
}

fn cartesian(model: &Model, target: Motion, axes: &str) -> CartesianImpedanceSpec {
    let m = target.dof();
    CartesianImpedanceSpec::new(model.clone(), target, full(m, 400.0), full(m, 40.0), FRAME, axes).unwrap()
}

/// Return loops with a law of every kind that has derivatives, and with every part of a plant. `at` is the position of the arm.
// Long: a list of loops.
fn cases(at: &[f64]) -> Vec<Case> {
    let model = six_axis();
    let rigid = || PlantSpec::Rigid(RigidSpec::new(model.clone()));
    let q_d = numbers(N, 0.1, 0.4);
    let mut all = Vec::new();

    // Orientation errors of all sizes: zero, below the threshold of the logarithm's series, and up to nearly 180 degrees.
    for angle in [0.0, 1e-9, 1e-5, 1e-3, 0.1, 1.0, 3.0] {
        let target = Motion::Hold(pose(&model, at, [0.36 * angle, -0.48 * angle, 0.8 * angle]));
        all.push(case(
            &format!("CartesianImpedance, {angle} rad off"),
            rigid(),
            LawSpec::CartesianImpedance(cartesian(&model, target, "xyz rx ry rz")),
        ));
    }
    let (pose, first) = (pose(&model, at, [0.1, 0.2, -0.1]), |m: usize| (0..m).map(|_| 0.0).collect::<Vec<f64>>());
    for (target, axes) in [
        (pose.clone(), "xyz rx ry rz"),
        (pose[3..].to_vec(), "rx ry rz"),
        (vec![0.3, pose[5]], "x rz"),
        (pose[..3].to_vec(), "xyz"),
        (first(3), "rx ry rz"),
    ] {
        let law = cartesian(&model, moving(target), axes);
        all.push(case(&format!("CartesianImpedance, moving {axes}"), rigid(), LawSpec::CartesianImpedance(law)));
    }

    let pd = PdGravitySpec::new(model.clone(), q_d.clone(), full(N, 100.0), gain(N, 20.0)).unwrap();
    all.push(case("PDGravity", rigid(), LawSpec::PdGravity(pd.clone())));
    let limit = Some(vec![3.0, 500.0, 500.0, 500.0, 1e-3, 500.0]);
    all.push(Case { tau_max: limit, ..case("PDGravity, saturated", rigid(), LawSpec::PdGravity(pd.clone())) });
    let gains = || (full(N, 100.0), Some(full(N, 30.0)), gain(N, 20.0));
    let pid = |motion: Motion, ki: bool, options: PidOptions| {
        let (kp, integral, kd) = gains();
        PidSpec::new(model.clone(), motion, kp, integral.filter(|_| ki), kd).unwrap().with(options).unwrap()
    };
    let limit = Some(vec![3.0, 500.0, 500.0, 500.0, 1e-3, f64::INFINITY]);
    let held = || Motion::hold(q_d.clone()).unwrap();
    let observer = || PidOptions { observer_bandwidth: Some(vec![40.0; N]), ..PidOptions::default() };
    let all_of_it =
        || PidOptions { tau_max: limit.clone(), derivative_filter: Some(vec![150.0; N]), friction_speed: Some(vec![0.2; N]), ..observer() };
    for (name, law) in [
        ("PID", pid(held(), true, PidOptions::default())),
        ("PID, saturated", pid(held(), true, PidOptions { tau_max: limit.clone(), ..PidOptions::default() })),
        ("PID, filtered", pid(held(), true, PidOptions { derivative_filter: Some(vec![150.0; N]), ..PidOptions::default() })),
        ("PID, moving", pid(moving(q_d.clone()), true, PidOptions::default())),
        ("PD with an observer", pid(moving(q_d.clone()), false, observer())),
    ] {
        all.push(case(name, rigid(), LawSpec::from(law)));
    }
    // The filtered velocity at this state is 10 rad/s. So differences with the step `H` do not cross a limit of the torque. At the initial
    // state, they would cross a limit.
    let behind = at.iter().map(|q| q - 10.0 / 150.0);
    let state = [0.0; N].into_iter().chain(behind).chain([0.0; N]).collect();
    let law = LawSpec::from(pid(moving(q_d.clone()), true, all_of_it()));
    all.push(Case { estimate: Some(state), ..case("PID, all options", rigid(), law) });
    let computed = ComputedTorqueSpec::new(model.clone(), moving(q_d.clone()), full(N, 100.0), gain(N, 20.0)).unwrap();
    all.push(case("ComputedTorque", rigid(), LawSpec::ComputedTorque(computed.clone())));

    let truth = model.parameters();
    let p = truth.len();
    let adaptive = |adaptation: Adaptation, estimate: Option<Vec<f64>>| {
        AdaptiveSpec::new(model.clone(), moving(q_d.clone()), gain(N, 60.0), full(N, 20.0), adaptation, None, estimate).unwrap()
    };
    let euclidean = || Adaptation::Euclidean(gain(p, 0.5));
    let estimate: Vec<f64> = truth.iter().map(|x| 1.1 * x).collect();
    all.push(case("Adaptive", rigid(), LawSpec::Adaptive(adaptive(euclidean(), Some(estimate.clone())))));
    all.push(case("Adaptive from nothing", rigid(), LawSpec::Adaptive(adaptive(euclidean(), None))));
    let natural = Adaptation::Natural(vec![0.1; p / 10]);
    all.push(case("Adaptive, natural", rigid(), LawSpec::Adaptive(adaptive(natural, Some(estimate.clone())))));
    let least: Vec<f64> = truth.iter().map(|x| 0.2 * x).collect();
    let kinds = [JointColumn::Armature, JointColumn::Viscous, JointColumn::Coulomb, JointColumn::Stribeck];
    // The Stribeck speed is 1.5 rad/s. With a smaller one, the seventh derivative and the truncation error would be much larger.
    let columns = JointColumns::new(N, &kinds, vec![1.5; N]).unwrap();
    let (beside, wide) = ([estimate.clone(), vec![0.3; 4 * N]].concat(), Adaptation::Euclidean(gain(p + 4 * N, 0.5)));
    let gains = [gain(N, 60.0), full(N, 20.0)];
    let joints = AdaptiveSpec::with_columns(model.clone(), moving(q_d.clone()), gains, wide, None, columns, Some(beside)).unwrap();
    for (form, what) in [(LeakageForm::Sigma, "sigma"), (LeakageForm::Error, "e")] {
        let law = joints.clone().leaking(0.2, form, None).unwrap().resting_below(1e-3).unwrap();
        all.push(case(&format!("Adaptive, joints too, {what}"), rigid(), LawSpec::Adaptive(law)));
    }
    let projected = adaptive(euclidean(), Some(estimate)).projected(Projection::new(p, &least).unwrap()).unwrap();
    all.push(case("Adaptive, projected", rigid(), LawSpec::Adaptive(projected.clone())));
    // These cases have estimates below the smallest bodies: equal eigenvalues, different eigenvalues, and parameters that are not physical.
    let scaled = |by: &dyn Fn(usize) -> f64| Some(truth.iter().enumerate().map(|(k, x)| by(k) * x).collect::<Vec<f64>>());
    for (what, estimate) in [
        ("equal", scaled(&|_| 0.1)),
        ("nothing", scaled(&|_| 0.0)),
        ("different", scaled(&|k| 0.1 + 0.07 * (1.0 + 2.3 * k as f64).sin())),
        ("no bodies", scaled(&|k| -0.2 + 0.3 * (1.0 + 2.3 * k as f64).sin())),
    ] {
        let below = case(&format!("Adaptive, projected, below: {what}"), rigid(), LawSpec::Adaptive(projected.clone()));
        all.push(Case { estimate, ..below });
    }

    // The flange is inside a wall, 0.1 m below a point of the surface. The upper stops are alternately 0.05 rad below and above the joint
    // positions. The joints have friction.
    let frame = model.tree("arm").unwrap().frame_index(FRAME).unwrap();
    let wall = Wall::new(frame, [pose[0], pose[1], pose[2] + 0.1], [0.1, 0.0, 1.0], 5e3, 30.0).unwrap();
    let bound = |by: f64| at.iter().enumerate().map(|(i, q)| q + by * if i % 2 == 0 { 1.0 } else { -1.0 }).collect::<Vec<f64>>();
    let upper: Vec<f64> = bound(-0.05).iter().zip(at).map(|(a, q)| a.max(q - 0.05)).collect();
    let stops = Stops::new(vec![-7.0; N], upper, vec![2e3; N], vec![5.0; N]).unwrap();
    let touching = RigidSpec { friction: true, wall: Some(wall.clone()), stops: Some(stops.clone()), ..RigidSpec::new(model.clone()) };
    all.push(case("ComputedTorque in contact", PlantSpec::Rigid(touching), LawSpec::ComputedTorque(computed)));
    let each = |x: f64| Some(vec![x; N]);
    let lugre = |load: Option<Vec<f64>>| {
        let curve = FrictionCurve::new(vec![2.0; N], each(3.0), each(0.7), each(0.4), load).unwrap();
        Some(JointFriction::LuGre(LuGre::new(curve, vec![1e3; N], each(3.0)).unwrap()))
    };
    let rubbing = RigidSpec::new(model.clone()).with_friction(lugre(each(0.2))).unwrap();
    all.push(case("PDGravity, LuGre friction", PlantSpec::Rigid(rubbing), LawSpec::PdGravity(pd.clone())));
    let push = Force::Signal(Arc::new(|t: f64| Some([5.0 * (3.0 * t).sin(), 1.0, t, 0.1, t * t, -0.2])));
    all.push(Case { force: Some(push), ..case("PDGravity pushed", rigid(), LawSpec::PdGravity(pd.clone())) });

    let spring = || full(N, 1e4);
    let elastic = || ElasticSpec::new(model.clone(), spring(), gain(N, 0.5), None, None, None).unwrap();
    let lossy = ElasticSpec::new(model.clone(), spring(), gain(N, 0.5), Some(vec![2.0; N]), Some(vec![1.0; N]), Some(wall)).unwrap();
    let reduction = |relative: bool| ReductionSpec::new(N, spring(), gain(N, 0.5), gain(N, 0.01), None, 0.7, relative).unwrap();
    for (relative, plant) in [(false, elastic()), (true, lossy.with_stops(Some(stops)))] {
        for (target, what) in [(Motion::Hold(pose.clone()), "held"), (moving(pose.clone()), "moving")] {
            let law = ElasticImpedanceSpec { outer: cartesian(&model, target, "xyz rx ry rz"), inner: reduction(relative) };
            all.push(case(
                &format!("ElasticImpedance, {what}, {relative}"),
                PlantSpec::Elastic(plant.clone()),
                LawSpec::ElasticImpedance(law),
            ));
        }
    }
    let joint = JointImpedanceSpec { outer: pd, inner: reduction(true) };
    all.push(case("JointImpedance", PlantSpec::Elastic(elastic()), LawSpec::JointImpedance(joint)));
    for online in [false, true] {
        let law = MotorPdSpec::new(model.clone(), &q_d, full(N, 500.0), gain(N, 20.0), spring(), online).unwrap();
        // This plant has friction that does not depend on the load. With load-dependent friction, differences could change the sign of the
        // spring torque, whose magnitude has no derivative at zero.
        let rubbing = elastic().with_friction(lugre(None)).unwrap();
        all.push(case(&format!("MotorPD, LuGre friction, {online}"), PlantSpec::Elastic(rubbing), LawSpec::MotorPd(law.clone())));
        all.push(case(&format!("MotorPD, {online}"), PlantSpec::Elastic(elastic()), LawSpec::MotorPd(law)));
    }
    let gains = [full(N, 500.0), gain(N, 20.0), gain(N, 2.0), gain(N, 0.01)];
    let law = StateFeedbackSpec::new(model.clone(), &q_d, gains, spring()).unwrap();
    all.push(case("StateFeedback", PlantSpec::Elastic(elastic()), LawSpec::StateFeedback(law)));
    all
}

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
    let (mut seen, mut pressed, mut wrong) = ([false; 10], false, Vec::new());
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
            let (mut closed, mut x): (Solved, _) = recorded_loop(&problem);
            if let Some(estimate) = &estimate {
                let states = plant.states();
                x[states..states + estimate.len()].copy_from_slice(estimate);
            }
            let instant = closed.instant();
            // The modes of contacts are inputs of the programs.
            closed.direct.system.turn_to(&x);
            let touches: Vec<Touch> =
                (0..plant.contacts()).map(|i| closed.direct.system.contact(i, &x)).map(|[depth, push]| Touch::at(depth, push)).collect();
            closed.touch(&touches);
            pressed |= touches.contains(&Touch::Pressed) && touches.contains(&Touch::Apart);
            assert!(closed.is_running(), "{name}");
            let below = kind == 0 && estimate.is_some();
            let (h, most) = if below { (H_BELOW, 1e-5) } else { (H_PARAMETER, 1e-10) };
            let found =
                [worst(&mut closed, instant.clone(), &x, plant.states(), h), worst(&mut closed.direct, instant, &x, plant.states(), h)];
            for ((in_state, in_time), way) in found.into_iter().zip(["program", "duals"]) {
                // NaN must also be reported as wrong.
                if !(in_state < most && in_time < 1e-6) {
                    wrong.push(format!("{name}, {way}, still: {still}: df/dx by {in_state:.1e}, df/dt by {in_time:.1e}"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(pressed, "a case has contacts in several modes");
    assert_eq!(seen, [true, true, true, true, true, true, true, true, false, true]);
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

/// Beyond the range of the programs' sines, rates and derivatives are evaluated without programs, with the same results.
#[test]
fn a_loop_that_turns_far_goes_on_directly() {
    let model = six_axis();
    let plant = PlantSpec::Rigid(RigidSpec::new(model.clone()));
    let law = LawSpec::PdGravity(PdGravitySpec::new(model, numbers(N, 0.1, 0.4), full(N, 100.0), gain(N, 20.0)).unwrap());
    let options = rodas4(None, false);
    let x0 = [numbers(N, 0.2, 0.7), vec![0.1; N]].concat();
    let problem = Problem { plants: vec![&plant], laws: vec![&law], x0, forces: vec![], force_frame: None, options, measures: None };
    for linearise in [false, true] {
        let (mut closed, mut x): (Solved, _) = recorded_loop(&problem);
        let u = closed.instant();
        let (mut dx, mut j) = (vec![0.0; 2 * N], vec![0.0; 4 * N * N]);
        let (mut expected, mut slope) = (dx.clone(), j.clone());
        closed.rhs(&u, &x, &mut dx);
        assert!(closed.is_running());
        x[3] = 1.0e6 + 0.5;
        if linearise {
            closed.linearise(0.0, &u, &x, &mut dx, &mut j);
        } else {
            closed.rhs(&u, &x, &mut dx);
        }
        assert!(!closed.is_running());
        if linearise {
            closed.direct.linearise(0.0, &u, &x, &mut expected, &mut slope);
        } else {
            closed.direct.rhs(&u, &x, &mut expected);
        }
        assert_eq!((&dx, &j), (&expected, &slope));
        // A stepper goes back to a state within the range, and uses the programs again.
        x[3] = 0.5;
        closed.go_back();
        closed.rhs(&u, &x, &mut dx);
        assert!(closed.is_running());
    }
}
