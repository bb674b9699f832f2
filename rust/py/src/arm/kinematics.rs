//! Poses of frames, their geometric Jacobians and rates, and the centre of mass, broadcast over leading axes.

use super::Arm;
use crate::arrays::written_array;
use crate::broadcast::{CHECK_PERIOD, broadcast, require_all_finite};
use crate::errors::Failure;
use crate::interrupts::long;
use armlet_core::arm::nearest_turn;
use armlet_core::dynamics::Quantity;
use armlet_core::interrupt;
use armlet_macros::entered;
use pyo3::prelude::*;

#[entered]
#[pymethods]
impl Arm {
    /// The position that is the same pose as `target` and nearest to `q`, `(..., n)`: whole turns are added to joints without limits.
    ///
    /// A law computes `target - q` and does not wrap angles. So a continuous joint at 3.13 rad with the target -3.13 rad moves 6.26 rad. With
    /// the target `nearest([-3.13], [3.13])` it moves 0.023 rad. Joints with limits and joints that slide keep the target. A joint with
    /// followers turns if each follower turns by a whole number of turns.
    ///
    /// Args:
    ///     target: positions, `(..., n)`, rad or m.
    ///     q: the positions to be near, `(..., n)`, rad or m, broadcast over the leading axes.
    ///
    /// Raises:
    ///     InputError: an argument is not finite or has the wrong shape.
    ///
    /// >>> import armlet as al
    /// >>> arm = al.planar_arm([1.0, 0.5])
    /// >>> arm.nearest([-3.13, 0.4], [3.13, 0.2]).round(3)
    /// array([3.153, 0.4  ])
    #[arguments(target, q)]
    fn nearest<'py>(&self) -> Result<Bound<'py, PyAny>, Failure> {
        let model = self.model.core();
        let (n, free) = (model.n(), model.turns_freely());
        let names = ["target", "q"];
        require_all_finite(NAME, names, [target, q])?;
        let rows = broadcast(NAME, names, [target, q], [n, n])?.owned()?;
        let mut shape = rows.shape.clone();
        shape.push(n);
        written_array(py, &shape, |out| {
            long(py, || {
                for (i, near) in out.chunks_exact_mut(n.max(1)).enumerate() {
                    if i % CHECK_PERIOD == 0 {
                        interrupt::check();
                    }
                    nearest_turn(&free, rows.row(0, i), rows.row(1, i), near);
                }
                Ok(())
            })
        })
    }

    /// The pose `X_WF` of a frame, `(..., 4, 4)`: a homogeneous transform, lengths in m.
    ///
    /// Args:
    ///     q: positions, `(..., n)`, rad or m.
    ///     frame: one of `frame_names`.
    ///     out: an array to write to (keyword only).
    ///
    /// Raises:
    ///     InputError: `q` is not finite or has the wrong shape, the frame is unknown, the arm has no links, or `out` cannot be written.
    ///
    /// >>> import armlet as al
    /// >>> al.planar_arm([1.0]).pose([0.0], "link1")
    /// array([[1., 0., 0., 1.],
    ///        [0., 1., 0., 0.],
    ///        [0., 0., 1., 0.],
    ///        [0., 0., 0., 1.]])
    #[arguments(q, frame, *, out=None)]
    fn pose<'py>(&self) -> PyResult<Bound<'py, PyAny>> {
        self.framed("pose", ["q"], [q], Quantity::Pose, frame, out)
    }

    /// The pose of a frame as six numbers, `(..., 6)`: its position in m, then its rotation vector `log R` in rad, both in world axes.
    ///
    /// The rotation vector is the rotation axis times the angle in [0, pi]. For the angle pi both signs of the axis are valid. With the
    /// axes "xyz rx ry rz", the target of a `CartesianImpedance` can be `arm.pose_vector(q, frame)`.
    ///
    /// Args and errors: as for `pose`.
    ///
    /// Source: Shepperd, Quaternion from rotation matrix, Journal of Guidance and Control 1(3), 1978.
    ///
    /// >>> import armlet as al
    /// >>> al.planar_arm([1.0, 0.5]).pose_vector([0.0, 0.5], "link1").tolist()
    /// [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    /// >>> al.planar_arm([1.0]).pose_vector([0.5], "link1").round(3)
    /// array([0.878, 0.479, 0.   , 0.   , 0.   , 0.5  ])
    #[arguments(q, frame, *, out=None)]
    fn pose_vector<'py>(&self) -> PyResult<Bound<'py, PyAny>> {
        self.framed("pose_vector", ["q"], [q], Quantity::PoseVector, frame, out)
    }

