#![doc = include_str!("../README.md")]
// The modules are listed in layers, lowest first. A module may use only earlier modules (checked by `tests/api/test_layering.py`):
// `interrupt -> error status scalar -> linalg -> spatial -> arm -> kinematics -> dynamics -> plant -> law -> {analysis, simulate}`,
// with `linalg -> priority -> law`, `scalar -> motion -> {law, plan}`, `scalar -> trace -> dynamics -> plan`.
// `integrate` uses only `error, status, scalar, linalg`. `parallel` knows only threads, and `memory` knows only sizes. Neither knows
// robots.
#![deny(missing_docs)]
// A function has at most seven parameters. Related parameters are grouped, for example `[v, v_r, a_r]`.
#![warn(clippy::too_many_arguments)]

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
