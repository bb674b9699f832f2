//! What is asked of an arm or a loop beside running it: linearisation, base parameters, physical consistency,
//! identification.

pub mod base_parameters;
pub mod consistency;
pub mod identification;
pub mod linearisation;
