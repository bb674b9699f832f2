//! Tests of adaptive control of chains against trajectories computed with mpmath, as single runs and in lanes.

use crate::arm_common::{chain, numbers, vectors};
use armlet_core::dynamics::Model;
use armlet_core::law::{Adaptation, AdaptiveSpec, Gain, LawSpec};
use armlet_core::motion::{Motion, Sinusoid};
use armlet_core::plant::{PlantSpec, RigidSpec};
use armlet_core::simulate::{DEFAULT_STATE_LIMIT, Keep, Method, Options, Problem, Times, simulate, simulate_batch};
use armlet_core::status::Status;
use serde_json::Value;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

fn law(input: &Value, model: &Model) -> LawSpec {
    let joints = input["reference"].as_array().unwrap();
    let offset = joints.iter().map(|j| numbers(&j["offset"])[0]).collect();
    let terms: Vec<f64> = joints.iter().flat_map(|j| numbers(&j["terms"])).collect();
    let column = |k: usize| terms.chunks(3).map(|term| term[k]).collect::<Vec<f64>>();
    let motion = Sinusoid::new(offset, terms.len() / 3 / joints.len(), column(0), column(1), column(2)).unwrap();
    let (kd, lambda, per_link) = (numbers(&input["K_D"]), numbers(&input["Lambda"]), numbers(&input["Gamma_per_link"]));
    let kp = kd.iter().zip(&lambda).map(|(d, l)| d * l).collect();
    let gamma = per_link.iter().copied().cycle().take(per_link.len() * kd.len()).collect();
    let diagonal = |name: &str, values: Vec<f64>| Gain::diagonal(name, values).unwrap();
    let estimate = Some(numbers(&input["ahat0"])).filter(|a| !a.is_empty());
    let (kp, kd, gamma) = (diagonal("kp", kp), diagonal("kd", kd), diagonal("gamma", gamma));
    LawSpec::Adaptive(
        AdaptiveSpec::new(model.clone(), Motion::Sinusoid(motion), kp, kd, Adaptation::Euclidean(gamma), None, estimate).unwrap(),
    )
}

#[test]
fn trajectories() {
    let file = vectors("oracle_g_adaptive_ndof_public.json");
    for case in file["cases"].as_array().unwrap() {
        let (input, tolerance) = (&case["input"], case["tolerance"]["abs"].as_f64().unwrap());
        let model = Model::Tree(Arc::new(chain(&input["chain"])));
        let (plant, law) = (PlantSpec::Rigid(RigidSpec::new(model.clone())), law(input, &model));
        let (n, times) = (model.n(), numbers(&input["times"]));
        let options = Options {
            t_end: *times.last().unwrap(),
            dt: Some(2.5e-4),
            method: Method::Rk4,
            rtol: 1e-11,
            atol: 1e-12,
            max_step: None,
            sampling: None,
            times: Times::At(times.clone()),
            tau_max: None,
            monitors: true,
            state_limit: DEFAULT_STATE_LIMIT,
        };
        let x0 = plant.initial_state(&numbers(&input["q0"]), &numbers(&input["qd0"]), None, None);
        let mut problem =
            Problem { plants: vec![&plant], laws: vec![&law], x0, forces: Vec::new(), force_frame: None, options, measures: None };
        // The errors of RK4 with steps of 0.25 ms, and of the method of order 8, are below the tolerance of the vectors.
        let lanes = simulate_batch(problem.clone(), Keep::All, 1, &mut || false).unwrap();
        let single = simulate(&problem, &AtomicBool::new(false)).unwrap();
        problem.options.method = Method::Dop853;
        let fine = simulate(&problem, &AtomicBool::new(false)).unwrap();
        assert_eq!((single.status, fine.status, lanes.status[0]), (Status::Success, Status::Success, Status::Success));
        for (k, sample) in case["expected"]["samples"].as_array().unwrap().iter().enumerate() {
            let check = |name: &str, got: &[f64], tolerance: f64| {
                for (g, w) in got.iter().zip(numbers(&sample[name])) {
                    assert!((g - w).abs() <= tolerance, "{} {name} at sample {k}: {g} {w}", case["id"]);
                }
            };
            for (q, z, tolerance) in [(&lanes.q, &lanes.z, tolerance), (&single.q, &single.z, tolerance), (&fine.q, &fine.z, 1e-11)] {
                check("q", &q[n * k..n * (k + 1)], tolerance);
                check("a_hat", &z[10 * n * k..10 * n * (k + 1)], tolerance);
            }
        }
    }
}
