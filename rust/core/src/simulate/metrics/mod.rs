//! Metrics of runs. `options` has the request, and `plan` the layout of the numbers between records. `gauge` updates these numbers, and
//! `summary` computes the final ones. `measuring` has the metrics of a batch.

pub mod gauge;
pub mod measuring;
pub mod options;
pub mod plan;
pub mod summary;
