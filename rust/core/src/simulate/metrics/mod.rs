//! Metrics of runs. `plan` has the layout of the numbers between records. `gauge` updates these numbers, and `summary` computes the final
//! ones.

pub mod gauge;
pub mod plan;
pub mod summary;
