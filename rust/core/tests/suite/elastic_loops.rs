//! Tests of the planar 2R arm with elastic joints. Programs (recorded machine code) and direct evaluation must give the same steps, and the
//! same states and monitors up to rounding errors.

use armlet_core::arm::Arm;
use armlet_core::dynamics::Model;
use armlet_core::law::{CartesianImpedanceSpec, ElasticImpedanceSpec, Gain, LawSpec, ReductionSpec};
use armlet_core::motion::Motion;
use armlet_core::plant::{ElasticSpec, PlantSpec};
use armlet_core::simulate::{DEFAULT_STATE_LIMIT, Force, Keep, Method, Options, Problem, Run, Times, simulate, simulate_batch};
use armlet_core::status::Status;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

const WRENCH: [f64; 6] = [5.0, -3.0, 0.0, 0.0, 0.0, 0.0];

fn stiff(relative: bool) -> (PlantSpec, LawSpec) {
    let arm = Arm::planar(&[0.5, 0.4], Some(&[2.0, 1.5]), Some(&[0.25, 0.2]), Some(&[0.05, 0.03]), [0.0, -9.81]).unwrap();
    let model = Model::Tree(Arc::new(arm));
    let pair = |name: &str, x: [f64; 2]| Gain::diagonal(name, x.to_vec()).unwrap();
    let (k, b, b0) = (pair("K", [1e5, 4e4]), pair("B", [0.5, 0.3]), pair("B0", [1e-4, 2e-4]));
    let plant = ElasticSpec::new(model.clone(), k.clone(), b.clone(), None, None, None).unwrap();
    let target = Motion::Hold(vec![0.6, 0.3]);
    let outer = CartesianImpedanceSpec::new(model, target, pair("K_m", [400.0, 300.0]), pair("D_m", [4.0, 7.0]), "link2", "xy").unwrap();
    let inner = ReductionSpec::new(2, k, b, b0, None, 0.7, relative).unwrap();
    (PlantSpec::Elastic(plant), LawSpec::ElasticImpedance(ElasticImpedanceSpec { outer, inner }))
}

/// Return a run of 0.3 s from a moving start. With `steps` the force is piecewise constant, and programs can read it. Otherwise it is a
/// function of time.
fn run(relative: bool, method: Method, monitors: bool, steps: bool) -> Run {
    let (plant, law) = stiff(relative);
    let force = if steps { Force::steps(vec![0.0], vec![WRENCH]).unwrap() } else { Force::Signal(Arc::new(|_| Some(WRENCH))) };
    let options = Options {
        t_end: 0.3,
        dt: Some(1e-6),
        method,
        rtol: 1e-6,
        atol: 1e-9,
        max_step: None,
        sampling: None,
        times: Times::At(vec![0.1, 0.3]),
        tau_max: None,
        monitors,
        state_limit: DEFAULT_STATE_LIMIT,
    };
    let x0 = vec![-0.5, 1.6, 0.8, -1.1, -0.499, 1.601, 0.9, -1.0];
    let problem = Problem { plants: vec![&plant], laws: vec![&law], x0, forces: vec![&force], force_frame: None, options, measures: None };
    let run = simulate(&problem, &AtomicBool::new(false)).unwrap();
    assert_eq!(run.status, Status::Success);
    run
}

/// Return the largest difference of two series, relative to the largest entry.
fn differ(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let size = a.iter().fold(1e-300f64, |most, x| most.max(x.abs()));
    a.iter().zip(b).fold(0.0f64, |most, (x, y)| most.max((x - y).abs() / size))
}

/// Return the allowed rounding error of a monitor: 1e-5 N m for torques, and 1e-8 J for energies. The stiffness of 1e5 N m/rad multiplies
/// position errors, which causes the torque error.
fn rounding(monitor: &str) -> f64 {
    if monitor == "torque_error" { 1e-5 } else { 1e-8 }
}

