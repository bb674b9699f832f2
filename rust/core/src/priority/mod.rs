//! Task priority at velocity level (Siciliano and Slotine 1991, `siciliano1991priority`):
//!
//! `v = J1# v1 + (J2 P1)# (v2 - J2 J1# v1) + ..`, `P1 = I - J1# J1`                                        (5)
//!
//! Here `J1` and `J2` are the Jacobians of the first two levels, `v1` and `v2` their task velocities, and `#` marks the pseudo-inverse. The
//! number and the sizes of the levels are arbitrary. A *level* is a task with a priority, and a *stack* is the list of all levels. Five
//! methods compute `v` (`PriorityMethod`). `diagnose` reports the directions of each level that can be commanded, and why the other
//! directions cannot be commanded. The page `docs/methods/priority.md` has the derivation, the limits and a table of the methods.
//!
//! The branch-free algorithms solve most stacks. `regular` uses LQ factorisations. Its result is valid only if it is proven that every
//! singular value is large and that no bound is met. `within_bounds` does so for stacks with bounds. For `clamp` and `damped`, `two_rows` solves levels of at most two rows in closed form,
//! also at singularities. `hierarchy` is the general recursion over levels with singular values.
//! `inequality` solves stacks that meet a bound, and scales commands. `bounded_c` is the same search as C code, and `derivative` has the
//! derivatives of solutions with bounds. `solver` owns the memory and selects the algorithm. `batch` solves many stacks with a program: the
//! recorded and compiled algorithm `regular`. `formula` is the solution within a recorded law, and `native_stack` the native code at its
//! cuts.

#[doc(hidden)]
mod batch;
mod bounded_c;
mod bounds;
#[doc(hidden)]
mod branch_free;
mod derivative;
mod diagnose;
mod formula;
mod hierarchy;
mod inequality;
mod method;
mod metric;
mod native_stack;
mod reasons;
mod settings;
mod solution;
mod solve;
mod solver;
mod stack;

pub use batch::{BoundedAnswers, FEWEST_ROWS, StackAnswers, StackBatch, StackRows};
pub use bounds::{joint_velocity_bounds, velocity_bounds};
pub use branch_free::Regular;
pub use diagnose::{Compatibility, Diagnosis, LevelDiagnosis, SingularityKind, diagnose};
pub use formula::StackFormula;
pub use method::{DEFAULT_EPS, DEFAULT_ROUNDING, PriorityMethod, PriorityOptions};
pub use reasons::{BoundedRows, Reason, Reasons, reasons, scale_reasons};
pub use solution::{Bounded, LevelSolution, Solution};
pub use solve::{certificate, solve_levels, solve_priority};
pub use solver::PrioritySolver;
