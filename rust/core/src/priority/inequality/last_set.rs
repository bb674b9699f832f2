//! The active set of one problem of a stack in the last solve.

/// The rows that were held and the violated rows of a problem, with the sides of their bounds.
#[derive(Debug, Clone)]
pub struct LastSet {
    pub held: Vec<(usize, i8)>,
    pub violated: Vec<(usize, i8)>,
    /// Whether a bound was active in this or an earlier problem.
    pub touched: bool,
    /// Whether a direction was damped or clamped.
    pub damps: bool,
}

impl LastSet {
    /// Allocate memory for a number of rows.
    pub fn new(rows: usize) -> Self {
        LastSet { held: Vec::with_capacity(rows), violated: Vec::with_capacity(rows), touched: false, damps: false }
    }
}
