//! Computed torque control of a URDF arm, first without a payload, then with a payload that the controller does not know:
//! `cargo run --release --example computed_torque`.

use armlet_core::arm::{Arm, STANDARD_GRAVITY, example_urdf};
use armlet_core::dynamics::Model;
use armlet_core::error::Result;
use armlet_core::law::{ComputedTorqueSpec, Gain, LawSpec};
use armlet_core::motion::{Motion, Quintic};
use armlet_core::plant::{PlantSpec, RigidSpec};
use armlet_core::simulate::{Options, Problem};
use nalgebra::DVector;

pub fn main() -> Result<()> {
    let arm = Arm::from_urdf(example_urdf("six_axis")?, "six_axis", STANDARD_GRAVITY, None, None)?;
    let (n, known) = (arm.n(), Model::from(arm.clone()));
    let (q0, q1) = (DVector::zeros(n), DVector::from_fn(n, |i, _| if i % 2 == 0 { 0.8 } else { -0.5 }));
    let motion = Motion::from(Quintic::new(q0.clone(), q1.clone(), 1.5)?);
    let gains = (Gain::scalar("kp", n, 400.0)?, Gain::scalar("kd", n, 40.0)?);
    let law = LawSpec::from(ComputedTorqueSpec::new(known.clone(), motion, gains.0, gains.1)?);
    let frame = arm.frames[arm.tip_frame().unwrap_or(0)].name.clone();
    let loaded = Model::from(arm.with_payload(&frame, 1.0, [0.0, 0.0, 0.05], [[0.0; 3]; 3])?);
    for (name, model) in [("known arm", known), ("unknown payload of 1 kg", loaded)] {
        let plant = PlantSpec::from(RigidSpec::new(model));
        let run = Problem::from_rest(&plant, &law, &q0, Options::fixed(3.0, 1e-3))?.run()?;
        let error = (run.positions().column(run.t.len() - 1) - &q1).amax();
        let missing = run.monitor("energy_balance").unwrap_or_default().iter().fold(0.0f64, |most, x| most.max(x.abs()));
        println!("{name}: final error {error:.1e} rad, open energy balance {missing:.1e} J, {} steps", run.steps);
        // The law has no integral term, so a payload that its model does not contain leaves a final error. This error is the acceleration
        // due to the weight of the payload, divided by the gain of 400 1/s^2.
        assert!(if name == "known arm" { error < 1e-9 } else { (1e-4..0.2).contains(&error) }, "{name}: {error}");
    }
    Ok(())
}
