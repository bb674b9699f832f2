//! Tests that a step of a closed loop allocates nothing: runs with more steps must not make more allocations. Long runs use *programs*,
//! which are recorded machine code of the loop.

use crate::counting::counted;
use armlet_core::arm::{Arm, STANDARD_GRAVITY, example_urdf};
use armlet_core::dynamics::{Model, PlanarPr};
use armlet_core::kinematics::TaskFunction;
use armlet_core::law::{Adaptation, AdaptiveSpec, CartesianImpedanceSpec, ComputedTorqueSpec, Gain, JointTrackingSpec, LawSpec, Level};
use armlet_core::law::{LimitOverrides, PdGravitySpec, PriorityAccelerationSpec, PriorityVelocitySpec, StateFeedbackSpec};
use armlet_core::motion::{Motion, Sinusoid};
use armlet_core::plant::sensors::TorqueSensor;
use armlet_core::plant::{ElasticSpec, FrictionCurve, JointFriction, PlantSpec, RigidSpec, StickSlip, Stops, VelocitySpec};
use armlet_core::priority::PriorityOptions;
use armlet_core::simulate::{DEFAULT_STATE_LIMIT, Force, Method, Options, Problem, Sampling, Times, simulate};
use armlet_core::status::Status;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

fn sinusoid(n: usize) -> Motion {
    Motion::Sinusoid(Sinusoid::new(vec![0.1; n], 1, vec![0.3; n], vec![1.5; n], vec![0.0; n]).unwrap())
}

/// Return the number of allocations of a run with `steps` steps of 1 ms. The run records only its end, or every step.
fn allocations(
    plant: &PlantSpec,
    law: &LawSpec,
    force: Option<&Force>,
    method: Method,
    (sample, every): (Option<f64>, bool),
    steps: usize,
) -> usize {
    let n = plant.n();
    let t_end = steps as f64 * 1e-3;
    let sensed = matches!(plant, PlantSpec::Elastic(_));
    let sensor = sensed.then(|| TorqueSensor::new(0.1, vec![0.5; n], 0.01, 500.0).unwrap());
    let options = Options {
        t_end,
        dt: Some(1e-3),
        method,
        rtol: 1e-8,
        atol: 1e-10,
        max_step: None,
        sampling: sample.map(|period| Sampling { torque_sensor: sensor.clone(), ..Sampling::every(period) }),
        times: if every { Times::Every(1) } else { Times::At(vec![t_end]) },
        tau_max: Some(vec![1e4; n]),
        monitors: true,
        state_limit: DEFAULT_STATE_LIMIT,
    };
    let x0 = plant.initial_state(&vec![0.2; n], &vec![0.0; n], None, None);
    let problem = Problem {
        plants: vec![plant],
        laws: vec![law],
        x0,
        forces: force.into_iter().collect(),
        force_frame: None,
        options,
        measures: None,
    };
    let stop = AtomicBool::new(false);
    let (run, count) = counted(|| simulate(&problem, &stop).unwrap());
    assert_eq!(run.status, Status::Success, "{}, {method:?}, sampled at {sample:?}: ended at {:?}", law.name(), run.t.last());
    count
}

/// Return adaptive control with diagonal or full adaptation gains.
fn adaptive(model: &Model, diagonal: bool) -> LawSpec {
    let gain = |n: usize, k: f64| Gain::scalar("gain", n, k).unwrap();
    let (n, p) = (model.n(), model.parameter_count());
    let mut gamma = Gain::scalar("gamma", p, 0.1).unwrap().matrix();
    if !diagonal {
        (gamma[1], gamma[p]) = (0.01, 0.01);
    }
    let gamma = Gain::full("gamma", p, gamma).unwrap();
    LawSpec::Adaptive(
        AdaptiveSpec::new(model.clone(), sinusoid(n), gain(n, 0.5), gain(n, 0.5), Adaptation::Euclidean(gamma), None, None).unwrap(),
    )
}

