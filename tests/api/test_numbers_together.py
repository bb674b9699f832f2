"""Several entries of a named parameter share loops. Their derivatives equal those with one loop per entry, to the last bit.

A shared loop is a *probe*: it changes several entries. Bit `b` of an entry's code is set if probe `b` changes this entry.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import armlet as al
from armlet.run import named_numbers
from armlet.run.named_numbers import NamedNumber, Together, stacked, together, varied
from armlet.run.sensitivity import derived, options_at

ARM = al.planar_arm([0.5] * 5, masses=[3.0, 2.0, 2.0, 1.0, 1.0])
N, P = ARM.n, len(ARM.parameters)
Q0 = np.linspace(0.1, 0.5, N)
MOTION = al.Quintic(Q0, np.linspace(0.4, -0.3, N), 0.1)
TIMES = np.array([0.0, 0.01, 0.02])
KP, KD = np.linspace(4.0, 6.0, N), np.linspace(0.5, 0.9, N)

LOOPS: dict[str, tuple[Any, Any, list[str], bool]] = {
    "gains": (al.RigidArm(ARM), al.ComputedTorque(ARM, MOTION, KP, KD), ["law.kp", "law.kd"], True),
    "adaptive": (
        al.RigidArm(ARM),
        al.Adaptive(ARM, MOTION, KP, KD, np.linspace(0.1, 0.3, P), estimate=0.9 * ARM.parameters),
        ["law.kp", "law.kd", "law.gamma", "law.estimate"],
        True,
    ),
    "target": (al.RigidArm(ARM), al.PDGravity(ARM, Q0, KP, KD), ["law.kp", "law.kd", "q0"], True),
    "law's arm": (al.RigidArm(ARM), al.PDGravity(ARM, Q0, KP, KD), ["law.arm.parameters", "law.target"], False),
    # Entry (i, j) of Lambda = kd^-1 kp depends only on kp_j.
    "full gain": (al.RigidArm(ARM), al.Adaptive(ARM, MOTION, KP, np.diag(KD) + 0.1, 0.2), ["law.kp"], True),
    # Inputs of the compiled loop combine the parameters of a body, and the initial state of an elastic arm depends on the parameters of all
    # bodies.
    "elastic": (
        al.ElasticArm(ARM, np.full(N, 900.0), np.full(N, 0.2)),
        al.MotorPD(ARM, Q0, KP, KD, 900.0),
        ["arm.parameters", "plant.stiffness"],
        False,
    ),
}


@pytest.mark.parametrize("name", LOOPS)
def test_derivatives_have_the_same_bits(name: str) -> None:
    plant, law, names, comes_apart = LOOPS[name]
    keywords: dict[str, Any] = {"t_end": 0.02, "dt": 2e-3, "method": "rk4"}
    start = {"q0": Q0, "v0": None, "theta0": None, "theta_dot0": None}
    loops = varied("test", plant, law, start, names)
    assert loops.apart is not None
    tried = []

    def rates(given: Any) -> Any:
        tried.append(given)
        return al._core._sensitivities(*given.runs, options_at(keywords | DEFAULTS, given, TIMES))

    found = derived("test", loops, rates)
    assert len(tried) == (1 if comes_apart else 2)
    expected = rates(loops.apart())
    for series, values in expected.items():
        assert np.abs(values).max() > 0.0
        np.testing.assert_array_equal(found[series], values, err_msg=series)


DEFAULTS: dict[str, Any] = {"record_every": 1, "sample_time": None}


def test_many_entries_need_few_loops() -> None:
    law = LOOPS["adaptive"][1]
    loop = (al.RigidArm(ARM), law, {"q0": Q0})
    group = together(loop, NamedNumber("law.gamma", np.linspace(0.1, 0.3, P)), [(i,) for i in range(P)])
    assert isinstance(group, Together)
    # Eight probes have 70 codes with four bits set, enough for 50 entries.
    assert len(group.loops) == 8 + 4 and len(set(group.codes)) == P
    assert {code.bit_count() for code in group.codes} == {4}


def test_a_code_that_is_wrong_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The core compares the probe loops with the codes. So a derivative cannot be assigned to the wrong entry."""
    plant, law, _, _ = LOOPS["gains"]
    loop = (plant, law, {"q0": Q0, "v0": None, "theta0": None, "theta_dot0": None})
    named = NamedNumber("law.kp", KP)
    group = together(loop, named, [(i,) for i in range(N)])
    assert group is not None
    # Five of the six codes that have two of four bits set.
    assert group.codes == [0b0011, 0b0101, 0b1001, 0b0110, 0b1010]
    wrong = Together(group.loops, group.weights, [0b1100, *group.codes[1:]])
    loops = stacked(loop, [named], [wrong], lambda _: [])
    with pytest.raises(al.InputError, match="shared has numbers that act together"):
        al._core._sensitivities(*loops.runs, options_at({"t_end": 0.02, "dt": 2e-3, "method": "rk4"} | DEFAULTS, loops, TIMES))
    monkeypatch.setattr(named_numbers, "FEW", 99)
    assert together(loop, named, [(i,) for i in range(N)]) is None
