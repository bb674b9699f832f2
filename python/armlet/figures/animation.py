"""A planar arm in motion as a GIF: its frames joined by lines, the way of its tip behind it."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .._core import Arm
from ..arguments import instance, integer, positive, shown
from ..errors import InputError
from ..files import write_whole
from .style import COLOURS, require, sheet

if TYPE_CHECKING:
    from ..run.recorded import Recorded

__all__ = ["animate"]

AXES = "xyz"
# Some minutes of film, and as many megabytes.
PICTURES = 20_000


def animate(run: Recorded, path: str | PathLike[str], arm: Any = None, *, fps: float = 25.0, speed: float = 1.0, size: int = 400) -> None:
    """Write the run of a planar arm as a GIF, whole or not at all.

    Args:
        run: the run.
        path: the file, which should end in .gif.
        arm: the arm, where the run does not know it: one that was loaded from a file.
        fps: pictures per second of the film, at most 50.
        speed: seconds of the run per second of the film.
        size: width and height, pixels.

    Raises:
        InputError: the arm has no frames or does not move in a plane along two of the axes, or an argument is out of range.
        ImportError: matplotlib is not installed.
    """
    fps, speed = positive("Run.animate", "fps", fps, 50.0), positive("Run.animate", "speed", speed, 1e9)
    size = int(positive("Run.animate", "size", integer("Run.animate", "size", size), 4096))
    arm = run.arm if arm is None else arm
    if arm is None:
        raise InputError("Run.animate: arm is missing: expected the arm of a run that was read from a file")
    instance("Run.animate", "arm", arm, Arm, "an Arm")
    if not arm.frame_names or len(run.t) < 2:
        raise InputError("Run.animate: there is nothing to draw: expected an arm with frames and a run of two records or more")
    if not (run.t[-1] - run.t[0]) * fps / speed <= PICTURES:
        raise InputError(f"Run.animate: speed is too small: expected at most {PICTURES} pictures, got {shown(speed)}")
    times = np.arange(run.t[0], run.t[-1], speed / fps)
    q = np.stack([np.interp(times, run.t, run.q[:, i]) for i in range(run.q.shape[1])], axis=1)
    points = np.stack([np.asarray(arm.position(q, frame)).reshape(len(times), 3) for frame in arm.frame_names], axis=1)
    points = np.concatenate([np.zeros((len(times), 1, 3)), points], axis=1)
    width = np.ptp(points.reshape(-1, 3), axis=0)
    flat = int(np.argmin(width))
    if width[flat] > 1e-9 * max(width.max(), 1.0):
        raise InputError(f"Run.animate: arm is not planar: expected frames in one plane, got frames that spread {width} m along x, y and z")
    axes = [i for i in range(3) if i != flat]
    tip = 1 + arm.frame_names.index(arm.tip_frame or arm.frame_names[-1])
    write_whole(path, lambda file: _film(file, points[..., axes], tip, times, axes, fps, size))


def _film(file: Any, points: NDArray[np.float64], tip: int, times: NDArray[np.float64], axes: list[int], fps: float, size: int) -> None:
    """Draw `points`, (times, frames, 2), with the way of frame number `tip`."""
    require("Run.animate")
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    with sheet(Figure(dpi=100), (size / 100, size / 100)) as figure:
        canvas: Any = FigureCanvasAgg(figure)
        ax = figure.subplots()
        centre, reach = (points.max((0, 1)) + points.min((0, 1))) / 2, 0.55 * np.ptp(points, axis=(0, 1)).max() + 1e-3
        ax.set_xlim(centre[0] - reach, centre[0] + reach)
        ax.set_ylim(centre[1] - reach, centre[1] + reach)
        ax.set_aspect("equal")
        ax.set_xlabel(f"{AXES[axes[0]]} (m)")
        ax.set_ylabel(f"{AXES[axes[1]]} (m)")
        (trace,) = ax.plot([], [], color=COLOURS[1], linewidth=1.0)
        (links,) = ax.plot([], [], color=COLOURS[0], linewidth=4.0, marker="o", markersize=7.0, solid_capstyle="round")
        pictures = []
        for k, time in enumerate(times):
            links.set_data(points[k, :, 0], points[k, :, 1])
            trace.set_data(points[: k + 1, tip, 0], points[: k + 1, tip, 1])
            ax.set_title(f"t = {time:.2f} s")
            canvas.draw()
            pictures.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy()))
        pictures[0].save(file, format="GIF", save_all=True, append_images=pictures[1:], duration=round(1000 / fps), loop=0)
