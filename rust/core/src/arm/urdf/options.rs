//! Options of the URDF reader.

use crate::error::{Error, Result};

/// The treatment of mimic joints.
///
/// ```
/// use armlet_core::arm::{Arm, MimicMode, UrdfOptions};
///
/// let gripper = r#"<robot name="gripper"><link name="palm"/><link name="left"/><link name="right"/>
///     <joint name="l" type="continuous"><parent link="palm"/><child link="left"/></joint>
///     <joint name="r" type="continuous"><parent link="palm"/><child link="right"/><mimic joint="l" multiplier="-1"/></joint></robot>"#;
/// let joints = |mimic| Arm::read_urdf(gripper, "gripper.urdf", &UrdfOptions { mimic, ..UrdfOptions::default() }).map(|arm| arm.n());
/// assert_eq!((joints(MimicMode::Joined)?, joints(MimicMode::Independent)?), (1, 2));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MimicMode {
    /// A mimic joint shares one degree of freedom with its leader.
    #[default]
    Joined,
    /// Every joint moves independently.
    Independent,
}

impl MimicMode {
    /// Return the treatment of mimic joints with this name: `"joined"` or `"independent"`. Errors: `Input` for other names.
    pub fn parse(name: &str) -> Result<Self> {
        match name {
            "joined" => Ok(MimicMode::Joined),
            "independent" => Ok(MimicMode::Independent),
            _ => Err(Error::input("mimic", format!("is unknown: expected joined or independent, got {name}"))),
        }
    }
}

/// Options of the URDF reader. `root` and `tip` are link names. The link `root` becomes the fixed base. With `tip`, only the joints between
/// `root` and `tip` remain. Faults of the file outside of this part are only reported.
///
/// ```
/// use armlet_core::arm::{Arm, UrdfOptions, example_urdf};
///
/// let options = UrdfOptions { root: Some("column"), tip: Some("left_hand"), ..UrdfOptions::default() };
/// let arm = Arm::read_urdf(example_urdf("two_arms")?, "two_arms", &options)?;
/// assert_eq!(arm.joint_names().collect::<Vec<_>>(), ["left_shoulder_pitch", "left_elbow", "left_roll"]);
/// assert_eq!(arm.gravity, [0.0, 0.0, -9.81]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UrdfOptions<'a> {
    /// Gravity in the axes of the fixed base, m/s^2. `None` selects 9.81 m/s^2 along -z of the file's root, with all joints between this
    /// root and the base at zero.
    pub gravity: Option<[f64; 3]>,
    /// The link that becomes the fixed base. `None` selects the root of the file.
    pub root: Option<&'a str>,
    /// The last link of the chain. `None` selects the whole tree.
    pub tip: Option<&'a str>,
    /// The treatment of mimic joints.
    pub mimic: MimicMode,
}
