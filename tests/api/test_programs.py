"""Loops as programs: which runs are programs, and that a program of any kind gives the run that the loop itself gives."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import armlet as al

# The gains are the same for all joints, too stiff for light ones at these steps: the runs are compared, they need not be accurate.
pytestmark = pytest.mark.filterwarnings("ignore:.*balance does not close:UserWarning")

TWO = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0])
SIX = al.load_urdf(al.example_urdf("six_axis"))
OPTIONS: dict[str, Any] = {"t_end": 0.15, "dt": 1e-3, "record_every": 50}


def pd(arm: al.Arm, **gains: Any) -> al.PDGravity:
    return al.PDGravity(arm, np.linspace(0.3, -0.4, arm.n), **({"kp": 60.0, "kd": 15.0} | gains))


def series(run: Any) -> list[np.ndarray]:
    return [run.q, run.v, run.tau, *(run.monitors[name] for name in sorted(run.monitors))]


def test_a_run_says_how_it_was_computed() -> None:
    plant, law, q0 = al.RigidArm(SIX), pd(SIX), np.zeros(6)
    programs = al.build_info()["programs"]
    assert programs in ("machine", "portable")
    assert al.simulate(plant, law, q0, **OPTIONS).stats["engine"] == programs
    assert al.simulate_batch(plant, law, np.zeros((3, 6)), **OPTIONS).stats["engine"] == programs
    # Short runs, adaptive methods and laws in Python run directly.
    assert al.simulate(plant, law, q0, t_end=0.05, dt=1e-3).stats["engine"] == "direct"
    assert al.simulate(plant, law, q0, t_end=0.05, method="dopri5").stats["engine"] == "direct"
    own = al.simulate(plant, lambda t, q, v: -20.0 * q - 5.0 * v, q0, t_end=0.15, dt=1e-3, sample_time=1e-3)
    assert own.stats["engine"] == "direct"


LAWS = {
    "pd": lambda arm: pd(arm),
    "full gain": lambda arm: pd(arm, kp=60.0 * np.eye(arm.n) + 1.0),
    "adaptive": lambda arm: al.Adaptive(arm, al.Quintic(np.zeros(arm.n), np.full(arm.n, 0.4), 0.1), kp=40.0, kd=20.0, gamma=0.2),
    "computed torque": lambda arm: al.ComputedTorque(arm, al.Quintic(np.zeros(arm.n), np.full(arm.n, 0.4), 0.1), kp=100.0, kd=20.0),
    "impedance": lambda arm: al.CartesianImpedance(arm, [0.5, 0.2], 300.0, 60.0, frame=arm.tip_frame, axes="xy"),
}


@pytest.mark.parametrize("method", ["euler", "semi_implicit", "rk4"])
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("arm", [TWO, SIX], ids=["2R", "six axes"])
def test_a_program_is_the_loop(arm: al.Arm, law: str, method: str) -> None:
    """The part of a run that is short enough to run directly, against the same part of a program's."""
    plant, made, q0 = al.RigidArm(arm), LAWS[law](arm), np.linspace(0.1, -0.2, arm.n)
    program = al.simulate(plant, made, q0, t_end=0.15, dt=1e-3, record_every=30, method=method, tau_max=40.0)
    direct = al.simulate(plant, made, q0, t_end=0.09, dt=1e-3, record_every=30, method=method, tau_max=40.0)
    assert (program.stats["engine"], direct.stats["engine"]) == (al.build_info()["programs"], "direct")
    for one, other in zip(series(program), series(direct), strict=True):
        # 90 steps of some thousand roundings each, on values of order 100 at most; stiff loops of light joints amplify them.
        np.testing.assert_allclose(one[:4], other, rtol=1e-9, atol=1e-9)


