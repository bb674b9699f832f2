//! Reader and writer of URDF.
//!
//! The reader reads links (as frames), the inertia of links, and joints with limits (revolute, continuous, prismatic, fixed, mimic). From
//! `<dynamics>` it reads damping, Coulomb friction, and the rotor inertia `armature`, which is an extension of URDF. The report counts all
//! other elements. Meshes are never opened. With `root` or `tip`, the arm is a part of the robot, and faults outside of this part are only
//! reported.
//!
//! In an arm, a body has a rotation matrix and ten inertial parameters. The angles and the centre of mass in a file may round them. In this
//! case, the writer adds the attribute `rotation` to `<origin>`, and `parameters` to `<inertial>`. These two attributes are also extensions
//! of URDF. The reader uses them if they agree with the rounded numbers. So an arm that URDF can represent has the same bits after it is
//! written and read again. If a user changes a rounded number in the file, the reader uses the changed number.
//!
//! Numbers beyond the limits of `plausible` are refused, because rounding errors would dominate the dynamics of such an arm.
//!
//! The folder is flat, because each element of URDF has one file.

#[cfg(feature = "urdf")]
mod assemble;
#[cfg(feature = "urdf")]
mod declaration;
#[cfg(feature = "urdf")]
mod element;
#[cfg(feature = "urdf")]
mod followers;
#[cfg(feature = "urdf")]
mod inertial;
#[cfg(feature = "urdf")]
mod joint;
#[cfg(feature = "urdf")]
mod link_tree;
#[cfg(feature = "urdf")]
mod options;
#[cfg(feature = "urdf")]
mod part;
// Without the feature `urdf`, only the writer uses this module, and some of its functions are unused.
#[cfg_attr(not(feature = "urdf"), allow(dead_code))]
mod plausible;
#[cfg(feature = "urdf")]
mod read;
#[cfg(feature = "urdf")]
mod source;
#[cfg(feature = "urdf")]
mod values;
mod write;
#[cfg(feature = "urdf")]
mod xacro;

#[cfg(feature = "urdf")]
pub use options::{MimicMode, UrdfOptions};
pub(super) use plausible::negative_moment;
#[cfg(feature = "urdf")]
pub use read::{MAX_BYTES, MAX_DEPTH, urdf_joints};
#[cfg(feature = "urdf")]
pub(crate) use read::{read_file, read_text};
pub use write::Written;
