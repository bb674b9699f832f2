//! Example robot models in the library. Their numbers are plausible, but they are not models of products.

use crate::error::{Error, Result};

/// The name and the URDF text of each example.
pub const EXAMPLES: [(&str, &str); 6] = [
    ("planar_2r", include_str!("planar_2r.urdf")),
    ("planar_pr", include_str!("planar_pr.urdf")),
    ("macro_micro_4r", include_str!("macro_micro_4r.urdf")),
    ("six_axis", include_str!("six_axis.urdf")),
    ("seven_axis", include_str!("seven_axis.urdf")),
    ("two_arms", include_str!("two_arms.urdf")),
];

/// Return the URDF text of the example `name`. Errors: `Unknown`, with a list of all names.
pub fn example_urdf(name: &str) -> Result<&'static str> {
    let found = EXAMPLES.iter().find(|(known, _)| *known == name).map(|(_, text)| *text);
    found.ok_or_else(|| Error::unknown("name", "", EXAMPLES.map(|(name, _)| name), name))
}
