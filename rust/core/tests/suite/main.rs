//! All integration tests in one binary, so that they are linked only once.
//!
//! The folder is flat, because the name of a test file begins with its part of the core.

mod adaptive_ndof;
mod adaptive_pr;
mod arm_alloc;
mod arm_common;
mod arm_functions;
mod arm_laws;
mod arm_models;
mod arm_oracle;
mod arm_quarter_turns;
mod arm_urdf;
mod arm_urdf_mutants;
mod counting;
mod derivatives;
mod elastic_loops;
mod elastic_oracle;
mod emulated_loops;
mod examples;
// The unit tests of `trace` use this file too, so that all cases that `make test-aarch64` runs in an emulator have one format.
#[path = "../../src/trace/harness.rs"]
mod harness;
mod integrate_alloc;
mod integrate_chatter;
mod integrate_methods;
mod integrate_support;
mod inverse_kinematics;
mod loop_allocation;
mod loop_derivative_cases;
mod loop_derivatives;
mod plan_bang_bang;
mod plan_friction;
mod plan_profiles;
mod plan_support;
mod plan_time_path;
mod plan_torque_optimal;
mod priority_allocation;
mod priority_bounds;
mod priority_classes;
mod priority_inputs;
mod priority_lanes;
mod priority_linalg;
mod priority_oracle;
mod priority_random;
mod priority_support;
mod run_contacts;
mod sampling;
