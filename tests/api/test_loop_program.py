"""Listings of loop programs: numbers of operations counted by hand, and every stage evaluated line by line and compared with the run."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from listed_programs import evaluate

import armlet as al
from armlet.run.programs import Instruction

PR = al.planar_pr(2.0, 0.5, 0.7)
TWO = models.TWO_HEAVY_LINKS
SIX = models.SIX_AXES
STAGES = ("recorded", "simplified", "lowered", "machine")
# The program and numpy round differently, also in their sines.
CLOSE: dict[str, Any] = {"rtol": 1e-13, "atol": 1e-13}


def pd(arm: al.Arm) -> al.PDGravity:
    n = arm.n
    return al.PDGravity(arm, np.linspace(0.3, -0.4, n), kp=np.linspace(60.0, 50.0, n), kd=np.linspace(15.0, 12.0, n))


TARGET = np.linspace(0.3, -0.4, 2)


def quintic(arm: al.Arm) -> al.Quintic:
    return al.Quintic(np.zeros(arm.n), np.linspace(0.4, 0.3, arm.n), 1.0)


#: For each loop: a plant, a law, and the target of the law.
LOOPS: dict[str, Callable[[], tuple[al.Plant, al.Law, Any]]] = {
    "PR adaptive": lambda: (al.RigidArm(PR), al.Adaptive(PR, quintic(PR), 40.0, 20.0, 5.0, estimate=[1.5, 0.3, 0.6]), quintic(PR)),
    "2R PD": lambda: (al.RigidArm(TWO), pd(TWO), TARGET),
    "2R computed torque": lambda: (al.RigidArm(TWO), al.ComputedTorque(TWO, quintic(TWO), 100.0, 20.0), quintic(TWO)),
    "2R impedance": lambda: (
        al.RigidArm(TWO),
        al.CartesianImpedance(TWO, [0.5, 0.4], 100.0, 20.0, frame="link2", axes="xy"),
        [0.5, 0.4],
    ),
    "2R elastic": lambda: (
        al.ElasticArm(TWO, 800.0, 0.4),
        al.ElasticImpedance(TWO, [0.5, 0.4], 100.0, 20.0, 800.0, 0.4, 0.02, frame="link2", axes="xy"),
        [0.5, 0.4],
    ),
    "2R velocity": lambda: (al.VelocityArm(TWO), al.PriorityVelocity(TWO, [al.Task("link2", "x", [0.5], 3.0)]), [0.5]),
}


def start(plant: al.Plant) -> dict[str, Any]:
    start = {"q0": [0.3, 0.7]}
    if not isinstance(plant, al.VelocityArm):
        start["v0"] = [0.4, -0.6]
    if isinstance(plant, al.ElasticArm):
        start |= {"theta0": [0.31, 0.69], "theta_dot0": [0.2, 0.1]}
    return start


def state(run: al.Run, k: int) -> dict[str, float]:
    """The state of record `k`, by the names of a program's inputs."""
    parts = {"q": run.q, "v": run.v, "theta": run.theta, "theta_dot": run.theta_dot, "estimate": run.estimate}
    if run.theta is None and run.tau is not None and run.law_name == "PriorityVelocity":
        del parts["v"]
    return {f"{name}{i + 1}": x for name, values in parts.items() if values is not None for i, x in enumerate(values[k])}


def desired(target: Any, h: float) -> dict[str, float]:
    """The desired motion at start, middle and end of a step, by the names of a program's inputs. A law uses one of two sets of names."""
    found = {}
    for suffix, t in (("", 0.0), ("_mid", h / 2), ("_end", h)):
        samples = target(t) if callable(target) else (target, np.zeros(len(target)), np.zeros(len(target)))
        for joints, other, values in zip(("q_d", "v_d", "a_d"), ("x1_d", "xdot1_d", "xddot1_d"), samples, strict=True):
            for i, x in enumerate(values):
                found[f"{joints}{i + 1}{suffix}"] = found[f"{other}{i + 1}{suffix}"] = float(x)
    return found


