//! Tests of elastic joints against `oracle_ex3_elastic_public.json`, computed with mpmath. They compare outputs of laws, trajectories of
//! four methods, equilibria and limits.

use crate::arm_common::{numbers, vectors};
use armlet_core::analysis::elastic_limits::{smallest_reduced_inertia, stiffness_limit, stiffness_scale};
use armlet_core::analysis::equilibrium::equilibrium;
use armlet_core::arm::Arm;
use armlet_core::dynamics::Model;
use armlet_core::law::{CartesianImpedanceSpec, ElasticImpedanceSpec, Gain, LawSpec, ReductionSpec};
use armlet_core::motion::Motion;
use armlet_core::plant::{ElasticSpec, PlantSpec};
use armlet_core::simulate::{DEFAULT_STATE_LIMIT, Force, Keep, Method, Options, Problem, Times, simulate, simulate_batch};
use armlet_core::status::Status;
use serde_json::Value;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

const FILE: &str = "oracle_ex3_elastic_public.json";

fn matrix(name: &str, value: &Value) -> Gain {
    Gain::full(name, 2, value.as_array().unwrap().iter().flat_map(numbers).collect()).unwrap()
}

/// Return plant and law of a case. `b0` is the reduced inertia as a fraction of `B`; zero selects the `B0` of the case. The damping is
/// scaled by `d_m`.
fn scaled(input: &Value, [b0, d_m]: [f64; 2]) -> (PlantSpec, LawSpec) {
    let r = |key: &str| numbers(&input["robot"][key])[0];
    let pair = |key: &str| vec![r(&format!("{key}1")), r(&format!("{key}2"))];
    let arm = Arm::planar(&pair("l"), Some(&pair("m")), Some(&pair("d")), Some(&pair("I")), [0.0, -r("g0")]).unwrap();
    let model = Model::Tree(Arc::new(arm));
    let get = |key: &str| matrix(key, &input[key]);
    let plant = ElasticSpec::new(model.clone(), get("K_J"), get("B"), None, None, None).unwrap();
    let target = Motion::Hold(numbers(&input["x_d"]));
    let outer = CartesianImpedanceSpec::new(model, target, get("K_m"), get("D_m").scaled(d_m), "link2", "xy").unwrap();
    let reduced = if b0 > 0.0 { get("B").scaled(b0) } else { get("B0") };
    let inner = ReductionSpec::new(2, get("K_J"), get("B"), reduced, None, 1.0, false).unwrap();
    (PlantSpec::Elastic(plant), LawSpec::ElasticImpedance(ElasticImpedanceSpec { outer, inner }))
}

fn loop_of(input: &Value) -> (PlantSpec, LawSpec) {
    scaled(input, [0.0, 1.0])
}

fn cases<'a>(file: &'a Value, kind: &str) -> Vec<&'a Value> {
    let all: Vec<&Value> = file["cases"].as_array().unwrap().iter().filter(|case| case["kind"] == kind).collect();
    assert!(!all.is_empty(), "{kind}");
    all
}

fn close(what: &str, got: &[f64], want: &[f64], tolerance: f64) {
    assert_eq!(got.len(), want.len(), "{what}");
    for (g, w) in got.iter().zip(want) {
        assert!((g - w).abs() <= tolerance, "{what}: {got:?} {want:?}");
    }
}

#[test]
fn law_values() {
    let file = vectors(FILE);
    for case in cases(&file, "static") {
        let (input, expected) = (&case["input"], case["expected"].as_object().unwrap());
        let (_, law) = loop_of(input);
        let x: Vec<f64> = ["q", "qd", "theta", "thetad"].iter().flat_map(|key| numbers(&input[*key])).collect();
        let terms = law.terms_at(0.0, &x, &[]);
        assert_eq!(expected.len(), 11);
        for (name, want) in expected {
            let (_, _, got) = terms.iter().find(|(part, _, _)| part == name).unwrap();
            let want = numbers(want);
            let largest = want.iter().fold(0.0f64, |most, x| most.max(x.abs()));
            close(name, got, &want, case["tolerance"]["rel"].as_f64().unwrap() * largest);
        }
    }
}

