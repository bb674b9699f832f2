"""Every optional argument of the public interface has an effect, alone and beside each other one, or is refused by name.

The tables `options_of_*` have a call of each function, and a value of each option. The walk compares results. A test compares the tables
with the signatures, so that a new option needs an entry.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from fnmatch import fnmatch
from typing import Any

import models
import options_of_laws
import options_of_runs
import options_of_tools
import pytest
from refusals import refused
from walked_options import Case, without_effect

import armlet as al

CASES: dict[str, Case] = options_of_laws.CASES | options_of_runs.CASES | options_of_tools.CASES

#: Options that change no result, of every function, with the reason.
ANYWHERE = {
    "out": "the array of the result",
    "threads": "results have the same bits for every number of threads",
    "progress": "a report to the caller",
    "executor": "where the work is done",
    "chunk": "how the work is divided",
    "check_limits": "a warning or an error, without another result",
    "throw": "an error in place of a status",
    "fig": "the figure into which a plot is drawn",
    "memory": "the memory of the computation",
    "state_limit": "an early end of the run",
    "kwargs": "arguments of `Law.__call__`, which are those of `Law.terms`",
}
#: Options that select a case of the tables.
CHOSEN = {"method", "kind", "law", "plant", "x0"}
#: Functions that make results or files, or that pass their options on. Their own tests walk their options.
ELSEWHERE = {
    "compare": "a figure",
    "export_c": "the tests of this file",
    "export_web": "the keywords of simulate; the tests of web pages",
    "gradient": "the keywords of simulate",
    "from_mujoco": "the tests of models of other programs",
    "loop_program": "the keywords of simulate; its own options select a listing",
    "sweep": "the tests of sweeps",
    "tune": "the tests of this file",
    "worst_case": "the tests of worst cases",
    "verify": "the tests of comparisons",
    "Arm.show": "a figure",
    "Identification.with_prior": "the tests of priors",
    "Run.animate": "a figure",
    "Run.plot": "a figure",
    "Run.report": "a page",
    "Scenario": "the folder of files and the name in messages",
    "Scenario.from_dict": "the folder of files",
    "Simulator.set_state": "the state, as given",
    "Simulator.reset": "the state, as given",
    "Simulator.step": "the input and the force of a step",
    "Srdf.arm": "the keywords of load_urdf",
    "Srdf.pose": "a group and the other joints",
    "SweepTable.plot": "a figure",
    "Metrics.unit": "the index of a joint",
    "Event": "the fields of an event",
    "ArmPrioritySolver.diagnose": "velocities of a report",
    "MomentumObserver.calibrate": "a factor of thresholds",
    "MomentumObserver.wrench": "a threshold on singular values",
    "MomentumObserver.unexplained": "a threshold on singular values",
    "JointLimitTask": "its own tests; the task has no target",
    "integrate": "options that describe the problem, for every method, and the method",
    "load_urdf": "a file",
    "read_log": "a file; its own tests",
    "fit_log": "a log; its own tests",
    "Log": "the series of a recording; its own tests",
}
#: Classes of results, whose fields are optional.
RESULTS = {"BatchRun", "ElasticLimits", "Equilibrium", "Events", "ModelError", "PriorityDiagnosis", "Run", "Sensitivity", "SolveError"}
RESULTS |= {"BaseParameters", "LogFit", "LogReport", "PrioritySolution", "Refuted", "Status", "Tuning", "WorstCase"}


def functions() -> Iterator[tuple[str, Any]]:
    """The public functions, the constructors, and the public methods of the public classes."""
    for name in al.__all__:
        made = getattr(al, name)
        if not callable(made) or name in RESULTS:
            continue
        yield name, made
        if inspect.isclass(made):
            for method, function in vars(made).items():
                if callable(getattr(made, method)) and not method.startswith("_"):
                    yield f"{name}.{method}", getattr(made, method) if not isinstance(function, staticmethod) else function.__func__


def test_the_tables_have_every_option() -> None:
    missing: dict[str, list[str]] = {}
    for name, function in functions():
        try:
            parameters = inspect.signature(function).parameters.values()
        except ValueError:  # an exception class
            continue
        optional = {each.name for each in parameters if each.default is not each.empty} - set(ANYWHERE) - CHOSEN
        known = {option for case, table in CASES.items() if case.partition(" ")[0] == name for option in table.options}
        if optional - known and name.partition("(")[0] not in ELSEWHERE and name.partition(".")[0] not in ELSEWHERE:
            missing[name] = sorted(optional - known)
    assert missing == {}
    assert len(CASES) > 100 and sum(len(case.options) for case in CASES.values()) > 500


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_options_have_an_effect_or_are_refused(name: str) -> None:
    case = CASES[name]
    found = without_effect(case)
    assert [each for each in found if not any(fnmatch(each, pattern) for pattern in case.idle)] == []


def test_the_walk_finds_options_without_an_effect() -> None:
    def call(a: int = 0, b: int = 0, c: int = 0, d: int = 0) -> Any:
        if d and not a:
            raise al.InputError("call: d takes effect only with a")
        return [a + d, c if not a else 0]

    assert without_effect(Case(call, {"a": 1, "b": 2, "c": 3, "d": 4})) == ["b", "c+a"]
    assert without_effect(Case(call, {"d": 1}, {})) == []


def test_exported_functions() -> None:
    law, arm = al.PDGravity(options_of_laws.ARM, [0.1, 0.2], 8.0, 5.0), options_of_laws.REAL
    for option, word in (({"dt": 1e-3}, "dt"), ({"method": "euler"}, "method"), ({"sample_time": 1e-3}, "sample_time")):
        refused(lambda option=option: al.export_c(law, "unused", **option), f"export_c: {word} takes effect only with")  # type: ignore[misc]
    integral = al.PID(options_of_laws.ARM, [0.1, 0.2], 8.0, 5.0, 5.0)
    refused(lambda: al.export_c(integral, "unused", sample_time=1e-3), "sample_time takes effect only with a Guarded law")
    refused(lambda: al.export_c(arm, "unused", armature=True), "armature takes effect only with the function regressor")
    refused(lambda: al.export_c(arm, "unused", functions=["gravity"], friction=True), "friction takes effect only with")


def test_tuning() -> None:
    scenario = al.Scenario.from_dict(
        {
            "arm": {"kind": "planar_pr", "A": 2.0, "B": 0.5, "C": 0.5},
            "law": {"kind": "PDGravity", "target": [0.3, 0.2], "kp": 30.0, "kd": 8.0},
            "run": {"q0": [0.0, 0.0], "t_end": 0.1, "dt": 0.01},
        }
    )
    vary = {"law.kp": {"uniform": [10.0, 50.0]}}
    for options in ({"by": "mean"}, {"starts": 2}, {"method": "gradient", "candidates": 8}):
        name = list(options)[-1]
        refused(lambda options=options: al.tune(scenario, vary, "error_rms1", **options), f"tune: {name} takes effect only with")  # type: ignore[misc]


def test_scenarios_have_the_same_checks() -> None:
    data: dict[str, Any] = {
        "arm": {"kind": "planar_arm", "lengths": [0.5, 0.4, 0.3]},
        "law": {"kind": "CartesianImpedance", "target": [0.7, 0.5], "stiffness": 300.0, "damping": 40.0, "frame": "link3", "axes": "xy"},
        "run": {"q0": [0.3, 0.7, -0.5], "t_end": 0.02, "dt": 1e-3},
    }
    refused(lambda: al.Scenario.from_dict(data | {"law": data["law"] | {"eps": 0.1}}).build(), "$.law.eps: takes effect only with")
    refused(
        lambda: al.Scenario.from_dict(data | {"run": data["run"] | {"force_frame": "link2"}}).run(),
        "force_frame: takes effect only with force",
    )
    refused(
        lambda: al.Scenario.from_dict(data | {"run": data["run"] | {"sample_time": {"period": 1e-3, "noise": {"theta": 0.1}}}}).run(),
        "takes effect only on states of the plant",
    )


def test_a_posture_of_a_scenario_may_be_a_motion() -> None:
    law = {"kind": "CartesianImpedance", "target": [0.7, 0.5], "stiffness": 300.0, "damping": 40.0, "frame": "link3", "axes": "xy"}
    wave = {"offset": [0.3, 0.7, -0.5], "amplitude": [0.2, 0.1, 0.3], "frequency": [3.0, 3.0, 3.0], "phase": [0.1, 0.2, 0.3]}
    posture = {"q_d": {"kind": "Sinusoid"} | wave, "stiffness": 20.0, "damping": 4.0}
    data = {"arm": {"kind": "planar_arm", "lengths": [0.5, 0.4, 0.3]}, "law": law | {"nullspace": posture}}
    run = al.Scenario.from_dict(data | {"run": {"q0": [0.3, 0.7, -0.5], "t_end": 0.05, "dt": 1e-3}}).run()
    arm = models.THREE_LINKS
    null = al.NullSpace(al.Sinusoid(*wave.values()), 20.0, 4.0)
    same = al.CartesianImpedance(arm, [0.7, 0.5], 300.0, 40.0, frame="link3", axes="xy", nullspace=null)
    other = al.simulate(al.RigidArm(arm), same, [0.3, 0.7, -0.5], t_end=0.05, dt=1e-3)
    assert run.q.tobytes() == other.q.tobytes()
