//! The fastest motion of a URDF arm through waypoints, under its torque and speed limits. Inverse dynamics then gives the torques along
//! this motion. `cargo run --release --example time_optimal_path`.

use armlet_core::arm::{Arm, STANDARD_GRAVITY, example_urdf};
use armlet_core::dynamics::{Evaluator, Functions, Model};
use armlet_core::error::Result;
use armlet_core::motion::{Ends, Motion, Path};
use armlet_core::plan::{Mover, PathLimits, TimePathOptions, time_path};
use nalgebra::DMatrix;
use std::sync::Arc;

pub fn main() -> Result<()> {
    let arm = Arm::from_urdf(example_urdf("planar_2r")?, "planar_2r", STANDARD_GRAVITY, None, None)?;
    let n = arm.n();
    // Each column is a waypoint.
    let waypoints = DMatrix::from_column_slice(n, 4, &[0.0, 0.5, 0.6, 0.2, 0.9, -0.6, 0.3, -0.9]);
    let (path, _) = Path::waypoints(waypoints.as_slice(), n, None, Ends::Natural)?;
    let torques: Vec<f64> = arm.joints.iter().map(|joint| joint.limits.effort).collect();
    let limits = PathLimits {
        torque: Some((torques.iter().map(|tau| -tau).collect(), torques.clone())),
        velocity: Some(arm.joints.iter().map(|joint| joint.limits.velocity).collect()),
        ..PathLimits::default()
    };
    let functions = Functions::new(Arc::new(arm.clone()));
    let plan = time_path(Mover::Tree(&functions), Arc::new(path), &limits, &TimePathOptions::default())?;
    if let Some(reason) = &plan.reason {
        println!("no timing: {reason}");
        return Ok(());
    }
    let duration = plan.motion.duration();
    println!("{duration:.4} s; the closest limit is {:.1e} of itself away", plan.margin);

    let (model, motion, mut evaluator) = (Model::from(arm.clone()), Motion::from(plan.motion), Evaluator::new(&arm));
    let mut used = vec![0.0f64; n];
    for k in 0..=200 {
        let now = motion.at(duration * f64::from(k) / 200.0);
        let tau = evaluator.inverse_dynamics(&now.q, &now.v, &now.a)?;
        used.iter_mut().zip(tau.iter().zip(&torques)).for_each(|(used, (tau, limit))| *used = used.max((tau / limit).abs()));
    }
    println!("largest torques, in parts of their limits: {used:.4?} ({} joints)", model.n());
    // The planner exceeds limits by at most the fraction 1e-9. The fastest motion reaches one of the limits, perhaps between two of these
    // samples.
    assert!(used.iter().all(|used| *used < 1.001) && used.iter().any(|used| *used > 0.9), "{used:?}");
    Ok(())
}
