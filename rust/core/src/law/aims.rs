//! The target positions of the frames that a law controls.

use super::LawSpec;
use crate::kinematics::{Coordinates, TaskFunction};

/// The coordinates of a frame's position that a law controls, and the indices of their targets.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// use armlet_core::law::{CartesianImpedanceSpec, Gain, LawSpec};
/// # let model = Model::from(Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?);
/// # let gain = |k: f64| Gain::scalar("gain", 2, k);
///
/// let target = Motion::hold(vec![0.6, 0.3])?;
/// let law = LawSpec::from(CartesianImpedanceSpec::new(model, target, gain(200.0)?, gain(20.0)?, "link2", "xy")?);
/// let (aims, desired) = (law.aims(), law.desired::<f64>(0.0));
/// assert_eq!((aims.len(), aims[0].rows.as_slice()), (1, &[0, 1][..]));
/// assert_eq!(aims[0].places.iter().map(|&i| desired[i]).collect::<Vec<f64>>(), [0.6, 0.3]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Aim {
    /// Index of the frame.
    pub frame: usize,
    /// The controlled coordinates: 0, 1 and 2 for x, y and z.
    pub rows: Vec<usize>,
    /// Index of the target of each coordinate in [`LawSpec::desired`].
    pub places: Vec<usize>,
}

impl LawSpec {
    /// The frames whose positions the law controls, one entry per task.
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

/// The rows of position in `coordinates`; `None` if there are none. `first` is the index of the first target value.
fn aim(coordinates: &Coordinates, first: usize) -> Option<Aim> {
    let positions = || coordinates.rows.iter().enumerate().filter(|(_, row)| **row < 3);
    let (rows, places): (Vec<usize>, Vec<usize>) = positions().map(|(place, &row)| (row, first + place)).unzip();
    (!rows.is_empty()).then_some(Aim { frame: coordinates.frame, rows, places })
}
