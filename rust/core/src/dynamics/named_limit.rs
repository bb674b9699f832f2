//! The joint of a refused limit. A robot file may have limits of effort and velocity of zero or less. If such a limit is passed as an
//! argument `tau_..` or `v_..`, the error names the joint and the limit in the file.

use super::Model;
use crate::error::Error;

impl Model {
    /// Return the error. If it is about a limit of a joint, and the joint's own limit is not positive, add the joint's name and own limit.
    ///
    /// ```
    /// use armlet_core::arm::{Arm, STANDARD_GRAVITY};
    /// use armlet_core::dynamics::Model;
    /// use armlet_core::error::Error;
    ///
    /// let text = r#"<robot><link name="a"/><link name="b"/><joint name="hip" type="continuous"><parent link="a"/><child link="b"/>
    ///     <limit effort="0" velocity="2"/></joint></robot>"#;
    /// let model = Model::from(Arm::from_urdf(text, "robot.urdf", STANDARD_GRAVITY, None, None)?);
    /// let error = model.name_limit(Error::input("tau_max", "is not positive: expected > 0, got 0").at([0]));
    /// let message = "tau_max is not positive: expected > 0, got 0 (joint hip has the effort limit 0 in its file) (first bad index 0)";
    /// assert_eq!(error.to_string(), message);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn name_limit(&self, mut error: Error) -> Error {
        let (Model::Tree(arm), Error::Input { argument, problem, index }) = (self, &mut error) else { return error };
        let &[i] = &index[..] else { return error };
        let Some(joint) = arm.independent().nth(i) else { return error };
        let (what, limit) = if argument.starts_with("tau_") {
            ("effort", joint.limits.effort)
        } else if argument.starts_with("v_") {
            ("velocity", joint.limits.velocity)
        } else {
            return error;
        };
        if limit <= 0.0 {
            *problem += &format!(" (joint {} has the {what} limit {limit} in its file)", joint.name);
        }
        error
    }
}
