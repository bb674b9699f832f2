"""`armlet lab`: the laboratory on a page. Buttons and handles write to the model, from any thread; one thread draws it.

    controls -> Lab -> poses at 60 Hz, curves at 6 Hz

What is drawn is drawn by that thread alone, so that no handle is written to after it has left the page.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import armlet as al

from ..plots import COLOURS
from .model import FRAME, Lab
from .scene import ArmScene
from .server import Server, open_server, serve
from .shapes import Array
from .systems import AdaptivePR, Choice, Control, Elastic, MinimumTime, Plot, Priority, Robot

__all__ = ["LabPage", "lab"]

PLOT_EVERY = 10  # frames
TEXT_EVERY = 12
TIME = {"time": False}  # the axis of time counts seconds, not dates


def lab(urdf: Path | None, frame: str | None, host: str, port: int) -> int:
    """Serve the laboratory until Ctrl-C, with the robot of a file among its systems; the exit code."""
    if urdf is None:
        robot = Robot(al.example_urdf("seven_axis"), "Robot of seven axes", frame)
    else:
        robot = Robot(urdf, urdf.stem, frame)
    systems = [AdaptivePR(), Priority(), Elastic(), MinimumTime(), robot]
    # Who brings a robot wants to see it.
    model = Lab(systems if urdf is None else [robot, *systems[:-1]])
    page = LabPage(open_server("lab", host, port), model)
    return serve(page.server, page.frame, FRAME)


class LabPage:
    """The page of a laboratory; `frame` is called over and over and does everything that is drawn."""

    def __init__(self, server: Server, model: Lab) -> None:
        self.server, self.model = server, model
        self._count = 0
        self._asked: str | None = None
        gui = server.gui
        self.text = gui.add_markdown("")
        menu = gui.add_dropdown("system", tuple(model.systems), initial_value=model.system.title)
        pause = gui.add_button("Pause")
        reset = gui.add_button("Reset")
        defaults = gui.add_button("Controls to their defaults")
        speed = gui.add_slider("speed asked for (s per s)", 0.05, 2.0, 0.05, 1.0)
        self._hand = gui.add_slider("hand: spring of the pull (N/m)", 5.0, 500.0, 5.0, 60.0)

        # Only a wish: `frame` builds the page.
        @menu.on_update  # type: ignore[untyped-decorator]
        def _(_: Any) -> None:
            self._asked = menu.value

        @pause.on_click  # type: ignore[untyped-decorator]
        def _(_: Any) -> None:
            model.paused = not model.paused
            pause.label = "Go on" if model.paused else "Pause"

        @reset.on_click  # type: ignore[untyped-decorator]
        def _(_: Any) -> None:
            model.reset()

        @defaults.on_click  # type: ignore[untyped-decorator]
        def _(_: Any) -> None:
            for control in model.system.controls:
                self.controls[control.name].value = shown(control, control.value)
                model.set(control.name, control.value)

        @speed.on_update  # type: ignore[untyped-decorator]
        def _(_: Any) -> None:
            model.speed = float(speed.value)

        self._panel = gui.add_panel()
        with self._panel.add_tab("Curves"):
            self._curves = gui.add_folder("over the last 8 s")
        self._panel.dock_left()
        self._build()

    def _build(self) -> None:
        """The parts that belong to the chosen system."""
        system, gui = self.model.system, self.server.gui
        reach = max(float(np.linalg.norm(system.arm.position(system.q0, frame))) for frame in system.arm.frame_names)
        self._scene = ArmScene(self.server, system.shapes, system.rotation, max(reach, 0.05))
        self.gizmos = {
            name: self._scene.handle(name, point, system.planar, lambda p, name=name: self.model.drag(name, p))  # type: ignore[misc]
            for name, point in system.targets.items()
        }
        self._resets = self.model.resets
        if system.takes_force:
            for frame, body in self._scene.bodies:
                self._pullable(frame, body)
        self._folder = gui.add_folder("Controls")
        with self._folder:
            self.controls = {control.name: self._control(control) for control in system.controls}
        with self._curves:
            self._plots = [self._plot(plot) for plot in system.plots]
        self._scene.look()

    def _control(self, control: Control) -> Any:
        gui = self.server.gui
        if isinstance(control, Choice):
            handle = gui.add_dropdown(control.label, control.options, initial_value=control.value)
        else:
            low, high, value = (shown(control, x) for x in (control.low, control.high, control.value))
            handle = gui.add_slider(control.label, low, high, (high - low) / 400, value)

        @handle.on_update  # type: ignore[untyped-decorator]
        def _(_: Any) -> None:
            value = handle.value
            # A value that was on its way when the system changed belongs to nobody.
            if control in self.model.system.controls:
                powers = not isinstance(control, Choice) and control.powers
                self.model.set(control.name, 10.0**value if powers else value)

        return handle

    def _plot(self, plot: Plot) -> Any:
        first = len(plot.curves) - plot.dashed
        series: list[dict[str, Any]] = [{"label": "t (s)"}]
        for k, name in enumerate(plot.curves):
            line: dict[str, Any] = {"label": name, "stroke": COLOURS[(k if k < first else k - first) % len(COLOURS)], "width": 1.5}
            if k >= first:
                line["dash"] = (6, 4)
            series.append(line)
        empty = tuple(np.zeros(1) for _ in series)
        axes = ({"label": "t (s)", "size": 36, "labelSize": 18}, {"size": 56})
        return self.server.gui.add_uplot(empty, tuple(series), title=plot.title, axes=axes, scales={"x": TIME}, height=220)

    def _pullable(self, frame: str, body: Any) -> None:
        turn, model = self._scene.rotation.T, self.model

        # A coroutine, so that start, updates and end come in order.
        @body.on_drag  # type: ignore[untyped-decorator]
        async def _(event: Any) -> None:
            if event.phase == "start":
                model.grip(frame, turn @ np.array(event.start_position))
            if event.phase == "end":
                model.release()
            else:
                model.pull(turn @ np.array(event.end_position), float(self._hand.value))

    def frame(self, seconds: float) -> None:
        """Run the loop for `seconds` of the clock and draw where it stands."""
        if self._asked is not None and self._asked != self.model.system.title:
            self.model.choose(self._asked)
            self._scene.clear()
            for handle in (self._folder, *self._plots):
                handle.remove()
            self._build()
        self._asked = None
        model, scene = self.model, self._scene
        model.advance(seconds)
        if self._resets != model.resets:
            self._resets = model.resets
            for name, gizmo in self.gizmos.items():
                gizmo.position = model.targets[name]
        with self.server.atomic():
            scene.place(model.poses())
            scene.pull(model.spring())
            scene.goal(model.system.desired(model.t, model.values, model.targets))
        if self._count % PLOT_EVERY == 0 and model.curves:
            for handle, curves in zip(self._plots, model.panels(), strict=True):
                handle.data = curves
                scales = {"x": TIME} | flat(curves[1:])
                # New scales cost the browser a new chart.
                if handle.scales != scales:
                    handle.scales = scales
        if self._count % TEXT_EVERY == 0:
            self.text.content = self.summary()
        self._count += 1

    def summary(self) -> str:
        """How the loop fares, in markdown."""
        model = self.model
        state = "paused" if model.paused else "running"
        if model.status is not al.Status.SUCCESS:
            state = f"**{model.status.name}**"
        lines = [f"{state}, t = {model.t:.2f} s, real-time factor {model.pace:.2f}, pull {np.linalg.norm(model.force):.1f} N"]
        if model.message:
            lines.append(f"*{model.message}*")
        takes = "Drag a link to pull it, a" if model.system.takes_force else "Drag a"
        return "\n\n".join([*lines, f"{takes} coloured handle to move a target, the ground to turn the view."])


def flat(curves: Sequence[Array]) -> dict[str, Any]:
    """A fixed axis for curves that do not move: left alone, the chart would magnify their rounding."""
    low, high = min(map(np.min, curves)), max(map(np.max, curves))
    if high - low > 1e-6 * max(1.0, abs(high)):
        return {}
    middle = float(f"{high:.3g}")
    return {"y": {"range": (middle - 0.01, middle + 0.01)}}


def shown(control: Control, value: float | str) -> Any:
    """A value of a control as its slider shows it."""
    return math.log10(float(value)) if not isinstance(control, Choice) and control.powers else value
