//! Cartesian impedance: the law, its options, and its diagnosis.

mod cartesian;
mod coupling;
mod null_space;
mod options;
mod projection_loss;
mod target_dynamics;

pub use cartesian::CartesianImpedanceSpec;
pub(crate) use cartesian::turn_rates;
pub use null_space::{NULL_SPACE_EPS, NullProjection, NullSpaceSpec};
pub use options::ImpedanceOptions;
pub(super) use options::held;
pub(crate) use projection_loss::ProjectionLoss;