def test_a_small_loop_counted_by_hand() -> None:
    """tau = kp (q_d - q) - kd v,  M = [[A, B c], [B c, C]],  r = tau + [B s v2^2, 0],  a = M^-1 r,  q += h v,  v += h a."""
    program = al.loop_program(al.RigidArm(PR), pd(PR), method="euler")
    error, product, less_damping = {"sub": 2}, {"mul": 2}, {"fnma": 2}
    coupling, centrifugal = {"cos": 1, "sin": 1, "mul": 2}, {"mul": 1, "fma": 1}
    determinant = {"fnma": 1, "div": 1}  # A C is a parameter of the arm
    inverse_times_r = {"mul": 4, "fnma": 2}
    euler = {"fma": 4}
    expected: dict[str, int] = {}
    for part in (error, product, less_damping, coupling, centrifugal, determinant, inverse_times_r, euler):
        for kind, count in part.items():
            expected[kind] = expected.get(kind, 0) + count
    assert program.operations == expected and len(program) == sum(expected.values()) == 24
    # The longest chain of dependent operations is q_d - q, kp e, - kd v, + B s v^2, C r, - B c r, / det, v + h a. The docstring has the
    # symbols, and det = A C - (B c)^2.
    assert program.critical_path == 8
    assert (program.part, program.stage, program.stages) == ("step", "simplified", STAGES)
    assert program.parts["step"] == len(program.at("lowered")) > len(program)
    assert program.inputs["kp1"] == 60.0 and program.inputs["A"] == 2.0 and program.inputs["q1"] is None
    assert set(program.inputs) == {*"A B C AC kp1 kp2 kd1 kd2 q1 q2 v1 v2 q_d1 q_d2 h".split()}
    assert set(program.outputs) == {"q1", "q2", "v1", "v2"}
    assert Instruction("t0", "sin", ("q2",)) in program.instructions


def test_the_listing_reads_as_text() -> None:
    program = al.loop_program(al.RigidArm(PR), pd(PR), method="euler")
    text = str(program)
    assert text.startswith("One step of RigidArm under PDGravity by euler\n")
    for line in ("  t0 = sin(q2)", "  t2 = q_d1 - q1", "  t4 = kp1 * t2", "  t6 = t4 - kd1 * v1", "  v1 <- t22"):
        assert f"\n{line}\n" in text, line
    assert re.search(r"^  simplified  mul 9, fn?ma 5, fn?ma 5, sub 2,", text, re.MULTILINE)
    assert repr(program) == "LoopProgram(RigidArm, PDGravity, euler, part='step', stage='simplified', 24 lines)"
    assert str(Instruction("t1", "fnma", ("a", "-2.0", "c"))) == "t1 = c - a * (-2.0)"
    assert str(Instruction("t1", "select", ("m", "a", "b"))) == "t1 = select(m, a, b)"
    assert len(str(program.at("machine")).splitlines()) > len(program.at("machine"))


@pytest.mark.parametrize("method", ["euler", "semi_implicit", "rk4"])
@pytest.mark.parametrize("loop", LOOPS)
def test_the_lines_of_every_stage_are_the_step(loop: str, method: str) -> None:
    plant, law, target = LOOPS[loop]()
    if isinstance(plant, al.VelocityArm) and method == "semi_implicit":
        with pytest.raises(al.InputError, match=r"^loop_program: method needs velocities among the states"):
            al.loop_program(plant, law, method=method)
        return
    h = 0.01
    run = al.simulate(plant, law, t_end=h, dt=h, method=method, monitors=False, **start(plant))
    inputs = state(run, 0) | desired(target, h) | {"h": h, "valid": 1.0, "largest_angle": 0.0}
    expected = state(run, 1)
    program = al.loop_program(plant, law, method=method)
    assert program.part == "step" and set(program.stages) >= {"simplified", "lowered", "machine"}
    for stage in program.stages:
        found = evaluate(program.at(stage), inputs)
        assert set(expected) <= set(found) <= set(expected) | {"largest_angle", "valid"}
        # In the later stages the results have equal bits. The earlier stages are evaluated with numpy's sines.
        close = CLOSE if stage in ("recorded", "simplified") else {"rtol": 0.0, "atol": 0.0}
        np.testing.assert_allclose([found[name] for name in expected], list(expected.values()), **close, err_msg=stage)


