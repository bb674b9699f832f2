//! Tests of path timings with results in closed form, and of paths with a reversal.

use armlet_core::arm::Arm;
use armlet_core::dynamics::{Functions, PlanarPr};
use armlet_core::motion::{Ends, Path};
use armlet_core::plan::{Mover, PathLimits, TimePath, TimePathOptions, time_path};
use std::sync::Arc;

/// Return an arm with one revolute joint, without gravity.
fn pendulum() -> Arm {
    Arm::planar(&[0.5], None, None, None, [0.0, 0.0]).unwrap()
}

fn timed(arm: &Arm, q: &[f64], limits: PathLimits, options: TimePathOptions) -> TimePath {
    let (path, _) = Path::waypoints(q, arm.n(), None, Ends::Natural).unwrap();
    time_path(Mover::Tree(&Functions::new(Arc::new(arm.clone()))), Arc::new(path), &limits, &options).unwrap()
}

/// With constant inertia and no gravity, the motion is bang-bang with `T = 2 sqrt(I D / tau)`.
#[test]
fn straight_line() {
    let arm = PlanarPr::with_parameters([2.0, 0.5, 0.5]);
    let (path, _) = Path::waypoints(&[0.0, 0.0, 1.0, 0.0], 2, None, Ends::Natural).unwrap();
    let limits = PathLimits { torque: Some((vec![-8.0; 2], vec![8.0; 2])), ..PathLimits::default() };
    let p = time_path(Mover::PlanarPr(arm), Arc::new(path), &limits, &TimePathOptions::default()).unwrap();
    // The switch is exactly at a grid point.
    assert!((p.motion.duration() - 1.0).abs() < 1e-12);
}

/// At a reversal of the path, `dq/ds = 0`, so that no speed limit restricts the path speed.
#[test]
fn turning_back_with_much_torque() {
    let q = [0.3171705300029175, 1.1445280548279282, 0.24228325436612685, -0.5987319715652603, 0.2792056757544894];
    let limits =
        PathLimits { torque: Some((vec![-1e6], vec![1e6])), velocity: Some(vec![3.16264401]), acceleration: None, ..PathLimits::default() };
    for (grid, end_speed) in [(50, 0.0), (101, 0.0), (201, 0.0), (202, 0.0), (401, 0.0), (801, 0.0), (201, 0.6079677785133834)] {
        let options = TimePathOptions { grid: Some(grid), end_speed, ..TimePathOptions::default() };
        let p = timed(&pendulum(), &q, limits.clone(), options);
        // Almost the whole motion is at the speed limit.
        let length: f64 = q.windows(2).map(|w| (w[1] - w[0]).abs()).sum();
        let least = length / 3.16264401;
        assert!(p.reason.is_none(), "{grid}: {}", p.reason.unwrap());
        assert!(p.motion.duration() > least && p.motion.duration() < 1.1 * least, "{grid}: {} {least}", p.motion.duration());
    }
}
