//! The references of a law: the desired positions of the joints, and the targets of frames.

use super::LawSpec;
use crate::kinematics::{Coordinates, TaskFunction};
use crate::motion::Motion;

/// The desired positions of the joints.
#[derive(Clone, Debug, PartialEq)]
pub enum JointReference {
    /// The motion of the law: the first of [`Definition::motions`](super::Definition::motions).
    Motion,
    /// A fixed position, `(n,)`, rad or m.
    Target(Vec<f64>),
}

/// Rows of a frame's position that a law moves to a target.
#[derive(Clone, Debug, PartialEq)]
pub struct Aim {
    /// Index of the frame.
    pub frame: usize,
    /// The controlled axes: 0, 1 and 2 for x, y and z.
    pub rows: Vec<usize>,
    /// Index of each row's target in [`LawSpec::desired`].
    pub places: Vec<usize>,
}

impl JointReference {
    /// The position of `motion` at time zero, as a fixed target.
    pub(super) fn held(motion: &Motion) -> Self {
        let mut sample = vec![0.0; 3 * motion.dof()];
        motion.sample(0.0, &mut sample);
        sample.truncate(motion.dof());
        JointReference::Target(sample)
    }
}

impl LawSpec {
    /// The tasks of the law that move a frame to a position.
    pub fn aims(&self) -> Vec<Aim> {
        if self.levels().is_empty() {
            return self.coordinates().and_then(|coordinates| aim(coordinates, 0)).into_iter().collect();
        }
        let (mut aims, mut first) = (Vec::new(), 0);
        for level in self.levels() {
            if let TaskFunction::Frame(coordinates) = &level.function {
                aims.extend(aim(coordinates, first));
            }
            first += 3 * level.target.dof();
        }
        aims
    }
}

/// The position rows of `coordinates`, whose target begins at index `first`; `None` if there are none.
fn aim(coordinates: &Coordinates, first: usize) -> Option<Aim> {
    let positions = || coordinates.rows.iter().enumerate().filter(|(_, row)| **row < 3);
    let (rows, places): (Vec<usize>, Vec<usize>) = positions().map(|(place, &row)| (row, first + place)).unzip();
    (!rows.is_empty()).then_some(Aim { frame: coordinates.frame, rows, places })
}