#[test]
fn steps_allocate_nothing() {
    let gain = |n: usize, k: f64| Gain::scalar("gain", n, k).unwrap();
    let pr = Model::PlanarPr(PlanarPr::new(2.0, 0.5, 0.5).unwrap());
    let read = |name: &str| Arm::from_urdf(example_urdf(name).unwrap(), name, STANDARD_GRAVITY, None, None).unwrap();
    let tree = |name: &str| Model::Tree(Arc::new(read(name)));
    let rigid = |model: &Model| PlantSpec::Rigid(RigidSpec::new(model.clone()));
    let (six, two) = (tree("six_axis"), tree("planar_2r"));
    let torque = LawSpec::ComputedTorque(ComputedTorqueSpec::new(six.clone(), sinusoid(6), gain(6, 100.0), gain(6, 20.0)).unwrap());
    let target = Motion::Hold(vec![0.4, 0.3]);
    let frame = two.tree("arm").unwrap().frames.last().unwrap().name.clone();
    let impedance = CartesianImpedanceSpec::new(two.clone(), target, gain(2, 200.0), gain(2, 30.0), &frame, "xy").unwrap();
    let impedance = LawSpec::CartesianImpedance(impedance);
    let push = Force::steps(vec![0.01], vec![[5.0, 0.0, 0.0, 0.0, 0.0, 0.0]]).unwrap();
    // The solver uses both its regular and its singular algorithm, because the target of the second level is unreachable and leads the arm
    // to a singularity.
    let arm = six.tree("arm").unwrap();
    let names: Vec<&str> = arm.frame_names().collect();
    let level = |function: TaskFunction, target: Vec<f64>| {
        let rows = function.rows();
        Level::new(function, Motion::Hold(target), gain(rows, 5.0), None).unwrap()
    };
    let levels = || {
        vec![
            level(TaskFunction::frame(arm, names[names.len() - 1], "xyz rx").unwrap(), vec![0.3, 0.1, 0.4, 0.2]),
            level(TaskFunction::centre_of_mass(arm, "z").unwrap(), vec![2.0]),
            level(TaskFunction::axis(arm, names[names.len() - 1], [0.0, 0.0, 1.0]).unwrap(), vec![0.0, 0.6, 0.8]),
            level(TaskFunction::posture(arm, None).unwrap(), vec![0.0; 6]),
        ]
    };
    let velocity = LawSpec::PriorityVelocity(
        PriorityVelocitySpec::new(six.clone(), levels(), PriorityOptions::default(), &LimitOverrides::default()).unwrap(),
    );
    let acceleration =
        PriorityAccelerationSpec::new(six.clone(), levels(), PriorityOptions::default(), 5.0, &LimitOverrides::default()).unwrap();
    let acceleration = LawSpec::PriorityAcceleration(acceleration);
    let commanded = PlantSpec::Velocity(VelocitySpec { model: six.clone() });
    let cases = [
        ("velocities in priority", commanded, velocity, None),
        ("accelerations in priority", rigid(&six), acceleration, None),
        ("PR, diagonal gains", rigid(&pr), adaptive(&pr, true), None),
        ("PR, full gains", rigid(&pr), adaptive(&pr, false), None),
        ("adaptive six axes", rigid(&six), adaptive(&six, false), None),
        ("computed torque", rigid(&six), torque, None),
        ("impedance under a force", rigid(&two), impedance, Some(&push)),
    ];
    for (what, plant, law, force) in &cases {
        // Unreachable targets make these laws switch between solutions. An adaptive method would locate every switch, and is not used.
        let methods: &[Method] = if what.ends_with("in priority") { &[Method::Rk4] } else { &[Method::Rk4, Method::Dop853] };
        for &method in methods {
            // Records at all accepted steps are excluded, because they enlarge their arrays.
            let variants: &[_] = if method == Method::Rk4 {
                &[(None, false), (None, true), (Some(0.002), false), (Some(0.002), true)]
            } else {
                &[(None, false), (Some(0.002), false)]
            };
            for &(sample, every) in variants {
                // With an unreachable target, accelerations that are held for 2 ms make the arm diverge. The time of divergence depends on
                // rounding. So the runs are short.
                let steps = match method {
                    _ if *what == "accelerations in priority" && sample.is_some() => [20, 60],
                    // Loops of Dop853 are compiled to programs (machine code) after some hundred evaluations. Each run has more
                    // evaluations.
                    Method::Dop853 => [4000, 6000],
                    _ => [100, 1000],
                };
                // The first run makes the programs of the loop.
                allocations(plant, law, *force, method, (sample, every), steps[1]);
                // Other tests fill the store of programs at the same time. The minimum of three runs excludes runs that make their program
                // again.
                let least = |steps| (0..3).map(|_| allocations(plant, law, *force, method, (sample, every), steps)).min();
                let [few, many] = steps.map(least);
                assert_eq!(few, many, "{what}, {method:?}, sampled at {sample:?}, every step recorded: {every}");
                assert!(few > Some(0));
            }
        }
    }
    elastic_steps_allocate_nothing(two);
}

