//! Cartesian coordinates of a frame: chosen rows of its position and orientation, in world axes.
//!
//! Rows x, y, z have the error `e = x_d - p_WF`. Rows rx, ry, rz have the error `e = log(R_d R')`. `R_d` is `exp` of the target's rotation
//! vector, in which missing components are zero. The Jacobian has the same rows of the geometric Jacobian.

use crate::arm::{Arm, Tree};
use crate::error::{Error, Result};
use crate::kinematics::{Pose, frame_pose, jacobian};
use crate::scalar::Real;
use crate::spatial::{Matrix, Matrix3, Vector, Vector3, rotation_exp, rotation_log};

/// Names of the rows.
pub const LETTERS: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];

/// A frame of an arm and its controlled rows of `[p; r]`, in the order of the caller.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Model;
/// use armlet_core::kinematics::Coordinates;
/// use nalgebra::{dmatrix, dvector};
///
/// let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
/// let coordinates = Coordinates::new(&arm, "link2", "xy rz")?;
/// assert_eq!((coordinates.rows.as_slice(), coordinates.turns()), (&[0, 1, 5][..], true));
/// // The straight arm reaches x = 0.9 m.
/// let (e, j) = Model::from(arm).at(&[0.0; 2]).error_and_jacobian(&coordinates, &dvector![1.0, 0.0, 0.2]);
/// assert!((e[0] - 0.1).abs() < 1e-15 && (e[2] - 0.2).abs() < 1e-15);
/// assert_eq!(j, dmatrix![0.0, 0.0; 0.9, 0.4; 1.0, 1.0]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Coordinates {
    /// Index of the frame.
    pub frame: usize,
    /// Rows of the pose: 0 to 2 for position, 3 to 5 for orientation.
    pub rows: Vec<usize>,
}

/// Parse the rows that `axes` names, for example "xyz", "xy", "rx ry rz" or "xyz rz". Errors: `Input` for other letters, a repeated row or
/// no row.
pub fn parse_axes(axes: &str) -> Result<Vec<usize>> {
    let refused = || Error::input("axes", format!("is not made of x y z rx ry rz: expected such as \"xyz\" or \"x y rz\", got {axes:?}"));
    let mut rows = Vec::new();
    let mut letters = axes.chars().filter(|c| !c.is_whitespace() && *c != ',');
    while let Some(letter) = letters.next() {
        let (turn, letter) = if letter == 'r' { (3, letters.next().ok_or_else(refused)?) } else { (0, letter) };
        let row = turn + ['x', 'y', 'z'].iter().position(|c| *c == letter).ok_or_else(refused)?;
        if rows.contains(&row) {
            return Err(Error::input("axes", format!("repeats {}: expected each letter once, got {axes:?}", LETTERS[row])));
        }
        rows.push(row);
    }
    if rows.is_empty() { Err(refused()) } else { Ok(rows) }
}

/// Compute the rows of a pose: of its position, m, and of its rotation vector, rad. `pose` is a homogeneous transform `(4, 4)`, row-major.
///
/// Errors: `Input` if the matrix is not a pose. Also `Input` if `rows` has some but not all components of orientation, and an omitted one
/// is not zero.
pub fn rows_of_pose(pose: &[f64], rows: &[usize]) -> Result<Vec<f64>> {
    /// The largest accepted deviation of a rotation from orthogonality, and of the last row from 0 0 0 1.
    const ORTHOGONAL: f64 = 1e-6;
    /// The largest component of a rotation vector that counts as a rounding error, rad.
    const STRAIGHT: f64 = 1e-9;
    let at = |i: usize, j: usize| pose[4 * i + j];
    let columns = [0, 1, 2].map(|j| Vector3::from([at(0, j), at(1, j), at(2, j)]));
    let off = |i: usize, j: usize| (columns[i].dot(columns[j]) - f64::from(u8::from(i == j))).abs();
    let skew = (0..9).map(|k| off(k / 3, k % 3)).fold(0.0, f64::max);
    let last = (0..4).map(|j| (at(3, j) - f64::from(u8::from(j == 3))).abs()).fold(0.0, f64::max);
    if !(skew < ORTHOGONAL && last < ORTHOGONAL && columns[0].cross(columns[1]).dot(columns[2]) > 0.0) {
        return Err(Error::input("target", "is not a pose: expected a rotation, a position and the last row 0 0 0 1"));
    }
    let turn = rotation_log(&Matrix3::from_columns(&columns));
    let left_out = |k: &usize| !rows.contains(k) && turn[k - 3].abs() > STRAIGHT;
    if let Some(k) = (3..6).find(left_out).filter(|_| rows.iter().any(|&row| row > 2)) {
        let letter = LETTERS[k];
        let problem =
            format!("turns about {letter}: expected axes with {letter}, or a rotation vector without it, got {} rad", turn[k - 3]);
        return Err(Error::input("target", problem));
    }
    Ok(rows.iter().map(|&row| if row < 3 { at(row, 3) } else { turn[row - 3] }).collect())
}

