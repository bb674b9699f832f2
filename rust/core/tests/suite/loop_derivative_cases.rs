//! Closed loops with a law of every kind that has derivatives, and with every part of a plant.

use armlet_core::arm::{Arm, STANDARD_GRAVITY, example_urdf};
use armlet_core::dynamics::Model;
use armlet_core::kinematics::Coordinates;
use armlet_core::law::{
    Adaptation, AdaptiveSpec, CartesianImpedanceSpec, ComputedTorqueSpec, ElasticImpedanceSpec, Gain, JointColumn, JointColumns,
    JointImpedanceSpec, JointTrackingSpec, LawSpec, LeakageForm, MotorPdSpec, PdGravitySpec, PidOptions, PidSpec, Projection,
    ReductionSpec, StateFeedbackSpec,
};
use armlet_core::motion::{Motion, Sinusoid};
use armlet_core::plant::{ElasticSpec, FrictionCurve, JointFriction, LuGre, PlantSpec, RigidSpec, Stops, Wall};
use armlet_core::simulate::Force;
use armlet_core::spatial::{Matrix, Vector, rotation_exp, rotation_log};
use nalgebra::DVector;
use std::sync::Arc;

pub const N: usize = 6;
const FRAME: &str = "flange";

pub fn six_axis() -> Model {
    Model::Tree(Arc::new(Arm::from_urdf(example_urdf("six_axis").unwrap(), "six_axis", STANDARD_GRAVITY, None, None).unwrap()))
}

/// Return reproducible numbers that are spread over a range.
pub fn numbers(n: usize, offset: f64, scale: f64) -> Vec<f64> {
    (0..n).map(|i| offset + scale * (1.0 + 2.3 * i as f64).sin()).collect()
}

pub fn gain(n: usize, scale: f64) -> Gain {
    Gain::diagonal("gain", (0..n).map(|i| scale * (1.0 + 0.1 * i as f64)).collect()).unwrap()
}

/// Return a gain that is not diagonal.
pub fn full(n: usize, scale: f64) -> Gain {
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
    let (e, _) = model.at(q).error_and_jacobian(&coordinates, &DVector::zeros(N));
    let vector = rotation_log(&rotation_exp(turn).times(rotation_exp([-e[3], -e[4], -e[5]])));
    [[-e[0], -e[1], -e[2]], vector.array()].concat()
}

pub struct Case {
    pub name: String,
    pub plant: PlantSpec,
    pub law: LawSpec,
    pub force: Option<Force>,
    pub tau_max: Option<Vec<f64>>,
    /// The law's state at which derivatives are computed. `None` selects its initial state.
    pub estimate: Option<Vec<f64>>,
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
pub fn cases(at: &[f64]) -> Vec<Case> {
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
    let moving_pd = PdGravitySpec::following(model.clone(), moving(q_d.clone()), full(N, 100.0), gain(N, 20.0)).unwrap();
    for (outer, what) in [(pd, "held"), (moving_pd, "moving")] {
        let joint = JointImpedanceSpec { outer, inner: reduction(true) };
        all.push(case(&format!("JointImpedance, {what}"), PlantSpec::Elastic(elastic()), LawSpec::JointImpedance(joint)));
    }
    let tracking =
        JointTrackingSpec::new(model.clone(), moving(q_d.clone()), [full(N, 500.0), gain(N, 20.0)], spring(), gain(N, 0.5)).unwrap();
    all.push(case("JointTracking", PlantSpec::Elastic(elastic()), LawSpec::JointTracking(tracking)));
    for online in [false, true] {
        let motors = |target| MotorPdSpec::new(model.clone(), target, full(N, 500.0), gain(N, 20.0), spring(), online).unwrap();
        let law = motors(Motion::Hold(q_d.clone()));
        // This plant has friction that does not depend on the load. With load-dependent friction, differences could change the sign of the
        // spring torque, whose magnitude has no derivative at zero.
        let rubbing = elastic().with_friction(lugre(None)).unwrap();
        all.push(case(&format!("MotorPD, LuGre friction, {online}"), PlantSpec::Elastic(rubbing), LawSpec::MotorPd(law.clone())));
        all.push(case(&format!("MotorPD, {online}"), PlantSpec::Elastic(elastic()), LawSpec::MotorPd(law)));
        let law = LawSpec::MotorPd(motors(moving(q_d.clone())));
        all.push(case(&format!("MotorPD, moving, {online}"), PlantSpec::Elastic(elastic()), law));
    }
    let gains = [full(N, 500.0), gain(N, 20.0), gain(N, 2.0), gain(N, 0.01)];
    for (target, what) in [(Motion::Hold(q_d.clone()), "held"), (moving(q_d.clone()), "moving")] {
        let law = StateFeedbackSpec::new(model.clone(), target, gains.clone(), spring()).unwrap();
        all.push(case(&format!("StateFeedback, {what}"), PlantSpec::Elastic(elastic()), LawSpec::StateFeedback(law)));
    }
    all
}
