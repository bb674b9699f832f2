//! Reader and writer of URDF.
//!
//! The reader uses links as frames, inertia, and joints with limits (revolute, continuous, prismatic, fixed, mimic). It uses damping,
//! Coulomb friction, and the rotor inertia `armature` of `<dynamics>`, an extension of URDF. The report counts all other elements. Meshes
//! are never opened.
//!
//! In an arm, a body has a rotation matrix and ten inertial parameters. Angles and centres of mass in a file may round them. Then the
//! writer adds the attribute `rotation` to `<origin>`, and `parameters` to `<inertial>`. These two attributes are also extensions of URDF.
//! The reader uses them if they agree with the rounded numbers. So an arm that URDF can represent has the same bits after it is written and
//! read again. A number changed by hand is effective.
//!
//! Numbers beyond the limits of `plausible` are refused, because rounding errors would dominate the dynamics of such an arm.

#[cfg(feature = "urdf")]
mod assemble;
#[cfg(feature = "urdf")]
mod declaration;
#[cfg(feature = "urdf")]
mod element;
#[cfg(feature = "urdf")]
mod followers;
#[cfg(feature = "urdf")]
mod options;
// Without the feature `urdf`, only the writer uses the limits of this module, and not all of them.
#[cfg_attr(not(feature = "urdf"), allow(dead_code))]
mod plausible;
#[cfg(feature = "urdf")]
mod read;
#[cfg(feature = "urdf")]
mod source;
mod write;

#[cfg(feature = "urdf")]
pub use options::{MimicMode, UrdfOptions};
pub(super) use plausible::negative_moment;
#[cfg(feature = "urdf")]
pub use read::{MAX_BYTES, MAX_DEPTH};
pub use write::Written;
