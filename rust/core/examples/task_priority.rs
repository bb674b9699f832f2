//! Task priorities on a URDF arm: the first task is the position of the tip, the second a posture of the joints.
//! `cargo run --release --example task_priority`.

use armlet_core::arm::{Arm, STANDARD_GRAVITY, example_urdf};
use armlet_core::dynamics::{Evaluator, Model};
use armlet_core::error::Result;
use armlet_core::kinematics::TaskFunction;
use armlet_core::law::{ArmSolver, Gain, LawSpec, Level, LimitOverrides, PriorityVelocitySpec};
use armlet_core::motion::Motion;
use armlet_core::plant::{PlantSpec, VelocitySpec};
use armlet_core::priority::PriorityOptions;
use armlet_core::simulate::{Options, Problem};
use nalgebra::{DVector, dvector};

pub fn main() -> Result<()> {
    let arm = Arm::from_urdf(example_urdf("seven_axis")?, "seven_axis", STANDARD_GRAVITY, None, None)?;
    let (n, tip) = (arm.n(), arm.tip_frame().unwrap_or(0));
    let name = arm.frames[tip].name.clone();
    let q0 = DVector::from_fn(n, |i, _| if i % 2 == 0 { 0.3 } else { 0.7 });
    let mut evaluator = Evaluator::new(&arm);
    let start = evaluator.pose(&q0, tip)?.translation.vector;
    let target = dvector![start.x - 0.1, start.y + 0.05, start.z + 0.1];
    let (position, posture) = (TaskFunction::frame(&arm, &name, "xyz")?, TaskFunction::posture(&arm, None)?);

    // Diagnose the directions that can be commanded in this posture.
    let options = PriorityOptions::default();
    let diagnosis = ArmSolver::new(&arm, vec![position.clone(), posture.clone()], &options)?.diagnose(q0.as_slice(), None)?;
    println!("ranks {:?}, in the freedom left {:?}", diagnosis.ranks(), diagnosis.projected_ranks());
    assert_eq!(diagnosis.projected_ranks(), [3, n - 3]);

    let levels = vec![
        Level::new(position, Motion::hold(target.clone())?, Gain::scalar("gain", 3, 5.0)?, None)?,
        Level::new(posture, Motion::hold(q0.clone())?, Gain::scalar("gain", n, 1.0)?, None)?,
    ];
    let model = Model::from(arm);
    let law = LawSpec::from(PriorityVelocitySpec::new(model.clone(), levels, options, &LimitOverrides::default())?);
    let plant = PlantSpec::from(VelocitySpec { model });
    let run = Problem::from_rest(&plant, &law, &q0, Options::fixed(4.0, 1e-2))?.run()?;
    let reached = evaluator.pose(&run.positions().column(run.t.len() - 1).into_owned(), tip)?.translation.vector;
    let error = (DVector::from_column_slice(reached.as_slice()) - target).norm();
    println!("{:?}: the tip is {error:.1e} m from its target", run.status);
    // The posture does not disturb the tip, whose error decays with exp(-5 t).
    assert!(error < 1e-8, "{error}");
    Ok(())
}
