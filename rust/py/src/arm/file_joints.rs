//! The moving joints of the model's file, including followers: joints whose position is `multiplier q_leader + offset`. Fixed joints are
//! not included.

use super::Arm;
use crate::arrays::{elements, written_array};
use crate::broadcast::{broadcast, require_all_finite};
use crate::errors::Failure;
use crate::interrupts::long;
use crate::properties::properties;
use armlet_core::dynamics::Quantity;
use armlet_core::interrupt;
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

properties!(Arm {
    /// Names of all moving joints, including mimic joints, which follow another joint. Without mimic joints they are `joint_names`.
    ///
    /// Fixed joints of the model's file are not included.
    ///
    /// >>> import armlet as al
    /// >>> finger = {"type": "P", "axis": [1, 0, 0], "parent": None, "phi": [0.1] + 9 * [0]}
    /// >>> gripper = al.Arm.from_chain([finger, {**finger, "mimic": {"joint": 0, "multiplier": -1.0}}])
    /// >>> gripper.n, gripper.joint_names, gripper.file_joint_names
    /// (1, ('joint1',), ('joint1', 'joint2'))
    file_joint_names: PyResult<Bound<'py, PyTuple>> = |arm, py| Self::named(py, &arm.model.file_joint_names());
    /// For each joint of `file_joint_names`, the index of its parent joint; -1 for a joint on the base.
    ///
    /// >>> import armlet as al
    /// >>> al.planar_arm([0.5, 0.4]).file_joint_parents
    /// (-1, 0)
    file_joint_parents: PyResult<Bound<'py, PyTuple>> = |arm, py| PyTuple::new(py, arm.model.file_joint_parents());
    /// For each frame of `frame_names`, the index in `file_joint_names` of the joint that moves it; -1 for a frame of the base.
    ///
    /// >>> import armlet as al
    /// >>> arm = al.planar_arm([0.5, 0.4])
    /// >>> arm.frame_names, arm.frame_joints
    /// (('link1', 'link2'), (0, 1))
    frame_joints: PyResult<Bound<'py, PyTuple>> = |arm, py| PyTuple::new(py, arm.model.frame_joints());
});

#[entered]
#[pymethods]
impl Arm {
    /// The pose of every joint of `file_joint_names`, `(..., len(file_joint_names), 4, 4)`: a homogeneous transform per joint, lengths in
    /// m.
    ///
    /// Each transform is the pose of the body that the joint moves. Its origin is on the joint axis. The property `file_joint_parents` has
    /// the index of each parent, so that lines from parent to joint draw the arm.
    ///
    /// Args:
    ///     q: positions, `(..., n)`, rad or m.
    ///     out: an array to write to (keyword only).
    ///
    /// Raises:
    ///     InputError: `q` is not finite or has the wrong shape, the arm has no links, or `out` cannot be written.
    ///
    /// Source: [Featherstone2008], chapter 4.
    ///
    /// >>> import armlet as al
    /// >>> al.planar_arm([0.5, 0.4]).file_joint_poses([0.0, 1.0])[:, :3, 3]
    /// array([[0. , 0. , 0. ],
    ///        [0.5, 0. , 0. ]])
    #[arguments(q, *, out=None)]
    fn file_joint_poses<'py>(&self) -> PyResult<Bound<'py, PyAny>> {
        self.kinematic("file_joint_poses", q, Quantity::JointPoses, out)
    }

    /// Positions of the joints of `file_joint_names`, `(..., len(file_joint_names))`, rad or m: `multiplier q_leader + offset` for mimic
    /// joints.
    ///
    /// Args:
    ///     q: positions, `(..., n)`, rad or m.
    ///
    /// Raises:
    ///     InputError: `q` is not finite or has the wrong shape.
    ///
    /// >>> import armlet as al
    /// >>> finger = {"type": "P", "axis": [1, 0, 0], "parent": None, "phi": [0.1] + 9 * [0]}
    /// >>> gripper = al.Arm.from_chain([finger, {**finger, "mimic": {"joint": 0, "multiplier": -1.0, "offset": 0.1}}])
    /// >>> gripper.file_positions([[0.0], [0.04]])
    /// array([[0.  , 0.1 ],
    ///        [0.04, 0.06]])
    fn file_positions<'py>(&self, q: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Failure> {
        const NAME: &str = "file_positions";
        require_all_finite(NAME, ["q"], [q])?;
        let inputs = broadcast(NAME, ["q"], [q], [self.model.n()])?.owned()?;
        let width = self.model.size().bodies;
        let shape: Vec<usize> = inputs.shape.iter().copied().chain([width]).collect();
        elements(&shape)?;
        written_array(py, &shape, |out| {
            long(py, || {
                for (i, out) in out.chunks_exact_mut(width.max(1)).enumerate() {
                    interrupt::check();
                    self.model.file_positions(inputs.row(0, i), out);
                }
                Ok(())
            })
        })
    }
}
