//! What is asked of an arm or a loop beside running it: linearisation, base parameters, physical consistency,
//! identification.

pub mod linearisation;
