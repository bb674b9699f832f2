"""For every argument, errors are an ArmletError, TypeError, MemoryError or OSError. The command line prints no traceback."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

import armlet as al
from armlet import cli, gym
from armlet.scenario import file as reading

ALLOWED = (al.ArmletError, TypeError, MemoryError, OSError)
PR = models.PR
PLANT, LAW = al.RigidArm(PR), al.ComputedTorque(PR, al.Hold([1.0, 0.0]), 100.0, 20.0)
RUN = al.simulate(PLANT, LAW, [0.0, 0.0], t_end=0.01, dt=1e-3)
DENSE = al.simulate(PLANT, LAW, [0.0, 0.0], t_end=0.01, method="dopri5", dense=True)
EVENTS = al.simulate(PLANT, LAW, [0.0, 0.0], t_end=0.01, method="dopri5", events=[al.Event.joint(0, 1e-4)]).events
TABLES: dict[str, Any] = {
    "arm": {"kind": "planar_pr", "A": 2.0, "B": 0.5, "C": 0.5},
    "motion": {"kind": "Hold", "q": [1.0, 0.0]},
    "law": {"kind": "ComputedTorque", "kp": 100.0, "kd": 20.0},
    "run": {"q0": [0.0, 0.0], "t_end": 0.002, "dt": 1e-3},
}
SCENARIO = al.Scenario(TABLES)
TABLE = al.sweep(SCENARIO, {"law.kp": [50.0, 100.0]})
METRICS = al.metrics(RUN)
SPAN: dict[str, Any] = {"t_end": 0.002, "dt": 1e-3}
FEW: dict[str, Any] = {"vary": {"law.kp": {"uniform": [1.0, 2.0]}}, "cost": "error_rms1", "candidates": 5, "generations": 0}


class Shrinking:
    """A sequence whose reported length is larger than its number of entries."""

    def __len__(self) -> int:
        return 3

    def __getitem__(self, index: int) -> float:
        if index:
            raise IndexError(index)
        return 1.0


class Nameless(type):
    """A metaclass that hides the module and the name of its classes."""

    def __getattribute__(cls, name: str) -> Any:
        if name == "__module__":
            raise AttributeError(name)
        return super().__getattribute__(name)


class Stranger(metaclass=Nameless):
    """An object whose `repr` fails."""

    def __repr__(self) -> str:
        raise LookupError("mine")


def nested(make: Callable[[Any], Any], levels: int = 5000) -> Any:
    inner: Any = 1.0
    for _ in range(levels):
        inner = make(inner)
    return inner


DICTS, LISTS = nested(lambda inner: {"a": inner}), nested(lambda inner: [inner])
CIRCLE: dict[str, Any] = {}
CIRCLE["arm"] = CIRCLE
NUMBERS: list[Any] = [0, -1, 1.0, float("nan"), float("inf"), 10**400, -(2**70), True, 1e-320]
TEXTS: list[Any] = ["", "x", "a\0b", "\ud800", "law.kp", b"x"]
LISTED: list[Any] = [[], [None], ["x"], [[]], [1, [2]], (), {}, {"a": 1}, {1: 2}, {"a": {"b": None}}, set(), DICTS, LISTS, CIRCLE]
ARRAYS: list[Any] = [np.zeros(0), np.zeros(2), np.zeros((2, 2)), np.array("x"), np.array([1j, 2]), np.array([None, None])]
OBJECTS: list[Any] = [Shrinking(), Stranger(), None, object(), len, slice(None), ..., PR, LAW, RUN]
MASKED = [np.ma.masked_array([1.0, 2.0], [True, False])]
JUNK = [*NUMBERS, *TEXTS, *LISTED, *ARRAYS, *OBJECTS, *MASKED]

#: Calls with one argument that can be any object.
CALLS: dict[str, Callable[[Any], Any]] = {
    "Contact": lambda x: al.Contact(x, 1, np.ones(2)),
    "Contact.joint": lambda x: al.Contact(0.1, x, np.ones(2)),
    "Contact.residual": lambda x: al.Contact(0.1, 1, x),
    "Samples": lambda x: al.Samples(np.ones((1, 1, 2)), np.ones((1, 1)), x, 1.0, 1),
    "Samples.W": lambda x: al.Samples(x, np.ones((1, 1)), np.arange(1), 1.0, 1),
    "Samples.rank": lambda x: al.Samples(np.ones((1, 1, 2)), np.ones((1, 1)), np.arange(1), 1.0, x),
    "Samples.singular_value": lambda x: al.Samples(np.ones((1, 1, 2)), np.ones((1, 1)), np.arange(1), x, 1),
    "metrics": al.metrics,
    "metrics(reference)": lambda x: al.metrics(RUN, reference=x),
    "metrics(band)": lambda x: al.metrics(RUN, band=x),
    "metrics(settle)": lambda x: al.metrics(RUN, settle=x),
    "metrics(tolerance)": lambda x: al.metrics(RUN, tolerance=x),
    "metrics(frame)": lambda x: al.metrics(RUN, frame=x),
    "compare": al.compare,
    "compare([..])": lambda x: al.compare([x]),
    "compare(labels)": lambda x: al.compare([RUN], x),
    "compare(fig)": lambda x: al.compare([RUN], fig=x),
    "Scenario": al.Scenario,
    "Scenario(folder)": lambda x: al.Scenario(TABLES, x),
    "Scenario(name)": lambda x: al.Scenario(TABLES, ".", x),
    "Scenario.load": al.Scenario.load,
    "Scenario.from_dict": al.Scenario.from_dict,
    "Scenario.replace": SCENARIO.replace,
    "Scenario.replace({..: })": lambda x: SCENARIO.replace({x: 1.0}),
    "Scenario.replace({: ..})": lambda x: SCENARIO.replace({"law.kp": x}),
    "Event": lambda x: al.Event(x, (0, 0.1)),
    "Event(arguments)": lambda x: al.Event("joint", x),
    "Event.joint": lambda x: al.Event.joint(x, 0.5),
    "Event.joint(value)": lambda x: al.Event.joint(0, x),
    "Event.joint(stop)": lambda x: al.Event.joint(0, 0.5, stop=x),
    "Event.joint(direction)": lambda x: al.Event.joint(0, 0.5, direction=x),
    "Event.joint(name)": lambda x: al.Event.joint(0, 0.5, name=x),
    "Event.plane": lambda x: al.Event.plane(x, [0, 0, 0], [1, 0, 0]),
    "Event.plane(point)": lambda x: al.Event.plane("link2", x, [1, 0, 0]),
    "Event.joint_stop": lambda x: al.Event.joint_stop(0, x),
    "Event.function": al.Event.function,
    "Events.of": lambda x: EVENTS.of(x),
    "JointStops": al.JointStops,
    "JointStops(lower)": lambda x: al.JointStops(1.0, lower=x),
    "Sampling": lambda x: al.simulate(PLANT, LAW, [0.0, 0.0], t_end=0.002, dt=1e-3, sample_time=al.Sampling(x)),
    "Sampling(noise)": lambda x: al.Sampling(1e-3, noise=x),
    "simulate(events)": lambda x: al.simulate(PLANT, LAW, [0.0, 0.0], t_end=0.002, method="dopri5", events=x),
    "simulate(events=[..])": lambda x: al.simulate(PLANT, LAW, [0.0, 0.0], t_end=0.002, method="dopri5", events=[x]),
    "simulate(plant)": lambda x: al.simulate(x, LAW, [0.0, 0.0], t_end=0.002, dt=1e-3),
    "simulate(q0)": lambda x: al.simulate(PLANT, LAW, x, t_end=0.002, dt=1e-3),
    "simulate(throw)": lambda x: al.simulate(PLANT, LAW, [0.0, 0.0], t_end=0.002, dt=1e-3, throw=x),
    "simulate(sample_time)": lambda x: al.simulate(PLANT, LAW, [0.0, 0.0], t_end=0.002, dt=1e-3, sample_time=x),
    "loop_program(plant)": lambda x: al.loop_program(x, LAW),
    "loop_program(law)": lambda x: al.loop_program(PLANT, x),
    "loop_program(method)": lambda x: al.loop_program(PLANT, LAW, method=x),
    "loop_program(sample_time)": lambda x: al.loop_program(PLANT, LAW, method="euler", sample_time=x),
    "loop_program(force)": lambda x: al.loop_program(PLANT, LAW, method="euler", force=x),
    "loop_program(force_frame)": lambda x: al.loop_program(PLANT, LAW, method="euler", force_frame=x),
    "loop_program(tau_max)": lambda x: al.loop_program(PLANT, LAW, method="euler", tau_max=x),
    "loop_program(batch)": lambda x: al.loop_program(PLANT, LAW, method="euler", batch=x),
    "loop_program(part)": lambda x: al.loop_program(PLANT, LAW, method="euler", part=x),
    "loop_program(stage)": lambda x: al.loop_program(PLANT, LAW, method="euler", stage=x),
    "export_c(law)": lambda x: al.export_c(x, "c"),
    "export_c(folder)": lambda x: al.export_c(LAW, x),
    "export_c(functions)": lambda x: al.export_c(PR, "c", functions=x),
    "export_c(prefix)": lambda x: al.export_c(LAW, "c", prefix=x),
    "export_c(dt)": lambda x: al.export_c(LAW, "c", dt=x),
    "export_c(method)": lambda x: al.export_c(LAW, "c", method=x),
    "export_c(friction)": lambda x: al.export_c(PR, "c", friction=x),
    "export_c(armature)": lambda x: al.export_c(PR, "c", armature=x),
    "export_c(fused)": lambda x: al.export_c(LAW, "c", fused=x),
    "export_c(overwrite)": lambda x: al.export_c(LAW, "c", overwrite=x),
    "export_web(loop)": lambda x: al.export_web(x, "p.html", q0=[0.0, 0.0]),
    "export_web(plant)": lambda x: al.export_web((x, LAW), "p.html", q0=[0.0, 0.0]),
    "export_web(law)": lambda x: al.export_web((PLANT, x), "p.html", q0=[0.0, 0.0]),
    "export_web(path)": lambda x: al.export_web((PLANT, LAW), x, q0=[0.0, 0.0]),
    "export_web(controls)": lambda x: al.export_web((PLANT, LAW), "p.html", x, q0=[0.0, 0.0]),
    "export_web(controls[..])": lambda x: al.export_web((PLANT, LAW), "p.html", {"law.kp": x}, q0=[0.0, 0.0]),
    "export_web(q0)": lambda x: al.export_web((PLANT, LAW), "p.html", q0=x),
    "export_web(dt)": lambda x: al.export_web((PLANT, LAW), "p.html", q0=[0.0, 0.0], dt=x),
    "export_web(method)": lambda x: al.export_web((PLANT, LAW), "p.html", q0=[0.0, 0.0], method=x),
    "export_web(sample_time)": lambda x: al.export_web((PLANT, LAW), "p.html", q0=[0.0, 0.0], sample_time=x),
    "export_web(tau_max)": lambda x: al.export_web((PLANT, LAW), "p.html", q0=[0.0, 0.0], tau_max=x),
    "export_web(force)": lambda x: al.export_web((PLANT, LAW), "p.html", q0=[0.0, 0.0], force=x, force_frame="link1"),
    "export_web(force_frame)": lambda x: al.export_web((PLANT, LAW), "p.html", q0=[0.0, 0.0], force=[1.0, 0.0, 0.0], force_frame=x),
    "export_web(title)": lambda x: al.export_web((PLANT, LAW), "p.html", q0=[0.0, 0.0], title=x),
    "LoopProgram.at": lambda x: al.loop_program(PLANT, LAW, method="euler").at(x),
    "LoopProgram.plot": lambda x: al.loop_program(PLANT, LAW, method="euler").plot(x),
    "load": al.load,
    "Run.metrics": lambda x: RUN.metrics(reference=x),
    "Run.plot": RUN.plot,
    "sweep": al.sweep,
    "tune": lambda x: al.tune(x, {"law.kp": (1.0, 50.0)}),
    "verify": lambda x: al.verify(PR, against=x),
    "from_mujoco": al.from_mujoco,
    "equilibrium": lambda x: al.equilibrium(PLANT, LAW, x, q0=[0.0, 0.0]),
    "scipy_method": al.scipy_method,
    "diagnose_priority": lambda x: al.diagnose_priority(x, [np.zeros(1)]),
    "point_to_point": lambda x: al.point_to_point(x, [1.0], [1.0], [1.0], [1.0]),
    "load_urdf": al.load_urdf,
    "Metrics.unit": METRICS.unit,
    "Metrics.unit(joint)": lambda x: METRICS.unit("error_rms", x),
    "Run.animate(arm)": lambda x: RUN.animate("a.gif", x),
    "Run.animate(fps)": lambda x: RUN.animate("a.gif", fps=x),
    "Run.animate(size)": lambda x: RUN.animate("a.gif", size=x),
    "Run.sample": DENSE.sample,
    "DenseOutput": lambda x: DENSE._dense[0](x) if DENSE._dense else None,
    "SweepTable.plot": TABLE.plot,
    "sweep(vary)": lambda x: al.sweep(SCENARIO, x),
    "sweep(vary={..: })": lambda x: al.sweep(SCENARIO, {x: [1.0]}),
    "sweep(vary={: ..})": lambda x: al.sweep(SCENARIO, {"law.kp": x}),
    "sweep(draws)": lambda x: al.sweep(SCENARIO, {"law.kp": [1.0]}, draws=x),
    "sweep(seed)": lambda x: al.sweep(SCENARIO, {"law.kp": [1.0]}, seed=x),
    "sweep(chunk)": lambda x: al.sweep(SCENARIO, {"law.kp": [1.0]}, chunk=x),
    "sweep(executor)": lambda x: al.sweep(SCENARIO, {"law.kp": [1.0]}, executor=x),
    "sweep(band)": lambda x: al.sweep(SCENARIO, {"law.kp": [1.0]}, band=x),
    "tune(vary)": lambda x: al.tune(SCENARIO, x, "error_rms1"),
    "tune(cost)": lambda x: al.tune(SCENARIO, {"law.kp": {"uniform": [1.0, 2.0]}}, x, candidates=5, generations=0),
    "tune(by)": lambda x: al.tune(SCENARIO, {"law.kp": {"uniform": [1.0, 2.0]}}, "error_rms1", by=x, candidates=5, generations=0),
    "worst_case(vary)": lambda x: al.worst_case(SCENARIO, x, "error_rms", runs=8),
    "worst_case(criterion)": lambda x: al.worst_case(SCENARIO, {"law.kp": {"uniform": [1.0, 2.0]}}, x, runs=8),
    "worst_case(bound)": lambda x: al.worst_case(SCENARIO, {"law.kp": {"uniform": [1.0, 2.0]}}, {"error_rms": x}, runs=8),
    "worst_case(seed)": lambda x: al.worst_case(SCENARIO, {"law.kp": {"uniform": [1.0, 2.0]}}, "error_rms", seed=x, runs=8),
    "tune(tolerance)": lambda x: al.tune(SCENARIO, tolerance=x, **FEW),
    "verify(samples)": lambda x: al.verify(PR, against=None, samples=x),
    "to_control(x0)": lambda x: al.to_control(PLANT, LAW, x),
    "to_control(sample_time)": lambda x: al.to_control(PLANT, LAW, [0.0, 0.0], sample_time=x),
    "loop_margins(plant)": lambda x: al.loop_margins(x, LAW, [0.0, 0.0]),
    "loop_margins(law)": lambda x: al.loop_margins(PLANT, x, [0.0, 0.0]),
    "loop_margins(x0)": lambda x: al.loop_margins(PLANT, LAW, x),
    "loop_margins(t)": lambda x: al.loop_margins(PLANT, LAW, [0.0, 0.0], t=x),
    "loop_margins(sample_time)": lambda x: al.loop_margins(PLANT, LAW, [0.0, 0.0], sample_time=x),
    "to_control(t)": lambda x: al.to_control(PLANT, LAW, [0.0, 0.0], t=x),
    "to_control(u0)": lambda x: al.to_control(PLANT, None, [0.0, 0.0], u0=x),
    "simulate_batch(plant)": lambda x: al.simulate_batch(x, LAW, np.zeros((2, 2)), keep="metrics", **SPAN),
    "simulate_batch(law)": lambda x: al.simulate_batch(PLANT, x, np.zeros((2, 2)), keep="metrics", **SPAN),
    "simulate_batch(q0)": lambda x: al.simulate_batch(PLANT, LAW, x, keep="metrics", **SPAN),
    "simulate_batch(v0)": lambda x: al.simulate_batch(PLANT, LAW, np.zeros((2, 2)), v0=x, keep="metrics", **SPAN),
    "simulate_batch(theta0)": lambda x: al.simulate_batch(PLANT, LAW, np.zeros((2, 2)), theta0=x, keep="metrics", **SPAN),
    "simulate_batch(force)": lambda x: al.simulate_batch(PLANT, LAW, np.zeros((2, 2)), force=x, keep="metrics", **SPAN),
    "simulate_batch(keep)": lambda x: al.simulate_batch(PLANT, LAW, np.zeros((2, 2)), keep=x, **SPAN),
    "simulate_batch(progress)": lambda x: al.simulate_batch(PLANT, LAW, np.zeros((2, 2)), progress=x, **SPAN) if x is not len else None,
    "simulate_batch(out)": lambda x: al.simulate_batch(PLANT, LAW, np.zeros((2, 2)), out=x, **SPAN),
    "simulate_batch(out={..: })": lambda x: al.simulate_batch(PLANT, LAW, np.zeros((2, 2)), out={"q": x}, **SPAN),
    "simulate_batch(record_every)": lambda x: al.simulate_batch(PLANT, LAW, np.zeros((2, 2)), record_every=x, keep="metrics", **SPAN),
    "simulate_batch(t_end)": lambda x: al.simulate_batch(PLANT, LAW, np.zeros((2, 2)), t_end=x, dt=1.0, keep="metrics", state_limit=1.0),
    "simulate_batch(dt)": lambda x: al.simulate_batch(PLANT, LAW, np.zeros((2, 2)), t_end=1e-9, dt=x, keep="metrics"),
    "simulate_batch(sample_time)": lambda x: al.simulate_batch(PLANT, LAW, np.zeros((2, 2)), sample_time=x, keep="metrics", **SPAN),
    "simulate_batch(t_eval)": lambda x: al.simulate_batch(PLANT, LAW, np.zeros((2, 2)), t_eval=x, keep="metrics", **SPAN),
    "integrate(t_span)": lambda x: al.integrate(lambda t, y: -y, x, [1.0]),
    "integrate(t_span=(0, ..))": lambda x: al.integrate(lambda t, y: -y, (0.0, x), [1.0], method="euler", dt=1e-3),
    "integrate(positions)": lambda x: al.integrate(lambda t, y: -y, (0.0, 1e-3), [1.0], positions=x),
    "integrate(events)": lambda x: al.integrate(lambda t, y: -y, (0.0, 1e-3), [1.0], events=x) if x is not len else None,
    "simulate(atol)": lambda x: al.simulate(PLANT, LAW, [0.0, 0.0], atol=x, **SPAN),
    "Arm.from_chain(type)": lambda x: al.Arm.from_chain([{"type": x}]),
    "Arm.from_chain({..: })": lambda x: al.Arm.from_chain([{"type": "R", x: 1.0}]),
    "Arm.from_dh(type)": lambda x: al.Arm.from_dh([{"type": x}]),
    "integrate(throw)": lambda x: al.integrate(lambda t, y: -y, (0.0, 1e-3), [1.0], throw=x),
    "sweep(progress)": lambda x: al.sweep(SCENARIO, {"law.kp": [1.0]}, progress=x) if x is not len else None,
    "sweep(threads)": lambda x: al.sweep(SCENARIO, {"law.kp": [1.0]}, threads=x),
    "tune(progress)": lambda x: al.tune(SCENARIO, progress=x, **FEW) if x is not len else None,
    "tune(threads)": lambda x: al.tune(SCENARIO, threads=x, **FEW),
    "gym.Reach(axes)": lambda x: gym.Reach(axes=x),
    "gym.Reach(frame)": lambda x: gym.ArmVectorEnv(2, task=gym.Reach(x)),
    "gym.Reach(reach)": lambda x: gym.ArmVectorEnv(2, task=gym.Reach(reach=x)).reset(),
    "gym.Reach(within)": lambda x: gym.ArmVectorEnv(2, task=gym.Reach(within=x)).reset(),
    "gym.Reach(at_rest)": lambda x: gym.ArmVectorEnv(2, task=gym.Reach(at_rest=x)).reset(),
    "gym.ArmVectorEnv.reset(options)": lambda x: gym.ArmVectorEnv(2).reset(options=x),
    "Sampling(period)": al.Sampling,
    "Sampling(delay)": lambda x: al.Sampling(1e-3, delay=x),
    "Sampling(noise={..})": lambda x: al.Sampling(1e-3, noise={"q": x}),
    "Sampling(seed)": lambda x: al.Sampling(1e-3, seed=x),
    "Sampling(torque_sensor)": lambda x: al.Sampling(1e-3, torque_sensor=x),
    "TorqueSensor(noise)": lambda x: al.TorqueSensor(noise=x),
    "TorqueSensor(bias)": lambda x: al.TorqueSensor(bias=x),
    "Event(arguments=(..))": lambda x: al.Event("joint", (x, x)) if x is not len else None,
    "velocity_bounds(dt)": lambda x: al.velocity_bounds([0.0], [-1.0], [1.0], [1.0], dt=x),
    "PrioritySolver.set_rounding": lambda x: al.PrioritySolver(2, [1]).set_rounding(x),
    "solve_priority(method)": lambda x: al.solve_priority([[[1.0, 0.0]]], [[1.0]], method=x),
    "solve_priority(rounding)": lambda x: al.solve_priority([[[1.0, 0.0]]], [[1.0]], rounding=x),
    "diagnose_priority(rounding)": lambda x: al.diagnose_priority([[[1.0, 0.0]]], rounding=x),
    "Hold": al.Hold,
    "planar_arm(coms)": lambda x: al.planar_arm([1.0, 1.0], x),
    "Task(gain)": lambda x: al.Task("link1", "xy", gain=x),
    "bang_bang_time": lambda x: al.bang_bang_time(0.0, x, 1.0, 1.0, 10.0),
}


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS.keys())
@pytest.mark.filterwarnings("ignore")
def test_junk_raises_errors_of_armlet(call: Callable[[Any], Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for junk in JUNK:
        try:
            # The `repr` of a result must not fail either. For dicts and arrays it is not computed.
            shown = call(junk)
            assert isinstance(shown, dict | np.ndarray) or isinstance(repr(shown), str)
        except (*ALLOWED, ImportError) as error:
            assert not isinstance(error, al.InternalError), (str(error), type(junk))
            assert len(str(error)) < 2000


@pytest.mark.parametrize("folder", ["a\0b", "\ud800\ud801", 3, None])
def test_invalid_paths_are_refused(folder: Any) -> None:
    for call in (al.load, al.Scenario.load, RUN.save, RUN.to_csv):
        with pytest.raises(al.InputError, match="path"):
            call(folder)
    if folder is not None:
        with pytest.raises(al.InputError, match="sweep: out "):
            al.sweep(SCENARIO, {"run.q0[0]": [0.0, 0.1]}, out=folder)


FILES = {
    "brackets": b"a = " + b"[" * 20_000,
    "tables": b"a = " + b"{a=" * 20_000,
    "keys": b"a" + b".a" * 4_000 + b" = 1",  # four times Python's recursion limit; reading takes quadratic time
    "digits": b"a = " + b"9" * 100_000,
    "bytes": b"\xff\xfe\0",
    "nul": b"a = 1\n\0",
    "empty": b"",
    "deep but whole": b"[run]\nq0 = " + b"[" * 900 + b"]" * 900,
    "not tables": b"arm = 1\nlaw = 2\nrun = 3\n",
}


@pytest.mark.parametrize("command", ["run", "check", "sweep"])
@pytest.mark.parametrize("content", FILES.values(), ids=FILES.keys())
def test_no_traceback_from_the_command_line(command: str, content: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "s.toml"
    file.write_bytes(content)
    more = ["--out", str(tmp_path / "out")] if command == "sweep" else []
    assert cli.main([command, str(file), *more]) == 2
    printed = capsys.readouterr().err
    assert printed and "Traceback" not in printed and "internal error" not in printed
    assert command == "check" or printed.count("\n") == 1


def test_files_without_an_end_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    large = tmp_path / "large"
    with large.open("wb") as file:
        file.truncate(reading.MOST_BYTES + 1)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    # A device may have no end, and reading of a pipe waits for its writer.
    endless = "is not a regular file"
    sources = [(large, "too large"), (pipe, endless), *((path, endless) for path in [Path("/dev/zero")] if path.is_char_device())]
    for source, words in sources:
        for line in (["run", str(source)], ["check", str(source)], ["sweep", str(source), "--out", str(tmp_path / "out")]):
            assert cli.main(line) == 2
            printed = capsys.readouterr().err
            assert words in printed and str(source) in printed and printed.count("\n") == 1
            if source == large:
                assert printed == f"armlet: {source}: is too large: expected at most {reading.MOST_BYTES} bytes\n"
        link = tmp_path / f"{source.name}.urdf"
        link.symlink_to(source)
        for line in (["check", str(link)], ["view", str(link), "--port", "0"]):
            assert cli.main(line) == 2 and words in capsys.readouterr().err
        with pytest.raises(al.FormatError if source == large else OSError):
            al.load(source)
        law = {"kind": "PDGravity", "target": [0.0], "kp": 1.0, "kd": 1.0}
        tables = {"arm": {"kind": "urdf", "path": str(source)}, "law": law, "run": TABLES["run"]}
        with pytest.raises(al.InputError, match=words):
            al.Scenario(tables).standalone()


def test_only_files_are_replaced(tmp_path: Path) -> None:
    """A path of a pipe or device such as /dev/null is refused. The finished file is renamed to its path, which would delete them."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    (tmp_path / "link").symlink_to(pipe)
    for path in (pipe, tmp_path / "link"):
        for save in (RUN.save, RUN.to_csv):
            with pytest.raises(OSError, match="not a regular file"):
                save(path)
    assert pipe.is_fifo() and sorted(p.name for p in tmp_path.iterdir()) == ["link", "pipe"]


def test_the_process_itself_ends_in_one_line(tmp_path: Path) -> None:
    file = tmp_path / "s.toml"
    file.write_bytes(FILES["brackets"])
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run([sys.executable, "-m", "armlet", "run", str(file)], capture_output=True, text=True, timeout=120, env=environment)
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and done.stderr.startswith(f"armlet: {file}: is not TOML")
