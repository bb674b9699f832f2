//! The readers of URDF. The parser in `arm` makes the arm, and the test of its mass matrix adds a line to the arm's report.

use super::definite::indefinite;
use crate::arm::{Arm, UrdfOptions, read_file, read_text};
use crate::error::Result;
use std::path::Path;

impl Arm {
    /// Read a URDF text like [`Arm::read_urdf`]. `file`: name for errors. `gravity`: axes of the fixed base, m/s^2. `root` and `tip`: link
    /// names. The link `root` becomes the fixed base. With `tip`, only the joints between `root` and `tip` remain.
    pub fn from_urdf(text: &str, file: &str, gravity: [f64; 3], root: Option<&str>, tip: Option<&str>) -> Result<Arm> {
        Arm::read_urdf(text, file, &UrdfOptions { gravity: Some(gravity), root, tip, ..Default::default() })
    }

    /// Read a URDF text. `file`: name for errors. Errors: `Model` for a fault of the text, `Input` or `Unknown` for an option, `Memory`.
    ///
    /// The report of the arm lists unusual values, elements that are not used, and a mass matrix that is not positive definite.
    ///
    /// ```
    /// use armlet_core::arm::{Arm, UrdfOptions};
    ///
    /// // The link b has no inertia.
    /// let text = "<robot><link name='a'/><link name='b'/>
    ///     <joint name='j' type='continuous'><parent link='a'/><child link='b'/><axis xyz='0 0 1'/></joint></robot>";
    /// let arm = Arm::read_urdf(text, "text", &UrdfOptions::default())?;
    /// let line = "mass matrix not positive definite at 8 of 8 sampled configurations: joints j";
    /// assert!(arm.report.iter().any(|reported| reported == line));
    /// # Ok::<(), armlet_core::error::Error>(())
    /// ```
    pub fn read_urdf(text: &str, file: &str, options: &UrdfOptions) -> Result<Arm> {
        read_text(text, file, options).map(with_report_of_mass)
    }

    /// Read the URDF file `path`. Errors: `Input` for a file that cannot be read, and those of [`Arm::read_urdf`].
    pub fn load_urdf(path: &Path, options: &UrdfOptions) -> Result<Arm> {
        read_file(path, options).map(with_report_of_mass)
    }
}

/// Add the line about a mass matrix that is not positive definite to the report.
fn with_report_of_mass(mut arm: Arm) -> Arm {
    arm.report.extend(indefinite(&arm));
    arm
}