def test_machine_code_chooses_as_its_instructions_do() -> None:
    """A comparison with NaN is false, in machine code and in the lowered instructions. So NaN does not become the largest angle."""
    program = al.loop_program(al.RigidArm(TWO), pd(TWO), method="euler", tau_max=5.0)
    inputs = {"q1": np.nan, "q2": 0.7, "v1": 0.4, "v2": -0.6, "q_d1": 0.3, "q_d2": -0.4, "h": 0.01, "largest_angle": 0.5}
    lowered, machine = (evaluate(program.at(stage), inputs) for stage in ("lowered", "machine"))
    assert machine["largest_angle"] == lowered["largest_angle"] == 0.7
    np.testing.assert_array_equal([machine[name] for name in lowered], list(lowered.values()))


def test_simplification_removes_most_operations() -> None:
    """The recorded program of a planar arm has spatial equations. Simplification reduces them to planar equations."""
    program = al.loop_program(al.RigidArm(TWO), pd(TWO), method="euler")
    assert len(program.at("recorded")) > 3 * len(program)
    assert not any("0.0" in line.operands for line in program.instructions)
    assert len({(line.kind, line.operands) for line in program.instructions}) == len(program)


@pytest.mark.parametrize("method", ["dopri5", "rodas4"])
def test_the_rates_are_those_of_the_equations(method: str) -> None:
    """The rates are q' = v, v' = M^-1 (tau - n), computed with the arm's forward dynamics and a call of the law."""
    rng = np.random.default_rng(1)
    q, v = rng.normal(size=(2, 6))
    law = pd(SIX)
    program = al.loop_program(al.RigidArm(SIX), law, method=method, part="rates")
    assert program.part == "rates" and len(program) > 500
    target = {f"q_d{i + 1}": x for i, x in enumerate(np.linspace(0.3, -0.4, 6))}
    inputs = target | {f"q{i + 1}": x for i, x in enumerate(q)} | {f"v{i + 1}": x for i, x in enumerate(v)} | {"largest_angle": 0.0}
    a = SIX.forward_dynamics(q, v, law(0.0, q, v))
    for stage in program.stages:
        found = evaluate(program.at(stage), inputs)
        np.testing.assert_allclose([found[f"dq{i + 1}"] for i in range(6)], v, **CLOSE)
        # M^-1 amplifies rounding.
        np.testing.assert_allclose([found[f"dv{i + 1}"] for i in range(6)], a, rtol=1e-11, atol=1e-11, err_msg=stage)


def test_a_large_step_is_its_parts() -> None:
    """A step of a large loop consists of the parts segment, rates, segment, and so on. Outputs of one part are inputs of the next."""
    law, h = pd(SIX), 1e-3
    q0, v0 = np.linspace(0.1, -0.2, 6), np.linspace(-0.3, 0.4, 6)
    run = al.simulate(al.RigidArm(SIX), law, q0, v0=v0, t_end=h, dt=h, monitors=False)
    first = al.loop_program(al.RigidArm(SIX), law)
    assert first.part == "rates" and list(first.parts)[-2:] == ["law", "rates"]
    segments = [name for name in first.parts if name.startswith("segment")]
    assert len(segments) == 5
    known = state(run, 0) | desired(np.linspace(0.3, -0.4, 6), h) | {"h": h, "largest_angle": 0.0}
    for k, segment in enumerate(segments):
        known |= evaluate(al.loop_program(al.RigidArm(SIX), law, part=segment), known)
        if k < 4:
            stage = known | {name.removesuffix("_stage"): x for name, x in known.items() if name.endswith("_stage")}
            rates = evaluate(first, stage)
            assert [rates[f"dq{i + 1}"] for i in range(6)] == [stage[f"v{i + 1}"] for i in range(6)]
            known |= {f"{name}_stage{k + 1}": x for name, x in rates.items()}
    expected = state(run, 1)
    np.testing.assert_allclose([known[name] for name in expected], list(expected.values()), **CLOSE)


