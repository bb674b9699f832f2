//! Common parts of the planner tests: the oracle file, a random generator with a seed, and the strata of random problems.

use serde_json::Value;

pub const ORACLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/vectors/oracle_ex4_bangbang_public.json");

pub fn oracle() -> Value {
    serde_json::from_str(&std::fs::read_to_string(ORACLE).expect("oracle file")).expect("oracle is JSON")
}

pub fn cases() -> Vec<Value> {
    oracle()["cases"].as_array().expect("cases").clone()
}

/// Evaluate a product of numbers and `pi`, such as `-pi/2`, `9.81*0.3*2*pi/pi` or `inf`.
pub fn expression(text: &str) -> f64 {
    let (sign, text) = text.strip_prefix('-').map_or((1.0, text), |rest| (-1.0, rest));
    let mut value = 1.0;
    let mut divide = false;
    for part in text.split_inclusive(['*', '/']) {
        let word = part.trim_end_matches(['*', '/']);
        let x = if word == "pi" { std::f64::consts::PI } else { word.parse::<f64>().expect("a number or pi") };
        value = if divide { value / x } else { value * x };
        divide = part.ends_with('/');
    }
    sign * value
}

/// Return a number, or the value of a text for `expression`.
pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| expression(value.as_str().expect("a number")))
}

pub fn near(x: f64, y: f64, relative: f64) -> bool {
    x == y || (x - y).abs() <= relative * y.abs()
}

/// Return the number of random problems: 20,000, or ARMLET_RANDOM_PLANS.
pub fn random_count() -> usize {
    std::env::var("ARMLET_RANDOM_PLANS").ok().and_then(|n| n.parse().ok()).unwrap_or(20_000)
}

/// A random generator with a seed (xorshift64*).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }
    pub fn unit(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1u64 << 53) as f64
    }
    pub fn range(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.unit()
    }
    pub fn log(&mut self, a: f64, b: f64) -> f64 {
        self.range(a.ln(), b.ln()).exp()
    }
    pub fn sign(&mut self) -> f64 {
        if self.unit() < 0.5 { -1.0 } else { 1.0 }
    }
}

#[derive(Debug, Clone, Copy)]
pub struct Problem {
    pub theta0: f64,
    pub thetaf: f64,
    pub inertia: f64,
    pub gravity: f64,
    pub tau_min: f64,
    pub tau_max: f64,
}

impl Problem {
    pub fn of_case(case: &Value) -> Self {
        let input = |name: &str| expression(case["input"][name].as_str().expect("input"));
        let tau_max = input("tau_max");
        Problem { theta0: input("theta0"), thetaf: input("thetaf"), inertia: input("I"), gravity: input("G"), tau_min: -tau_max, tau_max }
    }

    pub fn nominal(r: &mut Random) -> Self {
        let (theta0, tau_max) = (r.range(-7.0, 7.0), r.range(0.2, 3.0));
        let thetaf = theta0 + r.range(-5.0, 5.0);
        let tau_min = if r.unit() < 0.5 { -tau_max } else { -r.range(0.0, 3.0) };
        Problem { theta0, thetaf, inertia: r.log(0.1, 10.0), gravity: r.range(-0.5, 2.0), tau_min, tau_max }
    }

    /// Return problem `k`. The strata alternate: nominal; end angles within 1e-16..1e-6 rad of the start or of zero; torques scaled by
    /// 1e-3..1e8; angles at multiples of pi/2.
    pub fn stratum(r: &mut Random, k: usize) -> Self {
        let mut p = Problem::nominal(r);
        match k % 4 {
            1 => p.thetaf = p.theta0 * r.range(0.0, 1.0).round() + r.sign() * r.log(1e-16, 1e-6),
            2 => {
                let scale = r.log(1e-3, 1e8);
                (p.tau_max, p.tau_min, p.gravity) = (p.tau_max * scale, p.tau_min * scale, p.gravity * scale * r.log(1e-3, 10.0));
                p.inertia *= r.log(1e-3, 1e3);
            }
            3 => {
                let quarter = std::f64::consts::FRAC_PI_2;
                p.theta0 = quarter * r.range(-4.0, 4.0).round();
                p.thetaf = quarter * r.range(-4.0, 4.0).round();
                p.gravity = p.tau_max * r.range(0.0, 8.0).round() / 4.0;
                p.tau_min = -p.tau_max;
            }
            _ => {}
        }
        p
    }
}
