//! The named terms of a law at one instant.

/// The arguments of a law at one instant.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// use armlet_core::law::{Gain, Instant, LawSpec, PdGravitySpec};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |k: f64| Gain::scalar("gain", 1, k);
///
/// let law = LawSpec::from(PdGravitySpec::new(model, vec![0.5], gain(20.0)?, gain(4.0)?)?);
/// let (q, v): (f64, f64) = (0.3, 0.1);
/// let at = Instant { t: 0.0, desired: &law.desired::<f64>(0.0), trig: &[q.sin_cos()], x: &[q, v], z: &[] };
/// let terms = law.terms(&at);
/// assert_eq!(terms.iter().map(|(name, ..)| *name).collect::<Vec<_>>(), ["q_d", "e", "g", "tau"]);
/// assert!((terms[3].2[0] - (20.0 * 0.2 - 4.0 * v + 5.0 * q.sin())).abs() < 1e-12);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct Instant<'a> {
    /// Time, s.
    pub t: f64,
    /// Samples `[x_d, x_d', x_d'']` of the desired motions, with time derivatives `'`, one motion after another.
    pub desired: &'a [f64],
    /// (sin, cos) of each joint position, `n` pairs.
    pub trig: &'a [(f64, f64)],
    /// State of the plant: joint positions (rad or m), and velocities (rad/s or m/s) unless they are the plant's input. If there are
    /// motors, their positions and velocities follow.
    pub x: &'a [f64],
    /// State of the law, for example an estimate or an integral; empty for a law without a state.
    pub z: &'a [f64],
}

/// A named term of a law: its name, shape, and values in row-major order.
pub type Term = (&'static str, Vec<usize>, Vec<f64>);