def test_derivatives_are_those_of_the_rates() -> None:
    """Derivatives along a direction equal central differences of the rates."""
    plant, law, target = LOOPS["PR adaptive"]()
    parts = {part: al.loop_program(plant, law, method="radau5", part=part) for part in ("rates", "values", "along_plant", "along_law")}
    assert list(parts["rates"].parts) == list(parts)
    point = {"q1": 0.3, "q2": 0.7, "v1": 0.4, "v2": -0.6, "estimate1": 1.5, "estimate2": 0.3, "estimate3": 0.6}
    known = point | desired(target, 0.0) | {"largest_angle": 0.0}
    known |= evaluate(parts["values"], known)
    for name in point:
        along = {f"along_{other}": float(other == name) for other in point}
        found = evaluate(parts["along_law" if name.startswith("estimate") else "along_plant"], known | along)
        step = 1e-6
        above, below = (evaluate(parts["rates"], known | {name: point[name] + side * step}) for side in (1, -1))
        for rate in (f"d{other}" for other in point):
            # Central differences have a truncation error, and rounding errors divided by the step.
            np.testing.assert_allclose(found[f"{rate}_along"], (above[rate] - below[rate]) / (2 * step), rtol=1e-7, atol=1e-7)


def test_options_are_those_of_simulate() -> None:
    plant, law = al.RigidArm(TWO), pd(TWO)
    plain = al.loop_program(plant, law, method="euler")
    assert "tau_max1" in al.loop_program(plant, law, method="euler", tau_max=[5.0, 6.0]).inputs
    pushed = al.loop_program(plant, law, method="euler", force=[1.0, 2.0, 0.0], force_frame="link2")
    assert "force_fx" in pushed.inputs
    held = al.loop_program(plant, law, method="euler", sample_time=1e-2)
    assert "tau1" in held.inputs and "kp1" not in held.inputs and held.parts["law"] == plain.parts["law"]
    watched = al.loop_program(plant, law, method="euler", monitors=True)
    assert {"dissipated", "supplied"} <= set(watched.outputs) and len(watched) > len(plain)
    side_by_side = al.loop_program(plant, law, method="euler", batch=True)
    assert side_by_side.lanes in (2, 4, 8) and plain.lanes == 1 and side_by_side.instructions == plain.instructions
    assert (plain.engine, plain.spilled) == (al.build_info()["programs"], 0)
    assert plain.code_bytes is not None and plain.code_bytes > 4 * len(plain)


def test_many_values_spill_and_the_listing_shows_where() -> None:
    program = al.loop_program(al.RigidArm(SIX), pd(SIX), stage="machine")
    stored = [line for line in program.instructions if line.name.startswith("spill")]
    assert program.spilled == len(stored) > 0
    assert {"load", "store"} <= set(program.operations)


class Own:
    def __call__(self, t: float, q: Any, v: Any) -> Any:
        return -q


def sns() -> al.PriorityVelocity:
    return al.PriorityVelocity(TWO, [al.Task("link2", "x", [0.5], 3.0)], method="sns", v_max=2.0)


