"""`armlet view`: a robot on a page, with a slider per joint.

    X_WF = arm.pose(q, frame) for every frame, q from the sliders

The page is drawn again only after a control has changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import armlet as al

from .scene import ArmScene
from .server import Server, open_server, serve
from .shapes import Array
from .systems.robot import middle
from .urdf import missing_line, read_shapes
from .words import Words

__all__ = ["ViewPage", "roll_pitch_yaw", "view"]

PERIOD = 0.033  # time between two frames, s


def view(urdf: Path, host: str, port: int, packages: Sequence[Path] = ()) -> int:
    """Serve a robot until Ctrl-C and return the exit code. Its meshes are in its folder or in `packages`."""
    arm = al.load_urdf(urdf)
    page = ViewPage(open_server("view", host, port), arm, urdf, urdf.name, packages)
    return serve(page.server, lambda _: page.frame(), PERIOD)


def roll_pitch_yaw(R: Array) -> tuple[float, float, float]:
    """The angles of `R = Rz(yaw) Ry(pitch) Rx(roll)`, rad. If the pitch is +-pi/2, the roll is set to zero."""
    cosine = float(np.hypot(R[0, 0], R[1, 0]))
    pitch = float(np.arctan2(-R[2, 0], cosine))
    if cosine < 1e-9:  # the axes of roll and yaw are parallel
        return 0.0, pitch, float(np.arctan2(-R[0, 1], R[1, 1]))
    return float(np.arctan2(R[2, 1], R[2, 2])), pitch, float(np.arctan2(R[1, 0], R[0, 0]))


class ViewPage:
    """The page of a robot."""

    def __init__(self, server: Server, arm: al.Arm, source: str | Path, title: str, packages: Sequence[Path] = ()) -> None:
        self.server, self.arm = server, arm
        self.start = middle(arm)
        reach = max(float(np.linalg.norm(arm.position(self.start, frame))) for frame in arm.frame_names)
        looks = read_shapes(source, arm, packages)
        self.scene = ArmScene(server, looks.shapes, np.eye(3), max(reach, 0.05))
        gui = server.gui
        Words(gui, (title, f": {arm.n} joints, {len(arm.frame_names)} frames"), missing_line(looks.missing))
        self._axes = gui.add_checkbox("show frames", False)
        self._frame = gui.add_dropdown("frame", arm.frame_names, initial_value=arm.tip_frame or arm.frame_names[-1])
        self.text = Words(gui)
        reset = gui.add_button("Reset")
        with gui.add_folder("Joints (rad, m)"):
            self.sliders = [self._slider(i) for i in range(arm.n)]
        self._drawn: Any = None

        @reset.on_click  # type: ignore[untyped-decorator]
        def _(_: Any) -> None:
            for slider, value in zip(self.sliders, self.start, strict=True):
                slider.value = value

        self.scene.aim_camera()
        self.frame()

    def _slider(self, i: int) -> Any:
        low, high = float(self.arm.limits["q_min"][i]), float(self.arm.limits["q_max"][i])
        # A joint without limits has the range +-pi rad or +-1 m.
        far = 1.0 if self.arm.joint_types[i] == "prismatic" else np.pi
        low, high = low if np.isfinite(low) else -far, high if np.isfinite(high) else far
        # Both limits may be equal, but a slider requires a range.
        high = max(high, low + 1e-6)
        return self.server.gui.add_slider(self.arm.joint_names[i], low, high, (high - low) / 1000, float(self.start[i]))

    @property
    def q(self) -> Array:
        """Joint positions of the sliders, (n,), rad or m."""
        return np.array([slider.value for slider in self.sliders], dtype=np.float64)

    def frame(self) -> None:
        """Draw the arm at the positions of the sliders, if a control has changed."""
        now = (*self.q, self._axes.value, self._frame.value)
        if now == self._drawn:
            return
        self._drawn, q = now, self.q
        with self.server.atomic():
            self.scene.place({frame: np.asarray(self.arm.pose(q, frame)) for frame in self.scene.frames})
        for handle in self.scene.frames.values():
            handle.show_axes = self._axes.value
        pose = np.asarray(self.arm.pose(q, self._frame.value))
        x, y, z = pose[:3, 3]
        roll, pitch, yaw = roll_pitch_yaw(pose[:3, :3])
        load = ", ".join(f"{tau:.2f}" for tau in np.round(self.arm.gravity(q), 2) + 0.0)
        turned = f"roll, pitch, yaw = ({roll:.3f}, {pitch:.3f}, {yaw:.3f}) rad"
        self.text.show(f"{self._frame.value} at ({x:.3f}, {y:.3f}, {z:.3f}) m", turned, f"gravity g(q) = ({load}) N m, N")
