//! URDF in and out. Kept: links as frames, inertia, joints (revolute, continuous, prismatic, fixed), limits,
//! joints that follow others (mimic), damping, Coulomb friction, and rotor inertia as the attribute `armature` of `<dynamics>` (an extension: URDF
//! has no place for it). Everything else is counted in the report; meshes are never opened.
//!
//! Angles and centres of mass round what an arm holds, a rotation and ten parameters. Where they do, the writer adds these as the attributes
//! `rotation` of `<origin>` and `parameters` of `<inertial>` (extensions too), which the reader takes where they say the same as the rest:
//! what is written and read again is the same arm to the bit, and a number changed by hand still counts.
//!
//! Numbers that no machine has are refused (`plausible`), since the dynamics of such an arm would be rounding alone.

#[cfg(feature = "urdf")]
mod assemble;
#[cfg(feature = "urdf")]
mod declaration;
#[cfg(feature = "urdf")]
mod element;
// The writer alone needs a few of its bounds.
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
