//! The named terms of a law at one instant. The law names them where it computes them ([`Real::term`](crate::scalar::Real::term)).

/// A named term of a law: its name, shape, and values in row-major order.
pub type Term = (&'static str, Vec<usize>, Vec<f64>);
