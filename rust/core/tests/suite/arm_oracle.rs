//! Tests of the chains in `oracle_g_regressor_public.json`, computed with mpmath.

use crate::arm_common::{chain, lift, numbers, sin_cos, vectors};
use armlet_core::arm::Tree;
use armlet_core::dynamics::{Dynamics, Workspace};
use armlet_core::scalar::{GenericKernel, Real};
use serde_json::Value;

#[derive(Clone, Copy)]
struct Case<'a>(&'a Value);

impl GenericKernel for Case<'_> {
    type Output = ();
    fn run<S: Real>(self) {
        let (input, expected) = (&self.0["input"], &self.0["expected"]);
        let arm = chain(&input["chain"]);
        let tree = Tree::<S>::new(&arm);
        let mut ws = Workspace::new(&tree);
        let get = |key: &str| lift::<S>(&numbers(&input[key]));
        let (q, v, vr, ar) = (get("q"), get("qd"), get("qd_r"), get("qdd_r"));
        let trig = sin_cos(&q);
        let n = q.len();
        let check = |key: &str, got: &[S]| {
            let (abs, rel) = (self.0["tolerance"]["abs"].as_f64().unwrap(), self.0["tolerance"]["rel"].as_f64().unwrap());
            let want = numbers(&expected[key]);
            assert_eq!(got.len(), want.len(), "{} {key}", self.0["id"]);
            for (k, (g, w)) in got.iter().zip(&want).enumerate() {
                let g = g.lane(0);
                assert!((g - w).abs() <= abs + rel * w.abs(), "{} {key}[{k}]: {g} {w}", self.0["id"]);
            }
        };
        let (mut square, mut vector) = (vec![S::zero(); n * n], vec![S::zero(); n]);
        tree.mass_matrix(&mut ws, &trig, &q, &mut square);
        check("M", &square);
        let m = square.clone();
        tree.coriolis_matrix(&mut ws, &trig, &q, &v, &mut square);
        check("C", &square);
        let m_dot: Vec<S> = (0..n * n).map(|k| square[k] + square[(k % n) * n + k / n]).collect();
        check("Mdot", &m_dot);
        tree.gravity(&mut ws, &trig, &q, &mut vector);
        check("g", &vector);
        let g = vector.clone();
        let mut y = vec![S::zero(); n * 10 * n];
        tree.regressor(&mut ws, &trig, &q, [&v, &vr, &ar], &mut y);
        check("Y", &y);
        let pi = lift::<S>(&arm.parameters());
        let (mut y_pi, mut yt_s) = (vec![S::zero(); n], vec![S::zero(); 10 * n]);
        tree.regressor_products(&mut ws, &trig, &q, [&v, &vr, &ar], (&pi, &mut y_pi), (&v, &mut yt_s));
        check("tau", &y_pi);
        for k in 0..n {
            vector[k] = g[k];
            for i in 0..n {
                vector[k] += m[k * n + i] * ar[i] + square[k * n + i] * vr[i];
            }
        }
        check("tau", &vector);
    }
}

#[test]
fn regressor_oracle() {
    let file = vectors("oracle_g_regressor_public.json");
    let cases = file["cases"].as_array().unwrap();
    assert_eq!(cases.len() as u64, file["n_cases"].as_u64().unwrap());
    for case in cases {
        Case(case).run::<f64>();
    }
}
