//! Common parts of the arm tests: seeded random trees, and chains from the vectors.

use armlet_core::arm::{Arm, ChainJoint, JointKind, JointType};
use armlet_core::scalar::Real;
use serde_json::Value;

pub fn lift<S: Real>(x: &[f64]) -> Vec<S> {
    x.iter().map(|&x| S::splat(x)).collect()
}

pub fn sin_cos<S: Real>(q: &[S]) -> Vec<(S, S)> {
    q.iter().map(|q| q.sin_cos()).collect()
}

pub fn vectors(file: &str) -> Value {
    let path = format!("{}/../../tests/vectors/{file}", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap()
}

/// Return all numbers of nested arrays in one list. The arrays contain numbers or decimal strings.
pub fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        Value::String(text) => vec![text.parse().unwrap()],
        other => vec![other.as_f64().unwrap()],
    }
}

pub fn array<const N: usize>(value: &Value) -> [f64; N] {
    numbers(value).try_into().unwrap()
}

pub fn chain(value: &Value) -> Arm {
    let joint = |j: &Value| {
        let kind = JointType::parse(j["type"].as_str().unwrap()).unwrap();
        ChainJoint::new(kind, array(&j["axis"]), array(&j["rpy"]), array(&j["xyz"]), array(&j["phi"]))
    };
    let joints: Vec<ChainJoint> = value["joints"].as_array().unwrap().iter().map(joint).collect();
    Arm::from_chain(&joints, array(&value["gravity"])).unwrap()
}

/// A random generator with a seed (splitmix64). Its numbers are the same on every machine.
#[derive(Clone, Copy)]
pub struct Rng(pub u64);
impl Rng {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    /// Return a number that is uniform in `[-1, 1)`.
    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
    pub fn vector(&mut self, n: usize, scale: f64) -> Vec<f64> {
        (0..n).map(|_| scale * self.unit()).collect()
    }
    pub fn array3(&mut self, scale: f64) -> [f64; 3] {
        [scale * self.unit(), scale * self.unit(), scale * self.unit()]
    }
}

/// Return the inertial parameters of a physical body: a core with five random point masses.
pub fn body(rng: &mut Rng) -> [f64; 10] {
    let mut phi = [0.0; 10];
    for k in 0..6 {
        let m = 0.2 + 0.2 * rng.unit().abs();
        let [x, y, z] = if k == 0 { [0.0; 3] } else { rng.array3(0.3) };
        let add =
            [m, m * x, m * y, m * z, m * (y * y + z * z), -m * x * y, m * (x * x + z * z), -m * x * z, -m * y * z, m * (x * x + y * y)];
        for (sum, term) in phi.iter_mut().zip(add) {
            *sum += term;
        }
    }
    phi
}

/// Return a random tree with `n` moving joints. It has branches, prismatic joints, fixed bodies and rotors. Axes and placements are along
/// the coordinate axes or oblique.
pub fn random_tree(rng: &mut Rng, n: usize) -> Arm {
    let mut list: Vec<ChainJoint> = Vec::new();
    let mut moving = 0;
    while moving < n {
        let fixed = !list.is_empty() && rng.below(6) == 0;
        let kind = match rng.below(4) {
            _ if fixed => JointType::Fixed,
            0 => JointType::Moving(JointKind::Prismatic),
            1 => JointType::Moving(JointKind::Continuous),
            _ => JointType::Moving(JointKind::Revolute),
        };
        moving += usize::from(!fixed);
        let axis = match rng.below(5) {
            0 => [0.0, 0.0, 1.0],
            1 => [0.0, 1.0, 0.0],
            2 => [-1.0, 0.0, 0.0],
            _ => rng.array3(1.0),
        };
        let rpy = match rng.below(4) {
            0 => [0.0; 3],
            1 => std::array::from_fn(|_| rng.below(4) as f64 * std::f64::consts::FRAC_PI_2),
            _ => rng.array3(2.0),
        };
        let mut joint = ChainJoint::new(kind, axis, rpy, rng.array3(0.4), body(rng));
        // Most joints continue a chain, some begin a branch, and few begin a second tree on the base.
        joint.parent = match rng.below(8) {
            0 if !list.is_empty() => Some(Some(rng.below(list.len()))),
            1 if list.len() > 2 && rng.below(3) == 0 => Some(None),
            _ => None,
        };
        (joint.armature, joint.damping, joint.friction) = (0.1 * rng.unit().abs(), 0.3 * rng.unit().abs(), 0.2 * rng.unit().abs());
        list.push(joint);
    }
    Arm::from_chain(&list, [0.4, -0.3, -9.81]).unwrap()
}

pub fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m, x| m.max(x.abs()))
}

/// Fail if an entry of `got` differs from `want` by more than `tolerance`, relative to the largest entry of `want` or to `floor`. The
/// larger of the two is used.
#[track_caller]
pub fn close(what: &str, got: &[f64], want: &[f64], tolerance: f64, floor: f64) {
    assert_eq!(got.len(), want.len(), "{what}");
    let scale = largest(want).max(floor);
    for (i, (g, w)) in got.iter().zip(want).enumerate() {
        assert!((g - w).abs() <= tolerance * scale, "{what}[{i}]: got {g}, expected {w}, off by {:e} of {scale}", (g - w).abs() / scale);
    }
}
