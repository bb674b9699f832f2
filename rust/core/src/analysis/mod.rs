//! Analysis of an arm and of a closed loop without simulation. Topics are linearisation, base parameters, physical consistency,
//! identification, inverse kinematics, momentum observers, suggested gains, equilibria and limits.

pub mod base_parameters;
pub mod consistency;
pub mod elastic_limits;
pub mod equilibrium;
pub mod equilibrium_problem;
pub mod identification;
pub mod inverse_kinematics;
pub mod linearisation;
pub mod loop_slope;
pub mod momentum_observer;
mod recordings;
mod residual;
pub mod sample_selection;
pub mod suggested_gains;
mod uniform;