REFUSED: dict[str, tuple[Callable[[], Any], str]] = {
    "python law": (
        lambda: al.loop_program(al.RigidArm(TWO), Own()),
        "law has the loop run directly, without a program: .*a function in Python",
    ),
    "part": (lambda: al.loop_program(al.RigidArm(TWO), pd(TWO), part="rates"), "part is unknown: expected one of step, law, got rates"),
    "stage": (lambda: al.loop_program(al.RigidArm(TWO), pd(TWO), stage="x"), "stage is unknown: expected one of recorded, simplified"),
    "method": (lambda: al.loop_program(al.RigidArm(TWO), pd(TWO), method="x"), "method is unknown"),
    "batch": (
        lambda: al.loop_program(al.RigidArm(TWO), pd(TWO), method="dopri5", batch=True),
        "batch is not used: expected False for dopri5",
    ),
    "flag": (lambda: al.loop_program(al.RigidArm(TWO), pd(TWO), batch=3), "batch is not a flag"),
    "pair": (lambda: al.loop_program(al.RigidArm(TWO), pd(SIX)), "law has the wrong number of joints: expected 2, got 6"),
    "plant": (lambda: al.loop_program(TWO, pd(TWO)), "plant is of the wrong type"),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("what", REFUSED)
def test_bad_arguments_are_refused_by_name(what: str) -> None:
    call, message = REFUSED[what]
    with pytest.raises(al.InputError, match=f"^loop_program: {message}"):
        call()


def test_laws_that_decide_are_listed_as_formulas() -> None:
    assert len(al.loop_program(al.VelocityArm(TWO), sns())) > 0
    assert len(al.loop_program(*LOOPS["2R velocity"]()[:2], method="dopri5")) > 0


def test_modes_of_contacts_are_inputs() -> None:
    plant = al.RigidArm(TWO, stops=al.JointStops(1e3, 1.0, lower=-1.0, upper=[1.0, np.inf]))
    program = al.loop_program(plant, pd(TWO), method="radau5")
    modes = [f"contact{k}_{what}" for k in (1, 2, 3) for what in ("pushes", "inside")]
    assert [name for name in program.inputs if name.startswith("contact")] == modes[::2]
    monitored = al.loop_program(plant, pd(TWO), method="radau5", monitors=True)
    assert [name for name in monitored.inputs if name.startswith("contact")] == modes


@pytest.mark.parametrize("method", ["rk4", "dopri5", "ros2"])
def test_modes_of_joints_are_inputs(method: str) -> None:
    arm = TWO.with_drives(friction=[1.0, 2.0])
    program = al.loop_program(al.RigidArm(arm, friction="stick_slip"), pd(arm), method=method)
    assert [name for name in program.inputs if name.startswith("side")] == ["side1", "side2"]


def test_other_stages_by_name() -> None:
    program = al.loop_program(al.RigidArm(PR), pd(PR))
    assert program.at("machine").stage == "machine" and program.stage == "simplified"
    with pytest.raises(al.InputError, match=r"^LoopProgram.at: stage is unknown: expected one of recorded, simplified, .*, got 'x'"):
        program.at("x")


def test_a_figure_shows_every_line_and_refuses_what_it_cannot_show() -> None:
    from matplotlib.figure import Figure

    program = al.loop_program(al.RigidArm(PR), pd(PR), method="euler")
    figure = Figure()
    axes = program.plot(figure)
    assert axes.figure is figure
    texts = [text.get_text() for text in axes.texts]
    assert texts.count("×") == 9 and texts.count("sin") == 1 and {"kp1", "h", "v2"} <= set(texts)
    # The longest chain has eight lines, so seven edges, plus one edge to its output.
    assert sum(line.get_linewidth() == 1.8 and len(line.get_xdata()) > 0 for line in axes.lines) == 8
    with pytest.raises(al.InputError, match=r"^LoopProgram.plot: the program is too long .*: expected at most 300 lines, got \d+ at stage"):
        al.loop_program(al.RigidArm(SIX), pd(SIX)).plot(figure)


def test_the_page_shows_the_listing_as_it_is() -> None:
    """The page docs/programs.md shows the current listing.

    Only lines about the later stages depend on the processor. They are not compared.
    """
    page = (Path(__file__).resolve().parents[2] / "docs" / "programs.md").read_text()
    (shown,) = re.findall(r"^```text\n(One step.*?)^```$", page, re.MULTILINE | re.DOTALL)
    pendulum = al.pendulum(0.3, 2.0)
    program = al.loop_program(al.RigidArm(pendulum), al.PDGravity(pendulum, target=[1.0], kp=40.0, kd=7.0), method="euler")
    own = re.compile(r"^  engine|^  parts|^ +(lowered|machine) +\d+ lines")
    wanted, found = ([line for line in text.splitlines() if not own.match(line)] for text in (shown, str(program)))
    assert wanted == found
    recorded = [str(line) for line in program.at("recorded").instructions]
    assert {"t3 = 1.0 * t0", "t4 = 0.0 * t0"} <= set(recorded)
