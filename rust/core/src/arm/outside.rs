//! Positions that are outside of joint limits: `q < lower` or `q > upper`, by more than the rounding of decimal numbers. A position of more
//! than one turn within limits that are probably in degrees also counts.

use super::{Arm, Joint, JointKind};
use crate::interrupt;
use std::f64::consts::TAU;

/// The tolerance of the comparison with a limit, rad or m. Files and scripts round positions and limits.
const SLACK: f64 = 1e-9;

/// The first position that is outside of its joint's limits, and the counts of such positions.
///
/// ```
/// use armlet_core::arm::{Arm, Outside, STANDARD_GRAVITY, example_urdf};
///
/// let arm = Arm::from_urdf(example_urdf("planar_2r")?, "planar_2r", STANDARD_GRAVITY, None, None)?;
/// assert_eq!(Outside::first([(&arm, &[9.0, 2.8][..])]), None);
/// let outside = Outside::first([(&arm, &[0.0, -57.0][..])]).expect("beyond -2.8 rad");
/// assert_eq!((outside.joint, outside.limits), (1, [-2.8, 2.8]));
/// assert_eq!(outside.problem(), "= -57 rad is outside [-2.8, 2.8]: degrees?");
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Outside {
    /// The index of the row with this position, in the argument of [`Outside::first`].
    pub row: usize,
    /// The joint of this position, as an index of `q`.
    pub joint: usize,
    /// The position, rad or m.
    pub value: f64,
    /// The limits of the joint, rad or m.
    pub limits: [f64; 2],
    /// Whether the position is an angle.
    pub angle: bool,
    /// The unit in which both the position and the limits are plausible, if both are too large for rad or m.
    pub other_unit: Option<&'static str>,
    /// The number of joints outside of their limits in this row.
    pub joints: usize,
    /// The number of rows with a joint outside of its limits.
    pub rows: usize,
    /// The number of rows that were checked.
    pub of: usize,
}

impl Outside {
    /// Return the first position that is outside of its limits. `rows`: pairs of an arm and its joint positions, shape `(n,)`, rad or m.
    /// NaN does not count as outside.
    pub fn first<'a>(rows: impl IntoIterator<Item = (&'a Arm, &'a [f64])>) -> Option<Outside> {
        let (mut found, mut of): (Option<Outside>, usize) = (None, 0);
        for (row, (arm, q)) in rows.into_iter().enumerate() {
            interrupt::check();
            of += 1;
            let mut beyond = arm.independent().zip(q).enumerate().filter(|(_, (joint, q))| {
                let limits = &joint.limits;
                **q < limits.lower - SLACK || **q > limits.upper + SLACK || other_unit(joint, **q).is_some()
            });
            let Some((i, (joint, &value))) = beyond.next() else { continue };
            match &mut found {
                Some(found) => found.rows += 1,
                None => {
                    let (limits, angle) = ([joint.limits.lower, joint.limits.upper], joint.kind != JointKind::Prismatic);
                    let other_unit = other_unit(joint, value);
                    found = Some(Outside { row, joint: i, value, limits, angle, other_unit, joints: 1 + beyond.count(), rows: 1, of });
                }
            }
        }
        if let Some(found) = &mut found {
            found.of = of;
        }
        found
    }

    /// Whether the value may be an angle in degrees. As radians it exceeds one revolution, and as degrees it is within the limits.
    fn degrees(&self) -> bool {
        let [lower, upper] = self.limits;
        self.angle && self.value.abs() > TAU && (lower..=upper).contains(&self.value.to_radians())
    }

    /// The index of the position as text: row and joint if `of_rows` is true, otherwise only the joint.
    pub fn index(&self, of_rows: bool) -> String {
        if of_rows { format!("[{}, {}]", self.row, self.joint) } else { format!("[{}]", self.joint) }
    }

    /// The problem as text, for example `= -57 rad is outside [-3.1, 3.1]: degrees?`.
    pub fn problem(&self) -> String {
        let ([lower, upper], unit) = (self.limits.map(short), if self.angle { "rad" } else { "m" });
        let mut text = format!("= {} {unit} is ", short(self.value));
        match self.other_unit {
            Some(other) if (self.limits[0]..=self.limits[1]).contains(&self.value) => {
                text += &format!("implausibly large, and so are its limits [{lower}, {upper}]: {other}?");
            }
            _ => text += &format!("outside [{lower}, {upper}]{}", if self.degrees() { ": degrees?" } else { "" }),
        }
        if self.of > 1 {
            text += &format!(" ({} of {} rows)", self.rows, self.of);
        } else if self.joints > 1 {
            let more = self.joints - 1;
            text += &format!(" (and {more} more joint{})", if more == 1 { "" } else { "s" });
        }
        text
    }
}

