//! Tests of the planar PR arm under adaptive control against vectors with 25 digits, and of its loops against each other.

use armlet_core::dynamics::{Dynamics, Model, PlanarPr};
use armlet_core::law::{Adaptation, AdaptiveSpec, Gain, LawSpec};
use armlet_core::motion::{Motion, Quintic, Sinusoid};
use armlet_core::plant::{PlantSpec, RigidSpec};
use armlet_core::simulate::{DEFAULT_STATE_LIMIT, Keep, Method, Options, Problem, Sampling, Times, simulate, simulate_batch};
use armlet_core::status::Status;
use serde_json::Value;
use std::sync::atomic::AtomicBool;

fn vectors() -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/vectors/oracle_ex1_adaptive_public.json");
    serde_json::from_str(&std::fs::read_to_string(path).expect("vectors are in the repository")).expect("vectors are JSON")
}

/// Return all numbers of nested arrays in one list. The arrays contain numbers or decimal strings.
fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        Value::String(text) => vec![text.parse().expect("a decimal")],
        other => vec![other.as_f64().expect("a number")],
    }
}

fn cases(kind: &str) -> Vec<Value> {
    let all = vectors();
    let chosen: Vec<Value> = all["cases"].as_array().expect("cases").iter().filter(|c| c["kind"] == kind).cloned().collect();
    assert!(!chosen.is_empty());
    chosen
}

fn assert_close(got: &[f64], want: &[f64], tolerance: f64, what: &str) {
    assert_eq!(got.len(), want.len(), "{what}");
    for (g, w) in got.iter().zip(want) {
        assert!((g - w).abs() <= tolerance * (1.0 + w.abs()), "{what}: {got:?} {want:?}");
    }
}

fn motion(reference: &Value) -> Motion {
    if reference["type"] == "quintic" {
        let duration = numbers(&reference["T"])[0];
        return Motion::Quintic(Quintic::new(numbers(&reference["q0"]), numbers(&reference["q1"]), duration).unwrap());
    }
    let joints = reference["joints"].as_array().unwrap();
    let offset = joints.iter().map(|j| numbers(&j["offset"])[0]).collect();
    let terms: Vec<f64> = joints.iter().flat_map(|j| numbers(&j["terms"])).collect();
    let column = |k: usize| terms.chunks(3).map(|term| term[k]).collect::<Vec<f64>>();
    let per_joint = terms.len() / 3 / joints.len();
    Motion::Sinusoid(Sinusoid::new(offset, per_joint, column(0), column(1), column(2)).unwrap())
}

struct Case {
    plant: PlantSpec,
    law: LawSpec,
    q0: Vec<f64>,
    v0: Vec<f64>,
    times: Vec<f64>,
}

impl Case {
    fn from(input: &Value) -> Self {
        let p = &input["plant"];
        let model = Model::PlanarPr(PlanarPr::new(numbers(&p["A"])[0], numbers(&p["B"])[0], numbers(&p["C"])[0]).unwrap());
        let gain = |name: &str, key: &str, n: usize| Gain::full(name, n, numbers(&input[key])).unwrap();
        let law = AdaptiveSpec::new(
            model.clone(),
            motion(&input["reference"]),
            gain("kp", "K_P", 2),
            gain("kd", "K_D", 2),
            Adaptation::Euclidean(gain("gamma", "Gamma", 3)),
            None,
            Some(numbers(&input["ahat0"])),
        );
        let law = LawSpec::Adaptive(law.unwrap());
        let plant = PlantSpec::Rigid(RigidSpec::new(model));
        Case { plant, law, q0: numbers(&input["q0"]), v0: numbers(&input["qd0"]), times: numbers(&input["times"]) }
    }

