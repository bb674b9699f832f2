"""`armlet lab`: the laboratory on a page. Controls and handles write to the model from any thread, and one thread draws the model.

controls -> Lab -> poses at most 31 times, curves and text at most 4 times per second
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import armlet as al

from ..figures.style import COLOURS
from .model import FRAME, WINDOW, Lab
from .scene import ArmScene
from .server import Server, open_server, serve
from .systems import AdaptivePR, Choice, Control, Elastic, Limits, MinimumTime, Observer, Plot, Priority, Redundant, Robot, Stiction
from .urdf import missing_line
from .words import Words

__all__ = ["LabPage", "lab"]

DRAW_EVERY, PLOT_EVERY, TEXT_EVERY = 2, 16, 16  # periods, in frames, of drawing, curves and text
# The vertical axis of a chart contains at least the range from -EDGE to EDGE, so that rounding errors of a constant curve are not
# magnified. EDGE exceeds 0.01, because the label at 0.01 would be cut off at the edge.
EDGE = 1.2e-2
SOFT = {"pad": 0.1, "soft": EDGE, "mode": 1}
SCALES = {"x": {"time": False, "range": (-WINDOW, 0.0)}, "y": {"range": {"min": SOFT | {"soft": -EDGE}, "max": SOFT}}}
# Without this entry, the legend has a value of each curve at the mouse, which is "--" without a mouse on the chart.
LEGEND = {"live": False}
AXES = ({"label": "t - now (s)", "size": 36, "labelSize": 18}, {"size": 56})


def lab(urdf: Path | None, frame: str | None, host: str, port: int, packages: Sequence[Path] = ()) -> int:
    """Serve the laboratory until Ctrl-C and return the exit code. With `urdf` the robot of that file replaces the example."""
    if urdf is None:
        robot = Robot(al.example_urdf("seven_axis"), "Robot of seven axes", frame)
    else:
        robot = Robot(urdf, urdf.stem, frame, packages)
    systems = [AdaptivePR(), Priority(), Limits(), Elastic(), MinimumTime(), Redundant(), Observer(), Stiction(), robot]
    # The user's robot is the first system.
    model = Lab(systems if urdf is None else [robot, *systems[:-1]])
    page = LabPage(open_server("lab", host, port), model)
    return serve(page.server, page.frame, FRAME)


class LabPage:
    """The page of a laboratory. One thread calls `frame` repeatedly, which draws."""

    def __init__(self, server: Server, model: Lab) -> None:
        self.server, self.model = server, model
        self._count = 0
        self._requested: str | None = None
        gui = server.gui
        self.text = Words(gui)
        menu = self.menu = gui.add_dropdown("system", tuple(model.systems), initial_value=model.system.title)
        pause = gui.add_button("Pause")
        reset = gui.add_button("Reset")
        defaults = gui.add_button("Controls to their defaults")
        speed = gui.add_slider("desired speed (s per s)", 0.05, 2.0, 0.05, 1.0)
        self._hand = gui.add_slider("hand: spring of the pull (N/m)", 5.0, 500.0, 5.0, 60.0)

        # The menu only stores the choice. `frame` builds the page.
        @menu.on_update  # type: ignore[untyped-decorator]
        def _(_: Any) -> None:
            self._requested = menu.value

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
            nothing = (np.zeros(1), np.zeros(1))
            self.charts = [gui.add_uplot(nothing, ({}, {}), axes=AXES, scales=SCALES, legend=LEGEND, height=220) for _ in range(3)]
        self._panel.dock_left()
        self._build()

    def _build(self) -> None:
        """Build the parts of the page for the chosen system."""
        system, gui = self.model.system, self.server.gui
        reach = max(float(np.linalg.norm(system.arm.position(system.q0, frame))) for frame in system.arm.frame_names)
        self.scene = ArmScene(self.server, system.shapes, system.rotation, max(reach, 0.05))
        self.gizmos = {
            name: self.scene.handle(name, point, system.planar, lambda p, name=name: self.model.drag(name, p))  # type: ignore[misc]
            for name, point in system.targets.items()
        }
        self._resets = self.model.resets
        if system.takes_force:
            for frame, body in self.scene.bodies:
                self._pullable(frame, body)
        self._folder = gui.add_folder("Controls")
        with self._folder:
            self.controls = {control.name: self._control(control) for control in system.controls}
        with self.server.atomic():
            for handle, plot in zip(self.charts, system.plots, strict=True):
                self._label(handle, plot)
        self.scene.aim_camera()

    def _control(self, control: Control) -> Any:
        gui = self.server.gui
        if isinstance(control, Choice):
            handle = gui.add_dropdown(control.label, control.options, initial_value=control.value)
        else:
            low, high, value = (shown(control, x) for x in (control.low, control.high, control.value))
            step = 0.001 if control.powers else (high - low) / 400
            # The box of a slider over powers of ten shows the exponent. So the label and the marks show the number itself.
            decades = range(math.ceil(low), math.floor(high) + 1) if control.powers else ()
            marks = tuple((x, f"{10.0**x:g}") for x in decades) or None
            handle = gui.add_slider(labelled(control, control.value), low, high, step, value, marks=marks)

        @handle.on_update  # type: ignore[untyped-decorator]
        def _(_: Any) -> None:
            value = handle.value
            # A value from the page may arrive after the system has changed. Such a value is ignored.
            if control in self.model.system.controls:
                powers = not isinstance(control, Choice) and control.powers
                number = 10.0**value if powers else value
                self.model.set(control.name, number)
                handle.label = labelled(control, number)

        return handle

    def _label(self, handle: Any, plot: Plot) -> None:
        """Set the title and the curves of `plot` for a chart. Its data are one zero per curve until the next draw.

        Charts are never removed, because the server may still send data to a removed chart.
        """
        first = len(plot.curves) - plot.dashed
        series: list[dict[str, Any]] = [{"label": "t - now (s)"}]
        for k, name in enumerate(plot.curves):
            line: dict[str, Any] = {"label": name, "stroke": COLOURS[(k if k < first else k - first) % len(COLOURS)], "width": 1.5}
            if k >= first:
                line["dash"] = (6, 4)
            if plot.bands:
                line |= {"fill": line["stroke"], "fillTo": k + 1}
            series.append(line)
        handle.title, handle.series, handle.data = plot.title, tuple(series), tuple(np.zeros(1) for _ in series)

    def _pullable(self, frame: str, body: Any) -> None:
        turn, model = self.scene.rotation.T, self.model

        # This function is a coroutine, so that start, updates and end of a drag arrive in order.
        @body.on_drag  # type: ignore[untyped-decorator]
        async def _(event: Any) -> None:
            if event.phase == "start":
                model.grip(frame, turn @ np.array(event.start_position))
            if event.phase == "end":
                model.release()
            else:
                model.pull(turn @ np.array(event.end_position), float(self._hand.value))

    def frame(self, seconds: float) -> None:
        """Build the page of a newly chosen system, simulate `seconds` of the clock, and draw the state."""
        if self._requested is not None and self._requested != self.model.system.title:
            self.model.choose(self._requested)
            self.scene.clear()
            self._folder.remove()
            self._build()
        self._requested = None
        model, scene = self.model, self.scene
        model.advance(seconds)
        if self._resets != model.resets:
            self._resets = model.resets
            for name, gizmo in self.gizmos.items():
                gizmo.position = model.targets[name]
        if self._count % DRAW_EVERY == 0:
            with self.server.atomic():
                scene.place(model.poses())
                scene.goal(model.system.desired(model.t, model.values, model.targets))
        if self._count % PLOT_EVERY == 0:
            for handle, (t, *curves) in zip(self.charts, model.panels(), strict=True):
                # A reset may have emptied the curves.
                if len(t):
                    handle.data = (t - t[-1], *curves)
        if self._count % TEXT_EVERY == 0:
            self.text.show(*self.summary())
        self._count += 1

    def summary(self) -> list[str | tuple[str, str]]:
        """The status of the loop as paragraphs of text."""
        model = self.model
        state = ("", "paused" if model.paused else "running") if model.status is al.Status.SUCCESS else (model.status.name, "")
        numbers = f", t = {model.t:.2f} s, real-time factor {model.real_time_factor:.2f}, pull {np.linalg.norm(model.force):.1f} N"
        takes = "Drag a link to pull it, a" if model.system.takes_force else "Drag a"
        hint = f"{takes} coloured handle to move a target, the ground to turn the view."
        return [(state[0], state[1] + numbers), model.message, missing_line(model.system.missing), hint]


def shown(control: Control, value: float | str) -> Any:
    """The value of a control in the form that its slider shows: the logarithm if the slider has powers of ten."""
    return round(math.log10(float(value)), 3) if not isinstance(control, Choice) and control.powers else value


def labelled(control: Control, value: float | str) -> str:
    """The label of a control. For a slider of powers of ten it ends with the number, such as `gain (1/s): 50 = 10^`."""
    if isinstance(control, Choice) or not control.powers:
        return control.label
    return f"{control.label.removesuffix(', 10^')}: {float(value):.3g} = 10^"