def test_rows_of_other_structure_do_not_touch_one_another() -> None:
    """Gains that are one, full gains and other parameters: each row has the bits of the run alone."""
    gains: list[Any] = [60.0, 1.0, [60.0, 1.0], [1.0, 60.0], 60.0 * np.eye(2) + 1.0, np.eye(2), 61.0, [1.0, 1.0], 62.0, [60.0, 61.0]]
    arms = [TWO.with_parameters(np.asarray(TWO.parameters) * (1.0 + 0.1 * k)) if k % 3 == 0 else TWO for k in range(len(gains))]
    laws = [pd(arm, kp=kp) for arm, kp in zip(arms, gains, strict=True)]
    plants = [al.RigidArm(arm) for arm in arms]
    q0 = np.linspace([0.0, 0.1], [0.3, -0.4], len(gains))
    batch = al.simulate_batch(plants, laws, q0, **OPTIONS)
    for i, (plant, law) in enumerate(zip(plants, laws, strict=True)):
        for rows, alone in zip(series(batch), series(al.simulate(plant, law, q0[i], **OPTIONS)), strict=True):
            np.testing.assert_array_equal(rows[i], alone)


def test_more_structures_than_are_kept() -> None:
    """Seventy geometries, each twice: programs are dropped and made again with the same bits."""
    arms = [al.planar_arm([0.5 + 0.001 * k, 0.4]) for k in range(70)]
    runs = [[al.simulate(al.RigidArm(arm), pd(arm), [0.1, 0.2], t_end=0.1, dt=1e-3).q for arm in arms] for _ in range(2)]
    for first, second in zip(*runs, strict=True):
        np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("start", [9.9e5, 1.0e6 + 3.0, 4.0e8])
def test_angles_beyond_the_range_of_the_polynomials(start: float) -> None:
    """Such a run is computed again directly; its neighbours in a batch keep their bits."""
    plant, law = al.RigidArm(TWO), al.PDGravity(TWO, [start, 0.0], 50.0, 20.0)
    options = OPTIONS | {"state_limit": 1e12}
    far = al.simulate(plant, law, [start, 0.1], **options)
    short = al.simulate(plant, law, [start, 0.1], **(options | {"t_end": 0.05}))
    np.testing.assert_allclose(far.q[:2], short.q, rtol=1e-14, atol=0.0)
    near = al.PDGravity(TWO, [0.3, 0.0], 50.0, 20.0)
    batch = al.simulate_batch(plant, [near, law, near], [[0.0, 0.1], [start, 0.1], [0.2, 0.1]], **options)
    np.testing.assert_allclose(batch.q[1], far.q, rtol=1e-14, atol=0.0)
    np.testing.assert_array_equal(batch.q[2], al.simulate(plant, near, [0.2, 0.1], **options).q)


PORTABLE = """
import sys
import numpy as np, armlet as al
arm = al.load_urdf(al.example_urdf("six_axis"))
law = al.ComputedTorque(arm, al.Quintic(np.zeros(6), np.full(6, 0.4), 0.1), 100.0, 20.0)
run = al.simulate(al.RigidArm(arm), law, np.linspace(0.1, -0.2, 6), t_end=0.15, dt=1e-3)
batch = al.simulate_batch(al.RigidArm(arm), law, np.linspace(np.zeros(6), np.full(6, 0.3), 11), t_end=0.15, dt=1e-3)
q = np.linspace(np.full(6, -0.7), np.full(6, 0.9), 50)
J = arm.jacobian(q, "flange")
v = al.solve_priority([J[:, :3], J[:, 3:5]], [[0.1, 0.2, 0.3], [0.4, 0.5]]).v
w = al.PrioritySolver.for_arm(arm, [al.Task("flange", "xyz"), al.Task("flange", "rx")]).solve(q, [[0.1, 0.2, 0.3], [0.4]])
print(run.stats["engine"], batch.stats["engine"], al.build_info()["programs"])
print(b"".join(x.tobytes() for x in (run.q, run.tau, batch.q, batch.tau, v, w)).hex())
"""


@pytest.mark.parametrize("isa", [None, "baseline"])
def test_the_portable_way_gives_the_same_bits(isa: str | None) -> None:
    held = {"ARMLET_ISA": isa} if isa else {}
    environment = {name: value for name, value in os.environ.items() if name not in ("ARMLET_PROGRAMS", "ARMLET_ISA")} | held
    found = []
    for way in ({}, {"ARMLET_PROGRAMS": "portable"}):
        done = subprocess.run([sys.executable, "-P", "-c", PORTABLE], capture_output=True, text=True, env=environment | way, check=True)
        found.append(done.stdout.split())
    assert found[1][:3] == ["portable"] * 3
    assert found[0][3] == found[1][3]
