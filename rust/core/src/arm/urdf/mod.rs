//! Reads and writes URDF.
//!
//! The reader uses links as frames, inertia, joints (revolute, continuous, prismatic, fixed) with limits, and joints that follow others (mimic).
//! It uses damping, Coulomb friction, and the rotor inertia `armature` of `<dynamics>`, an extension of URDF. The report counts everything
//! else. Meshes are never opened.
//!
//! An arm has a rotation and ten parameters per body. Angles and centres of mass in a file may round them. Then the writer adds the
//! attributes `rotation` of `<origin>` and `parameters` of `<inertial>`, two more extensions. The reader uses them if they agree with the
//! rounded numbers. So an arm that is written and read again has the same bits, and a number changed by hand is effective.
//!
//! Implausible numbers are refused (`plausible`), because rounding errors would dominate the dynamics of such an arm.

#[cfg(feature = "urdf")]
mod assemble;
#[cfg(feature = "urdf")]
mod declaration;
#[cfg(feature = "urdf")]
mod element;
// Without the reader, the writer uses only some of the bounds.
#[cfg(feature = "urdf")]
mod followers;
#[cfg_attr(not(feature = "urdf"), allow(dead_code))]
mod plausible;
#[cfg(feature = "urdf")]
mod read;
mod write;

#[cfg(feature = "urdf")]
pub use followers::MimicMode;
pub(super) use plausible::negative_moment;
#[cfg(feature = "urdf")]
pub use read::{MAX_BYTES, MAX_DEPTH, UrdfOptions};
pub use write::Written;