    fn problem(&self, method: Method, dt: Option<f64>, times: Times) -> Problem<'_> {
        let options = Options {
            t_end: *self.times.last().unwrap(),
            dt,
            method,
            rtol: 1e-12,
            atol: 1e-12,
            max_step: None,
            sampling: None,
            times,
            tau_max: None,
            monitors: true,
            state_limit: DEFAULT_STATE_LIMIT,
        };
        let x0 = self.plant.initial_state(&self.q0, &self.v0, None, None);
        Problem { plants: vec![&self.plant], laws: vec![&self.law], x0, forces: Vec::new(), force_frame: None, options, measures: None }
    }
}

#[test]
fn static_vectors() {
    for case in cases("static") {
        let (input, expected, tol) = (&case["input"], &case["expected"], 1e-13);
        let [a, b, c] = ["A", "B", "C"].map(|k| input[k].as_f64().unwrap());
        let arm = PlanarPr::new(a, b, c).unwrap();
        let [q, v, v_r, a_r] = ["q", "qd", "qd_r", "qdd_r"].map(|k| numbers(&input[k]));
        let trig: Vec<(f64, f64)> = q.iter().map(|&q| armlet_core::scalar::Real::sin_cos(q)).collect();
        let (mut m, mut s, mut y) = ([0.0; 4], [0.0; 4], [0.0; 6]);
        arm.mass_matrix(&mut (), &trig, &q, &mut m);
        arm.coriolis_matrix(&mut (), &trig, &q, &v, &mut s);
        arm.regressor(&mut (), &trig, &q, [&v, &v_r, &a_r], &mut y);
        assert_close(&m, &numbers(&expected["M"]), tol, "M");
        assert_close(&s, &numbers(&expected["S"]), tol, "S");
        assert_close(&y, &numbers(&expected["Y"]), tol, "Y");
        let y_pi = [0, 1].map(|i| y[3 * i] * a + y[3 * i + 1] * b + y[3 * i + 2] * c);
        assert_close(&y_pi, &numbers(&expected["Y_a"]), tol, "Y a");
        let (mut product, mut yt_s) = ([0.0; 2], [0.0; 3]);
        arm.regressor_products(&mut (), &trig, &q, [&v, &v_r, &a_r], (&[a, b, c], &mut product), (&v, &mut yt_s));
        assert_close(&product, &y_pi, tol, "Y a without Y");
        let want = [0, 1, 2].map(|j| y[j] * v[0] + y[3 + j] * v[1]);
        assert_close(&yt_s, &want, tol, "Y' s without Y");
    }
}

#[test]
fn trajectory_vectors() {
    let stop = AtomicBool::new(false);
    for case in cases("trajectory") {
        let built = Case::from(&case["input"]);
        let tolerance = case["tolerance"]["abs"].as_f64().unwrap();
        // The error of RK4 with steps of 0.1 ms is far below the tolerance of the vectors.
        for (method, dt) in [(Method::Dop853, None), (Method::Rk4, Some(1e-4))] {
            let run = simulate(&built.problem(method, dt, Times::At(built.times.clone())), &stop).unwrap();
            assert_eq!((run.status, &run.t), (Status::Success, &built.times));
            for (k, sample) in case["expected"]["samples"].as_array().unwrap().iter().enumerate() {
                for (name, got) in [("q", &run.q), ("qd", &run.v), ("tau", &run.tau)] {
                    assert_close(&got[2 * k..2 * k + 2], &numbers(&sample[name]), tolerance, name);
                }
                assert_close(&run.z[3 * k..3 * k + 3], &numbers(&sample["a_hat"]), tolerance, "a_hat");
            }
            for (name, series) in &run.monitors {
                let worst = series.iter().fold(0.0f64, |m, x| m.max(x.abs()));
                match *name {
                    "skewness" => assert!(worst <= 1e-13, "{worst}"),
                    "lyapunov_balance" | "energy_balance" => assert!(worst <= 1e-9, "{name} {worst}"),
                    "lyapunov" => assert!(series.windows(2).all(|w| w[1] <= w[0] + 1e-14), "V1 increased: {series:?}"),
                    _ => {}
                }
            }
            let first = run.monitors.iter().find(|(name, _)| *name == "lyapunov").unwrap().1[0];
            assert_close(&[first], &numbers(&case["expected"]["samples"][0]["V1"]), 1e-8, "V1 at the first sample");
        }
    }
}

