//! Decompositions for set-up and for rank decisions: capped, finite-checked, never a panic.

pub mod cholesky;