#[test]
fn trajectories() {
    let file = vectors(FILE);
    for case in cases(&file, "trajectory") {
        let (input, tolerance) = (&case["input"], case["tolerance"]["state_abs"].as_f64().unwrap());
        let (plant, law) = loop_of(input);
        let steps = input["force"].as_array().unwrap();
        let wrench = |step: &Value| {
            let f = numbers(&step[1]);
            [f[0], f[1], 0.0, 0.0, 0.0, 0.0]
        };
        let force = Force::steps(steps.iter().map(|s| numbers(&s[0])[0]).collect(), steps.iter().map(wrench).collect()).unwrap();
        let v0 = if input["qd0"].is_null() { vec![0.0; 2] } else { numbers(&input["qd0"]) };
        let x0 = plant.initial_state(&numbers(&input["q0"]), &v0, None, None);
        let times = numbers(&input["times"]);
        let t_end = *times.last().unwrap();
        let samples = case["expected"]["samples"].as_array().unwrap();
        let names = ["q", "qd", "theta", "thetad"];
        // RK4 has steps of 0.1 ms, for modes up to 300/s. The other methods have the relative tolerance 1e-11 and the absolute tolerance
        // 1e-12.
        for (method, monitors) in [
            (Method::Rk4, true),
            (Method::Rk4, false),
            (Method::Dop853, true),
            (Method::Dop853, false),
            (Method::Rodas4, true),
            (Method::Rodas4, false),
            (Method::Radau5, false),
        ] {
            let options = Options {
                t_end,
                dt: Some(1e-4),
                method,
                rtol: 1e-11,
                atol: 1e-12,
                max_step: None,
                sampling: None,
                times: Times::At(times.clone()),
                tau_max: None,
                monitors,
                state_limit: DEFAULT_STATE_LIMIT,
            };
            let x0 = x0.clone();
            let mut problem =
                Problem { plants: vec![&plant], laws: vec![&law], x0, forces: vec![&force], force_frame: None, options, measures: None };
            let run = simulate(&problem, &AtomicBool::new(false)).unwrap();
            assert_eq!(run.status, Status::Success, "{method:?}");
            for (k, sample) in samples.iter().enumerate() {
                for (name, series) in names.iter().zip([&run.q, &run.v, &run.theta, &run.theta_dot]) {
                    close(
                        &format!("{} {name} {method:?} {monitors}", case["id"]),
                        &series[2 * k..2 * k + 2],
                        &numbers(&sample[*name]),
                        tolerance,
                    );
                }
                // An error of the state changes the torque by up to B/B0 K_J = 40 000 times this error.
                close("tau", &run.tau[2 * k..2 * k + 2], &numbers(&sample["tau"]), 4e4 * tolerance);
            }
            if method == Method::Rk4 && !monitors {
                let first = problem.x0.clone();
                problem.x0 = first.repeat(11);
                let batch = simulate_batch(problem.clone(), Keep::All, 2, &mut || false).unwrap();
                let width = 2 * times.len();
                for row in 0..11 {
                    close("batch", &batch.q[row * width..(row + 1) * width], &run.q, 1e-12);
                    close("batch tau", &batch.tau[row * width..(row + 1) * width], &run.tau, 1e-9);
                }
            }
        }
    }
}

#[test]
fn equilibria() {
    let file = vectors(FILE);
    for case in cases(&file, "equilibrium").into_iter().chain(cases(&file, "spurious_equilibrium")) {
        let (input, expected) = (&case["input"], &case["expected"]);
        let (plant, law) = loop_of(input);
        let f = if input["F"].is_null() { vec![0.0; 2] } else { numbers(&input["F"]) };
        let frame = law.coordinates().map(|c| c.frame);
        let rest = equilibrium(&plant, &law, &[f[0], f[1], 0.0, 0.0, 0.0, 0.0], frame, &numbers(&input["q0"])).unwrap();
        let rel = case["tolerance"]["rel"].as_f64().unwrap();
        for (name, got) in [("q_E", &rest.q), ("theta_E", &rest.theta), ("tau_E", &rest.tau), ("x_E", &rest.x)] {
            let want = numbers(&expected[name]);
            close(name, got, &want, rel * want.iter().fold(0.0f64, |most, x| most.max(x.abs())));
        }
        let rightmost = rest.eigenvalues.last().unwrap().0;
        let want = expected["max_real_eig"].as_f64().unwrap();
        assert!((rightmost - want).abs() <= case["tolerance"]["eig_rel"].as_f64().unwrap() * want.abs(), "{rightmost} {want}");
        let (spurious, boundary) = (case["kind"] == "spurious_equilibrium", expected["kind"] == "boundary");
        assert_eq!((rest.spurious, rest.reachable, rest.stable), (spurious || boundary, !boundary, !spurious), "{}", case["id"]);
    }
}

#[test]
fn limits() {
    let file = vectors(FILE);
    let entries = |name: &str| file["analysis"][name].as_array().unwrap().clone();
    for entry in entries("zoh_limit") {
        let get = |key: &str| entry[key].as_f64().unwrap();
        let got = smallest_reduced_inertia(get("B"), get("K_J"), get("dt"), f64::INFINITY, 1.0).unwrap();
        // The error of the root is the rounding error of the eigenvalues, divided by the slope of the spectral radius.
        assert!((got / get("B0_min") - 1.0).abs() < 1e-7, "{entry}: {got}");
    }
    for entry in entries("routh_1dof") {
        let get = |key: &str| entry[key].as_f64().unwrap();
        let got = stiffness_limit(get("M"), get("K_J"), get("B0"), get("d"), get("D0"));
        assert!((got / get("k_max") - 1.0).abs() < 1e-13, "{entry}: {got}");
    }
    let input = &cases(&file, "trajectory")[0]["input"];
    for entry in entries("km_scaling_limit") {
        // A law requires positive definite damping. So zero damping is replaced by the fraction 1e-9.
        for (name, share) in [("Dm_x1", 1.0), ("Dm_x02", 0.2), ("Dm_0", 1e-9)] {
            let (plant, law) = scaled(input, [entry["B0_over_B"].as_f64().unwrap(), share]);
            let frame = law.coordinates().map(|c| c.frame);
            let got = stiffness_scale(&plant, &law, &[0.0; 6], frame, &numbers(&input["q0"])).unwrap();
            let want = entry["kappa_max"][name].as_f64().unwrap();
            assert!((got / want - 1.0).abs() < 1e-6, "{entry} {name}: {got}");
        }
    }
}