#[test]
fn batch_rows_are_runs() {
    let stop = AtomicBool::new(false);
    let built = Case::from(&cases("trajectory")[0]["input"]);
    let runs = 19;
    let mut problem = built.problem(Method::Rk4, Some(1e-3), Times::Every(500));
    problem.options.t_end = 2.0;
    let start = |i: usize| if i % 4 < 2 { 0.3 * (i as f64).sin() } else { 0.2 * (i as f64).cos() };
    problem.x0 = (0..4 * runs).map(start).collect();
    // One run diverges from its initial state. It must not affect the other lanes.
    problem.x0[4 * 7 + 2] = 1e200;
    let batch = simulate_batch(problem.clone(), Keep::All, 1, &mut || false).unwrap();
    let other = simulate_batch(problem.clone(), Keep::All, 3, &mut || false).unwrap();
    let bits = |x: &[f64]| x.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&batch.q), bits(&other.q));
    let k = batch.t.len();
    for i in 0..runs {
        let mut one = problem.clone();
        one.x0 = problem.x0[4 * i..4 * i + 4].to_vec();
        let run = simulate(&one, &stop).unwrap();
        assert_eq!(batch.status[i], run.status);
        if run.status == Status::Success {
            // The operations are equal but round differently. The loop is contracting, so that both runs remain close.
            assert_close(&batch.q[2 * k * i..2 * k * (i + 1)], &run.q, 1e-12, "q");
            assert_close(&batch.tau[2 * k * i..2 * k * (i + 1)], &run.tau, 1e-11, "tau");
            // Compute the residuals of the run's balances from their definitions.
            let row = |name: &str| &batch.monitors.iter().find(|(known, _)| *known == name).unwrap().1[k * i..k * (i + 1)];
            let most = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |most: f64, x| most.max(x.abs()));
            let (energy, balance, lyapunov) = (row("energy"), row("energy_balance"), row("lyapunov"));
            let exchanged = most(&mut energy.iter().zip(balance).map(|(e, b)| e - energy[0] - b));
            let missing = most(&mut balance.iter().copied());
            let error = missing / most(&mut energy.iter().copied()).max(exchanged);
            let lost = most(&mut row("lyapunov_balance").iter().copied()) / most(&mut lyapunov.iter().copied());
            let expected = [error, missing, most(&mut lyapunov.iter().copied()) / lyapunov[0], lost];
            assert_eq!([0, 1, 2, 3].map(|k| batch.balances[k][i]), expected);
            assert!(expected.iter().all(|x| *x > 0.0));
        } else {
            assert_eq!((i, run.status, batch.ended[i]), (7, Status::Diverged, run.ended));
            assert!(batch.q[2 * k * i + 2..2 * k * (i + 1)].iter().all(|x| x.is_nan()));
        }
    }
}

#[test]
fn sampled_control_holds_the_input() {
    let stop = AtomicBool::new(false);
    let built = Case::from(&cases("trajectory")[0]["input"]);
    let mut problem = built.problem(Method::Rk4, Some(1e-3), Times::Every(1));
    problem.options.t_end = 0.2;
    problem.options.sampling = Some(Sampling::every(0.01));
    let run = simulate(&problem, &stop).unwrap();
    for k in 0..200 {
        let held = run.tau[2 * k] == run.tau[2 * (k + 1)];
        assert_eq!(held, (k + 1) % 10 != 0, "{k}");
    }
    // The adaptive method must give the same sampled run.
    problem.options.method = Method::Dop853;
    problem.options.times = Times::At(vec![0.1, 0.2]);
    let fine = simulate(&problem, &stop).unwrap();
    // RK4 with steps of 1 ms has a local error of h^5 while the input is held. So it agrees with the method of order 8 within the
    // tolerances.
    assert_close(&fine.q[2..], &run.q[400..], 1e-9, "q");
    assert_close(&fine.tau[2..], &run.tau[400..], 1e-6, "tau");
}
