//! The figure of an arm at one configuration, which `armlet.figures.arm` draws.

use super::Arm;
use crate::errors::Failure;
use armlet_macros::entered;
use pyo3::prelude::*;

#[entered]
#[pymethods]
impl Arm {
    /// Draw the arm at the positions `q`: its links, its joints with their axes, and named frames. It requires matplotlib (extra `plot`).
    ///
    /// Blue lines are the links, grey lines the displacements of prismatic joints. A coloured bar at each joint has the direction of the
    /// joint axis, and the colour of the joint in `Run.plot`. The axes of a frame are red (x), green (y) and blue (z). An arm whose joints
    /// and frames are in a plane of two world axes is drawn in that plane, with dots for axes across it. Another arm, or any arm with `view`,
    /// is drawn in space, with its shadow on the floor of the figure. A notebook shows the figure below the cell.
    ///
    /// Args:
    ///     q: positions, `(n,)`, rad or m.
    ///     frames: names of the frames to draw (keyword only). None means `tip_frame`, and the ends of other branches that are not close to it.
    ///     view: elevation and azimuth of the eye, `(2,)`, degrees (keyword only). None means the plane of the arm if it has one.
    ///     fig: a matplotlib figure for the drawing (keyword only). None makes one with pyplot.
    ///
    /// Returns:
    ///     The axes of the drawing, a `matplotlib.axes.Axes`, in world axes and m.
    ///
    /// Raises:
    ///     InputError: `q` or `view` is not finite or has the wrong shape, a frame is unknown, or the arm has no frame that moves.
    ///     ImportError: matplotlib is not installed.
    ///
    /// Source: docs/arms.md.
    ///
    /// >>> import armlet as al
    /// >>> from matplotlib.figure import Figure
    /// >>> ax = al.load_urdf(al.example_urdf("planar_2r")).show([0.4, 0.8], fig=Figure())
    /// >>> ax.get_xlabel()
    /// 'x (m)'
    #[arguments(q, *, frames=None, view=None, fig=None)]
    fn show<'py>(slf: &Bound<'py, Self>) -> Result<Bound<'py, PyAny>, Failure> {
        Ok(py.import("armlet.figures.arm")?.getattr("show")?.call1((slf, q, frames, view, fig))?)
    }
}
