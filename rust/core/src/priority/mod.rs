//! Task priority at velocity level from plain matrices (SPEC system 2; Siciliano and Slotine 1991, `siciliano1991priority`):
//!
//! `v = J1# v1 + (J2 P1)# (v2 - J2 J1# v1) + ..`, `P1 = I - J1# J1`                                        (5)
//!
//! with any number of levels of any size. Five maps realise it (`PriorityMethod`); `diagnose` reports which directions of which level can
//! be commanded, and why others cannot. Derivation, limits and a table of the methods: `docs/priority.md`.
//!
//! Four layers: `regular` solves by LQ factorisations where it can prove that every singular value is large and no bound is met.
//! `pairs` has levels of one or two rows in closed form, at singularities too. `levels` is the general recursion over singular values,
//! and `sns` adds bounds. `batch` solves many stacks by machine code that is recorded from `regular`. `solver` owns the buffers and selects
//! the layer.

#[doc(hidden)]
mod batch;
mod bounds;
mod diagnose;
mod levels;
mod lq;
mod matrices;
mod method;
mod metric;
mod own;
mod pairs;
#[doc(hidden)]
mod regular;
mod sns;
mod solution;
mod solver;
mod workspace;

pub use batch::{FEW, StackAnswers, StackBatch, StackRows};
pub use bounds::{joint_velocity_bounds, velocity_bounds};
pub use diagnose::{Compatibility, Diagnosis, Kind, LevelDiagnosis, diagnose};
pub use matrices::solve_levels;
pub use method::{DEFAULT_EPS, DEFAULT_ROUNDING, PriorityMethod, PriorityOptions};
pub use regular::Regular;
pub use solution::{Solution, solve_priority};
pub use solver::PrioritySolver;
