//! The times of the records of a run, which the caller requests.

use crate::error::{Error, Result, finite};

/// The smallest memory of one record, in bytes: its place in the schedule, time, state, input and monitors for a small arm.
const BYTES_PER_RECORD: u128 = 160;

/// The times of the records of a run.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// # use nalgebra::dvector;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 50.0)?, Gain::scalar("kd", 1, 20.0)?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{Options, Problem, Times};
///
/// let t = |times| {
///     let options = Options { times, ..Options::fixed(1.0, 0.01) };
///     Problem::from_rest(&plant, &law, &dvector![1.0], options)?.run().map(|run| run.t)
/// };
/// assert_eq!(t(Times::Every(50))?.len(), 3);
/// assert_eq!(t(Times::At(vec![0.25, 0.755]))?, [0.25, 0.755]);
/// // The run ends at 1 s.
/// assert!(t(Times::At(vec![2.0])).is_err());
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Times {
    /// The start, the ends of every `k`-th accepted step, and the end of the run.
    Every(usize),
    /// These times, s, increasing, within `[0, t_end]`.
    At(Vec<f64>),
}

/// Refuse times, s, that do not increase, or that are outside of the run, which ends at `t_end`, s.
pub fn require_times(t_eval: &[f64], t_end: f64) -> Result<()> {
    finite("t_eval", t_eval)?;
    for (i, &t) in t_eval.iter().enumerate() {
        if t < 0.0 || t > t_end {
            return Err(Error::input("t_eval", format!("leaves the run: expected times in [0, {t_end}], got {t}")).at([i]));
        }
        if i > 0 && t <= t_eval[i - 1] {
            return Err(Error::input("t_eval", format!("is not increasing: expected > {}, got {t}", t_eval[i - 1])).at([i]));
        }
    }
    Ok(())
}

/// Refuse more records than memory can store. The check is one large reservation, which the system can refuse. Many small reservations
/// would end the process instead.
pub fn require_memory(records: u128) -> Result<()> {
    let bytes = records * BYTES_PER_RECORD;
    let refused = Error::Memory { bytes };
    let Ok(size) = usize::try_from(bytes) else { return Err(refused) };
    Vec::<u8>::new().try_reserve_exact(size).map_err(|_| refused)
}
