//! The arm that moves along a path, and its quantities at many points together.

use crate::dynamics::{Functions, PlanarPr, Query};
use crate::error::Result;

/// The arm that moves along the path.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::{Functions, PlanarPr};
/// use armlet_core::plan::Mover;
/// use std::sync::Arc;
///
/// let tree = Functions::new(Arc::new(Arm::planar(&[0.5, 0.4, 0.1], None, None, None, [0.0, -9.81])?));
/// assert_eq!(Mover::Tree(&tree).joint_names(), ["joint1", "joint2", "joint3"]);
/// assert_eq!(Mover::PlanarPr(PlanarPr::new(3.0, 0.5, 0.2)?).dof(), 2);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy)]
pub enum Mover<'a> {
    /// A tree of bodies.
    Tree(&'a Functions),
    /// The planar arm with one prismatic and one revolute joint, in closed form.
    PlanarPr(PlanarPr<f64>),
}

impl Mover<'_> {
    /// Number of joints `n`.
    pub fn dof(&self) -> usize {
        match self {
            Mover::Tree(functions) => functions.arm().n(),
            Mover::PlanarPr(_) => 2,
        }
    }

    /// Names of the joints.
    pub fn joint_names(&self) -> Vec<String> {
        match self {
            Mover::Tree(functions) => functions.arm().joint_names().map(String::from).collect(),
            Mover::PlanarPr(_) => vec!["p1".into(), "r2".into()],
        }
    }

    /// Name of the frame with index `frame`.
    pub(super) fn frame_name(&self, frame: usize) -> String {
        match self {
            Mover::Tree(functions) => functions.arm().frame_names().nth(frame).unwrap_or_default().to_string(),
            Mover::PlanarPr(_) => String::new(),
        }
    }

    /// Compute a matrix of a frame at `count` points. Each input is `(count, n)`. A point whose input is not finite gets NaN; with
    /// `PlanarPr`, all points get NaN.
    pub(super) fn matrices(&self, query: &Query, inputs: &[&[f64]], count: usize, out: &mut [f64]) {
        let n = self.dof();
        let Mover::Tree(functions) = self else { return out.fill(f64::NAN) };
        if functions.rows(query, inputs, count, out).is_ok() {
            return;
        }
        let length = out.len() / count;
        for (k, out) in out.chunks_exact_mut(length).enumerate() {
            let row: Vec<&[f64]> = inputs.iter().map(|x| &x[k * n..(k + 1) * n]).collect();
            if functions.rows(query, &row, 1, out).is_err() {
                out.fill(f64::NAN);
            }
        }
    }

    /// Compute a quantity at `count` points `q, v, a`, `(count, n)` each. A point that is not finite gets NaN.
    pub(super) fn rows(&self, query: &Query, points: [&[f64]; 3], count: usize, out: &mut [f64]) {
        let n = self.dof();
        let answer = |points: [&[f64]; 3], count: usize, out: &mut [f64]| -> Result<()> {
            match self {
                Mover::Tree(functions) => functions.rows(query, &points, count, out).map(drop),
                Mover::PlanarPr(arm) => {
                    let length = out.len() / count;
                    let row = |k: usize| points.map(|x| &x[k * n..(k + 1) * n]);
                    out.chunks_exact_mut(length).enumerate().try_for_each(|(k, out)| arm.evaluate(query, &row(k), out))
                }
            }
        };
        if answer(points, count, out).is_ok() {
            return;
        }
        let length = out.len() / count;
        for (k, out) in out.chunks_exact_mut(length).enumerate() {
            if answer(points.map(|x| &x[k * n..(k + 1) * n]), 1, out).is_err() {
                out.fill(f64::NAN);
            }
        }
    }
}