/// A wrong derivative would change a run of a Rosenbrock method by its tolerance of 1e-6. With correct derivatives, only rounding errors
/// remain, which grow from step to step. The rounding errors of velocities are larger than those of positions. The law multiplies the
/// rounding errors of spring torques by B/B0 = 5000.
#[test]
fn forces_in_steps_and_as_functions_give_the_same_steps() {
    for relative in [false, true] {
        let reference = run(relative, Method::Rodas4, true, false);
        for monitors in [false, true] {
            let got = run(relative, Method::Rodas4, monitors, true);
            assert_eq!((got.steps, got.rejections), (reference.steps, reference.rejections), "{relative} {monitors}");
            for (name, a, b, tolerance) in [
                ("q", &got.q, &reference.q, 1e-10),
                ("theta", &got.theta, &reference.theta, 1e-10),
                ("v", &got.v, &reference.v, 1e-8),
                ("theta_dot", &got.theta_dot, &reference.theta_dot, 1e-8),
                ("tau", &got.tau, &reference.tau, 1e-5),
            ] {
                assert!(differ(a, b) < tolerance, "{name} {relative} {monitors}: {:e} {a:?} {b:?}", differ(a, b));
            }
            assert_eq!(got.monitors.len(), if monitors { reference.monitors.len() } else { 0 });
        }
        let watched = run(relative, Method::Rodas4, true, true);
        for ((name, a), (_, b)) in watched.monitors.iter().zip(&reference.monitors) {
            let worst = a.iter().zip(b).fold(0.0f64, |most, (x, y)| most.max((x - y).abs()));
            assert!(worst < rounding(name), "{name} {relative}: {a:?} {b:?}");
        }
    }
}

/// The steps and the motion must not depend on the monitors. The energy balance must be zero within the error of the integration method.
#[test]
fn monitors_do_not_disturb_a_run() {
    let plain = run(false, Method::Dop853, false, true);
    let watched = run(false, Method::Dop853, true, true);
    assert_eq!((plain.steps, plain.rejections), (watched.steps, watched.rejections));
    assert!(differ(&plain.q, &watched.q) < 1e-13);
    let general = run(false, Method::Dop853, true, false);
    // The steps of an explicit method remain at the limit of stability, where rounding changes their sizes. So the energies of the two
    // loops agree less accurately. Errors of torques are errors of springs, multiplied with B/B0 = 5000.
    for ((name, a), (_, b)) in watched.monitors.iter().zip(&general.monitors) {
        let tolerance = if *name == "torque_error" { 2e-2 } else { 1e-6 };
        assert!(a.iter().zip(b).all(|(x, y)| (x - y).abs() < tolerance), "{name}: {a:?} {b:?}");
    }
    let (_, balance) = watched.monitors.iter().find(|(name, _)| *name == "energy_balance").unwrap();
    // The error of the balance is that of the integration method at rtol 1e-6.
    assert!(balance.iter().all(|b| b.abs() < 1e-5), "{balance:?}");
}

/// The monitors of each row of a batch must equal those of the single run up to rounding errors.
#[test]
fn batches_are_monitored_in_lanes() {
    let (plant, law) = stiff(true);
    let force = Force::steps(vec![0.0, 0.01], vec![WRENCH, [0.0; 6]]).unwrap();
    let options = Options {
        t_end: 0.02,
        dt: Some(2e-6),
        method: Method::Rk4,
        rtol: 1e-6,
        atol: 1e-9,
        max_step: None,
        sampling: None,
        times: Times::Every(1000),
        tau_max: None,
        monitors: true,
        state_limit: DEFAULT_STATE_LIMIT,
    };
    let x0 = vec![-0.5, 1.6, 0.8, -1.1, -0.499, 1.601, 0.9, -1.0];
    let mut problem = Problem {
        plants: vec![&plant],
        laws: vec![&law],
        x0: x0.clone(),
        forces: vec![&force],
        force_frame: None,
        options,
        measures: None,
    };
    let one = simulate(&problem, &AtomicBool::new(false)).unwrap();
    problem.x0 = x0.repeat(11);
    let many = simulate_batch(problem.clone(), Keep::All, 2, &mut || false).unwrap();
    assert_eq!(many.status, vec![Status::Success; 11]);
    assert_eq!(one.monitors.len(), 5);
    for ((name, series), (_, rows)) in one.monitors.iter().zip(&many.monitors) {
        for row in rows.chunks_exact(series.len()) {
            assert!(series.iter().zip(row).all(|(a, b)| (a - b).abs() < rounding(name)), "{name}: {series:?} {row:?}");
        }
    }
    // The natural frequency of the motors is 3e4 rad/s, and a step is 2 us. The balance has the error of a method of order 4.
    assert!(one.monitors[2].1.iter().all(|b| b.abs() < 1e-6), "{:?}", one.monitors[2]);
}
