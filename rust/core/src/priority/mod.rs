//! Task priority at velocity level (Siciliano and Slotine 1991, `siciliano1991priority`):
//!
//! `v = J1# v1 + (J2 P1)# (v2 - J2 J1# v1) + ..`, `P1 = I - J1# J1`                                        (5)
//!
//! Here `J1` and `J2` are the Jacobians of the first two levels, `v1` and `v2` their task velocities, and `#` marks the pseudo-inverse. The
//! number and the sizes of the levels are arbitrary. A *level* is a task with a priority, and a *stack* is the list of all levels. Five
//! methods compute `v` (`PriorityMethod`). `diagnose` reports the directions of each level that can be commanded, and why the other
//! directions cannot be commanded. The page `docs/priority.md` has the derivation, the limits and a table of the methods.
//!
//! A *route* is one algorithm that computes the solution. The route `regular` uses LQ factorisations. Its result is valid only if it is
//! proven that every singular value is large and that no bound is met. For `clamp` and `damped`, `pairs` solves levels of at most two rows
//! in closed form, also at singularities. `levels` is the general recursion with singular values, and `sns` adds bounds. `batch` solves
//! many stacks with a program: the recorded and compiled algorithm `regular`. `solver` owns the memory and selects the route.
//! `formula` is the solution within a recorded law.

#[doc(hidden)]
mod batch;
mod bounds;
mod diagnose;
mod formula;
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
pub use diagnose::{Compatibility, Diagnosis, LevelDiagnosis, SingularityKind, diagnose};
pub use formula::StackFormula;
pub use matrices::solve_levels;
pub use method::{DEFAULT_EPS, DEFAULT_ROUNDING, PriorityMethod, PriorityOptions};
pub use regular::Regular;
pub use solution::{Solution, solve_priority};
pub use solver::PrioritySolver;