/// Test elastic joints with torque sensors at the sample times. One loop moves into a stop, and the other follows a motion.
fn elastic_steps_allocate_nothing(two: Model) {
    let gain = |n: usize, k: f64| Gain::scalar("gain", n, k).unwrap();
    let stops = Stops::new(vec![-3.0; 2], vec![0.21, 3.0], vec![1e3; 2], vec![10.0; 2]).unwrap();
    let spec = ElasticSpec::new(two.clone(), gain(2, 800.0), gain(2, 0.2), None, None, None).unwrap();
    let gains = [gain(2, 200.0), gain(2, 20.0), gain(2, 1.0), gain(2, 0.02)];
    let feedback =
        LawSpec::StateFeedback(StateFeedbackSpec::new(two.clone(), Motion::Hold(vec![0.4, 0.3]), gains.clone(), gain(2, 800.0)).unwrap());
    let [kp, kd, ..] = gains;
    let tracking = JointTrackingSpec::new(two.clone(), sinusoid(2), [kp, kd], gain(2, 800.0), gain(2, 0.2)).unwrap();
    let loops = [(spec.clone().with_stops(Some(stops)), feedback), (spec, LawSpec::JointTracking(tracking))];
    for (plant, law) in loops.map(|(plant, law)| (PlantSpec::Elastic(plant), law)) {
        for (method, sample, steps) in
            [(Method::Rk4, None, [100, 1000]), (Method::Rk4, Some(0.002), [100, 1000]), (Method::Dop853, None, [4000, 6000])]
        {
            let count = |steps: usize| allocations(&plant, &law, None, method, (sample, false), steps);
            // The first run makes the programs of the loop.
            count(steps[1]);
            assert_eq!(count(steps[0]), count(steps[1]), "{}, {method:?}, sampled at {sample:?}", law.name());
        }
    }
}

#[test]
fn joints_that_stick_and_slip_allocate_nothing() {
    let arm = Arm::from_urdf(example_urdf("planar_2r").unwrap(), "planar_2r", STANDARD_GRAVITY, None, None).unwrap();
    let model = Model::Tree(Arc::new(arm));
    let gain = |k: f64| Gain::scalar("gain", 2, k).unwrap();
    let curve = FrictionCurve::new(vec![1.0; 2], Some(vec![2.0; 2]), Some(vec![0.05; 2]), None, Some(vec![0.1; 2])).unwrap();
    let friction = Some(JointFriction::StickSlip(StickSlip { curve }));
    let plant = PlantSpec::Rigid(RigidSpec::new(model.clone()).with_friction(friction).unwrap());
    let law = LawSpec::PdGravity(PdGravitySpec::new(model, nalgebra::dvector![0.4, 0.3], gain(20.0), gain(0.5)).unwrap());
    for (method, sample) in [(Method::Rk4, None), (Method::Rk4, Some(0.002)), (Method::Dop853, None)] {
        let count = |steps: usize| allocations(&plant, &law, None, method, (sample, false), steps);
        // The first runs make the programs of the loop: the interpreter computes until machine code repays.
        (0..4).for_each(|_| assert!(count(6000) > 0));
        assert_eq!(count(4000), count(6000), "{method:?}, sampled at {sample:?}");
    }
}