    /// The position `p_WF` of a frame's origin in the world, `(..., 3)`, m.
    ///
    /// Args and errors: as for `pose`.
    ///
    /// >>> import armlet as al
    /// >>> al.planar_arm([1.0, 0.5]).position([0.0, 0.0], "link2")
    /// array([1.5, 0. , 0. ])
    #[arguments(q, frame, *, out=None)]
    fn position<'py>(&self) -> PyResult<Bound<'py, PyAny>> {
        self.framed("position", ["q"], [q], Quantity::Position, frame, out)
    }

    /// The geometric Jacobian `J` of a frame, `(..., 6, n)`.
    ///
    /// `J v` is the velocity of the frame's origin in m/s, then the angular velocity in rad/s, both in world axes.
    ///
    /// Args and errors: as for `pose`.
    ///
    /// >>> import armlet as al
    /// >>> al.planar_arm([1.0]).jacobian([0.0], "link1")[:, 0].tolist()
    /// [0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    #[arguments(q, frame, *, out=None)]
    fn jacobian<'py>(&self) -> PyResult<Bound<'py, PyAny>> {
        self.framed("jacobian", ["q"], [q], Quantity::Jacobian, frame, out)
    }

    /// The time derivative `dJ/dt` of a frame's Jacobian, `(..., 6, n)`: the frame's acceleration is `J a + dJ/dt v`.
    ///
    /// Args:
    ///     q, v: positions (rad or m) and velocities (rad/s or m/s), `(..., n)`, broadcast over the leading axes.
    ///     frame, out: as for `pose`.
    ///
    /// Raises:
    ///     InputError: as for `pose`.
    ///
    /// >>> import armlet as al
    /// >>> al.planar_arm([1.0]).jacobian_dot([0.0], [2.0], "link1")[:2, 0].tolist()
    /// [-2.0, 0.0]
    #[arguments(q, v, frame, *, out=None)]
    fn jacobian_dot<'py>(&self) -> PyResult<Bound<'py, PyAny>> {
        self.framed("jacobian_dot", ["q", "v"], [q, v], Quantity::JacobianDot, frame, out)
    }

    /// The centre of mass of all moving bodies, in the world, `(..., 3)`, m.
    ///
    /// Args:
    ///     q: positions, `(..., n)`, rad or m.
    ///     out: an array to write to (keyword only).
    ///
    /// Raises:
    ///     InputError: `q` is not finite or has the wrong shape, the arm has no links or no mass, or `out` cannot be written.
    ///
    /// >>> import armlet as al
    /// >>> al.planar_arm([1.0]).center_of_mass([0.0])
    /// array([0.5, 0. , 0. ])
    #[arguments(q, *, out=None)]
    fn center_of_mass<'py>(&self) -> PyResult<Bound<'py, PyAny>> {
        self.kinematic("center_of_mass", q, Quantity::Com, out)
    }

    /// The Jacobian `J` of the centre of mass, `(..., 3, n)`: `J v` is the velocity of the centre of mass in world axes, m/s.
    ///
    /// Args and errors: as for `center_of_mass`.
    ///
    /// >>> import armlet as al
    /// >>> al.planar_arm([1.0]).center_of_mass_jacobian([0.0])[:, 0].tolist()
    /// [0.0, 0.5, 0.0]
    #[arguments(q, *, out=None)]
    fn center_of_mass_jacobian<'py>(&self) -> PyResult<Bound<'py, PyAny>> {
        self.kinematic("center_of_mass_jacobian", q, Quantity::ComJacobian, out)
    }
}
