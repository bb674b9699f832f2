//! Options of inverse kinematics, and the joint limits of the search.

use crate::arm::Arm;
use crate::error::{Error, Result, positive};
use crate::priority::PriorityMethod;

/// Options of a search.
///
/// ```
/// # use armlet_core::{arm::Arm, kinematics::TaskFunction, status::Status};
/// use armlet_core::analysis::inverse_kinematics::{IkOptions, inverse_kinematics};
/// # let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
/// # let goal = [(TaskFunction::frame(&arm, "link2", "xy")?, vec![0.6, 0.3])];
///
/// let options = IkOptions { tolerance: 1e-4, ..IkOptions::default() };
/// let solution = inverse_kinematics(&arm, &goal, &[0.1, 0.2], &options)?;
/// assert!(solution.status == Status::Success && solution.errors.iter().all(|e| e.abs() <= 1e-4));
/// let one_step = IkOptions { max_iterations: 1, restarts: 0, ..options };
/// assert_ne!(inverse_kinematics(&arm, &goal, &[0.1, 0.2], &one_step)?.status, Status::Success);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct IkOptions {
    /// Tolerance, m or rad. A task is reached if no entry of its error is larger.
    pub tolerance: f64,
    /// Largest number of steps from each start.
    pub max_iterations: usize,
    /// Largest number of random starts after the first start.
    pub restarts: usize,
    /// Seed of the random starts.
    pub seed: u64,
    /// Largest motion of a joint in one step, rad or m.
    pub step_max: f64,
    /// Whether the search keeps the joints within the limits of the arm.
    pub limits: bool,
    /// The priority method of the steps. Without `eps`, `None` means damped steps for all tasks together. If there are several tasks and
    /// these steps do not reach all of them, steps with the method `Clamp` follow. With `eps`, `None` means the method `Clamp`.
    pub method: Option<PriorityMethod>,
    /// Thresholds of singular values, one per task or one for all tasks.
    pub eps: Option<Vec<f64>>,
}

impl Default for IkOptions {
    fn default() -> Self {
        let (method, eps) = (None, None);
        IkOptions { tolerance: 1e-9, max_iterations: 100, restarts: 50, seed: 0, step_max: 0.5, limits: true, method, eps }
    }
}

impl IkOptions {
    pub(super) fn check(&self) -> Result<()> {
        positive("tolerance", self.tolerance)?;
        positive("step_max", self.step_max)?;
        if self.method == Some(PriorityMethod::Sns) {
            return Err(Error::input("method", "bounds velocities: expected clamp, damped, exact or chiaverini, got sns"));
        }
        Ok(())
    }
}

/// Lower and upper limit of each joint; infinite where there is no limit.
pub(super) fn limits(arm: &Arm, within_limits: bool) -> Result<Vec<(f64, f64)>> {
    let free = (f64::NEG_INFINITY, f64::INFINITY);
    let of = |joint: &crate::arm::Joint| if within_limits { (joint.limits.lower, joint.limits.upper) } else { free };
    let bounds: Vec<(f64, f64)> = arm.independent().map(of).collect();
    match bounds.iter().position(|(lower, upper)| !(lower <= upper)) {
        None => Ok(bounds),
        Some(i) => {
            Err(Error::input("arm", format!("has limits out of order: expected lower <= upper, got {} > {}", bounds[i].0, bounds[i].1))
                .at([i]))
        }
    }
}
