//! Task priority from matrices: `armlet.solve_priority`, `PrioritySolver`, `diagnose_priority`, `velocity_bounds`.
//!
//! `v = J1# v1 + (J2 P1)# (v2 - J2 J1# v1) + ..` with `P1 = I - J1# J1` (`siciliano1991priority`). The core computes it. A *level* is a
//! task with its priority, and a *stack* is the Jacobians and the velocities of all levels.

mod arm_solver;
mod details;
mod diagnosis;
mod law_terms;
mod single;
mod solution;
mod solve;
mod solver;
mod stack;
mod stacks;
mod within;

pub use arm_solver::ArmPrioritySolver;
pub use details::_priority_reasons;
pub use diagnosis::{diagnose_priority, velocity_bounds};
pub use law_terms::put_active_rows;
pub use solution::{PrioritySolution, residual_list, status_member};
pub use solve::solve_priority;
pub use solver::{_restore_arm_solver, PrioritySolver};
pub use stack::{Keywords, method_name, per_joint};
pub use within::Within;