impl Coordinates {
    /// Create coordinates with the rows `axes` of the frame named `frame`. `axes` is, for example, `"xy"` or `"xyz rx ry rz"`. Errors:
    /// `Unknown` for the frame, and those of [`parse_axes`].
    pub fn new(arm: &Arm, frame: &str, axes: &str) -> Result<Self> {
        Ok(Coordinates { frame: arm.frame_index(frame)?, rows: parse_axes(axes)? })
    }

    /// Number of rows `m`.
    pub fn m(&self) -> usize {
        self.rows.len()
    }

    /// Whether a row is a component of orientation.
    pub fn turns(&self) -> bool {
        self.rows.iter().any(|&row| row > 2)
    }

    /// Compute the coordinates `x`, `(m,)`: rows of the position `p_WF`, m, and of the rotation vector `log R_WF`, rad.
    pub fn position<S: Real>(&self, tree: &Tree<S>, poses: &mut [Pose<S>], trig: &[(S, S)], q: &[S], x: &mut [S]) {
        let (r, p) = frame_pose(tree, poses, trig, q, self.frame);
        let turn = if self.turns() { rotation_log(&r) } else { Vector3::zero() };
        for (x, &row) in x.iter_mut().zip(&self.rows) {
            *x = if row < 3 { p[row] } else { turn[row - 3] };
        }
    }

    /// Compute the error `e`, `(m,)`, to `target`, `(m,)`, and the Jacobian `j`, `(m, n)`. `full` is memory for `(6, n)`.
    pub fn error_and_jacobian<S: Real>(
        &self,
        tree: &Tree<S>,
        poses: &mut [Pose<S>],
        full: &mut [S],
        (trig, q): (&[(S, S)], &[S]),
        target: &[S],
        (e, j): (&mut [S], &mut [S]),
    ) {
        let p = jacobian(tree, poses, trig, q, self.frame, full);
        let turn = if self.turns() { self.turn_error(tree, poses, trig, q, target) } else { Vector3::zero() };
        for (k, &row) in self.rows.iter().enumerate() {
            e[k] = if row < 3 { target[k] - p[row] } else { turn[row - 3] };
        }
        self.copy_rows(full, j);
    }

    /// The orientation error `log(R_d R')`, rad.
    fn turn_error<S: Real>(&self, tree: &Tree<S>, poses: &mut [Pose<S>], trig: &[(S, S)], q: &[S], target: &[S]) -> Vector3<S> {
        let (r, _) = frame_pose(tree, poses, trig, q, self.frame);
        let mut vector = [S::zero(); 3];
        for (k, &row) in self.rows.iter().enumerate() {
            if row > 2 {
                vector[row - 3] = target[k];
            }
        }
        rotation_log(&rotation_exp(vector).times(r.transpose()))
    }

    /// Copy the controlled rows of `full`, `(6, n)`, to `j`, `(m, n)`. `full` is a Jacobian of the frame, or its time derivative.
    pub fn copy_rows<S: Real>(&self, full: &[S], j: &mut [S]) {
        let n = full.len() / LETTERS.len();
        for (k, &row) in self.rows.iter().enumerate() {
            j[k * n..(k + 1) * n].copy_from_slice(&full[row * n..(row + 1) * n]);
        }
    }
}