/// The unit in which a position and the limits of its joint are plausible, if both are too large for rad or m. So limits in degrees do not
/// hide a position in degrees.
fn other_unit(joint: &Joint, position: f64) -> Option<&'static str> {
    let far = if joint.kind.is_angle() { TAU + SLACK } else { 1.0 };
    joint.kind.doubtful_unit(&joint.limits).filter(|_| position.abs() > far)
}

/// Return the number as text with six digits, without trailing zeros.
fn short(x: f64) -> String {
    let rounded = format!("{x:.5e}").parse().unwrap_or(x);
    if rounded == 0.0 || (1e-4..1e9).contains(&rounded.abs()) || !rounded.is_finite() {
        format!("{rounded}")
    } else {
        format!("{rounded:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::{ChainJoint, JointType, Limits, STANDARD_GRAVITY};

    fn arm() -> Arm {
        let hinge = ChainJoint::new(JointType::Moving(JointKind::Revolute), [0.0, 0.0, 1.0], [0.0; 3], [0.0; 3], [0.0; 10]);
        let limited = |lower: f64, upper: f64, kind| {
            let limits = Limits { lower, upper, ..Limits::default() };
            ChainJoint { limits, kind: JointType::Moving(kind), ..hinge.clone() }
        };
        let joints = [hinge.clone(), limited(-3.1, 3.1, JointKind::Revolute), limited(0.0, 0.5, JointKind::Prismatic)];
        Arm::from_chain(&joints, STANDARD_GRAVITY).unwrap()
    }

    fn report_of(rows: &[[f64; 3]]) -> Option<String> {
        let arm = arm();
        let found = Outside::first(rows.iter().map(|row| (&arm, &row[..])))?;
        Some(found.index(rows.len() > 1) + " " + &found.problem())
    }

    #[test]
    fn a_position_is_named_with_its_limits() {
        assert_eq!(report_of(&[[90.0, 3.1 + 0.9e-9, -0.9e-9]]), None);
        assert_eq!(report_of(&[[f64::NAN; 3]]), None);
        assert_eq!(report_of(&[[0.0, -57.0, 0.1]]).unwrap(), "[1] = -57 rad is outside [-3.1, 3.1]: degrees?");
        assert_eq!(report_of(&[[0.0, 3.2, 0.1]]).unwrap(), "[1] = 3.2 rad is outside [-3.1, 3.1]");
        assert_eq!(report_of(&[[0.0, 0.0, -25.0]]).unwrap(), "[2] = -25 m is outside [0, 0.5]");
        assert_eq!(
            report_of(&[[0.0, -57.29577951, 2.0]]).unwrap(),
            "[1] = -57.2958 rad is outside [-3.1, 3.1]: degrees? (and 1 more joint)"
        );
        assert_eq!(
            report_of(&[[0.0; 3], [0.0, 1e300, 0.0], [0.0, 4.0, 0.0]]).unwrap(),
            "[1, 1] = 1e300 rad is outside [-3.1, 3.1] (2 of 3 rows)"
        );
    }
}
