#![doc = include_str!("../README.md")]
// The layers, lowest first. A module uses only those before it (checked by `tests/api/test_layering.py`):
// `interrupt -> error status scalar -> linalg -> spatial -> arm -> kinematics -> dynamics -> plant -> law -> {analysis, simulate}`,
// with `linalg -> priority -> law`, `scalar -> motion -> {law, plan}`, `scalar -> trace -> dynamics -> plan`.
// `integrate` uses only `error, status, scalar, linalg`. `parallel` contains threads and `memory` sizes; neither contains robots.
#![deny(missing_docs)]

pub mod analysis;
pub mod arm;
pub mod dynamics;
pub mod error;
pub mod integrate;
pub mod interrupt;
pub mod kinematics;
pub mod law;
#[doc(hidden)]
pub mod linalg;
#[doc(hidden)]
pub mod memory;
pub mod motion;
#[doc(hidden)]
pub mod parallel;
pub mod plan;
pub mod plant;
pub mod priority;
pub mod scalar;
pub mod simulate;
pub mod spatial;
pub mod status;
#[doc(hidden)]
pub mod trace;
