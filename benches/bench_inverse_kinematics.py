"""Inverse kinematics of many poses: poses per second from near starts on two arms, and the share of random poses reached on ten arms.

python -P benches/bench_inverse_kinematics.py              the tables
python -P benches/bench_inverse_kinematics.py --readme     the tables, written into benches/README.md
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import armlet as al

sys.path.insert(0, str(Path(__file__).parent))
import reporting
import timing
from timing import Case

Array = NDArray[np.float64]
POSES = 4096
GOAL, AIM = 30_000, 100_000
RANDOM = 10_000
H = np.pi / 2
TURN = 2 * np.pi
# Each arm: Denavit-Hartenberg convention ("standard" or "modified"), columns a (m), alpha (rad) and d (m), lower and upper joint limits
# (rad).
UR = [H, 0.0, 0.0, H, -H, 0.0]
IIWA = [-H, H, H, -H, -H, H, 0.0]
IIWA_LIMITS = np.radians([170, 120, 170, 120, 170, 120, 175])
PANDA_LOWER = [-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]
PANDA_UPPER = [2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973]
PUMA = np.radians([[-160, 160], [-45, 225], [-225, 45], [-110, 170], [-100, 100], [-266, 266]]).T
TABLES: dict[str, tuple[str, list[Any], list[Any], list[Any], Any, Any]] = {
    "Universal UR3": ("standard", [0, -0.24365, -0.21325, 0, 0, 0], UR, [0.1519, 0, 0, 0.11235, 0.08535, 0.0819], -TURN, TURN),
    "Universal UR5": ("standard", [0, -0.425, -0.39225, 0, 0, 0], UR, [0.089159, 0, 0, 0.10915, 0.09465, 0.0823], -TURN, TURN),
    "Universal UR10": ("standard", [0, -0.612, -0.5723, 0, 0, 0], UR, [0.1273, 0, 0, 0.163941, 0.1157, 0.0922], -TURN, TURN),
    "Universal UR5e": ("standard", [0, -0.425, -0.3922, 0, 0, 0], UR, [0.1625, 0, 0, 0.1333, 0.0997, 0.0996], -TURN, TURN),
    "Puma 560": ("standard", [0, 0.4318, 0.0203, 0, 0, 0], [H, 0, -H, H, -H, 0], [0, 0, 0.15005, 0.4318, 0, 0], PUMA[0], PUMA[1]),
    "Franka Emika Panda": (
        "modified",
        [0, 0, 0, 0.0825, -0.0825, 0, 0.088],
        [0, -H, H, H, -H, H, H],
        [0.333, 0, 0.316, 0, 0.384, 0, 0.107],
        PANDA_LOWER,
        PANDA_UPPER,
    ),
    "KUKA LBR iiwa 7 R800": ("standard", [0] * 7, IIWA, [0.34, 0, 0.4, 0, 0.4, 0, 0.126], -IIWA_LIMITS, IIWA_LIMITS),
    "KUKA LBR iiwa 14 R820": ("standard", [0] * 7, IIWA, [0.36, 0, 0.42, 0, 0.4, 0, 0.126], -IIWA_LIMITS, IIWA_LIMITS),
}
# Solve rate and mean time of TRAC-IK 1.5.1, published by its authors. They used 10,000 reachable poses, tolerance 1e-5, starts in the
# middle of the joint ranges and at most 5 ms per pose.
TRAC_IK = {
    "Universal UR3": "98.60 %, 0.45 ms",
    "Universal UR5": "99.17 %, 0.37 ms",
    "Universal UR10": "99.33 %, 0.36 ms",
    "Franka Emika Panda": "99.88 %, 0.37 ms",
    "KUKA LBR iiwa 14 R820": "99.92 %, 0.28 ms",
}


def from_table(convention: str, a: list[Any], alpha: list[Any], d: list[Any], lower: Any, upper: Any) -> al.Arm:
    """An arm with unit masses and joint limits from a Denavit-Hartenberg table; every joint rotates about its z axis."""
    n = len(a)
    lower, upper = np.broadcast_to(lower, n), np.broadcast_to(upper, n)
    joints: list[dict[str, Any]] = []
    before = (0.0, 0.0, 0.0)
    for k in range(n):
        x, turn, z = (a[k], alpha[k], d[k]) if convention == "modified" else before
        # Modified convention: Rx Tx Rz Tz, so the offset d is along the rotated z axis. Standard convention: Tz Tx Rx of the previous row.
        place = [x, -z * np.sin(turn), z * np.cos(turn)] if convention == "modified" else [x, 0.0, z]
        phi = [1.0, 0.0, 0.0, 0.1, 0.1, 0.0, 0.1, 0.0, 0.0, 0.1]
        joints.append({"type": "R", "axis": [0, 0, 1], "rpy": [turn, 0, 0], "xyz": place, "phi": phi, "lower": lower[k], "upper": upper[k]})
        before = (a[k], alpha[k], d[k])
    if convention == "standard":
        joints.append({"type": "F", "xyz": [before[0], 0.0, before[2]], "rpy": [before[1], 0, 0]})
    return al.Arm.from_chain(joints)


def arms() -> dict[str, al.Arm]:
    """Ten arms: two of armlet's examples, and eight from published tables."""
    own = {f"armlet's {name}": al.load_urdf(al.example_urdf(name)) for name in ("six_axis", "seven_axis")}
    for name, (convention, a, alpha, d, *limits) in TABLES.items():
        own[name] = from_table(convention, a, alpha, d, *limits)
        if convention == "standard":
            rows = [(a[k], alpha[k], d[k], 0.0) for k in range(len(a))]
            q, plain = np.linspace(-1.0, 1.0, len(a)), al.Arm.from_dh(rows)
            assert np.allclose(own[name].pose(q, own[name].frame_names[-1]), plain.pose(q, plain.frame_names[-1]), atol=1e-12)
    return own


def rotation_vectors(R: Array) -> Array:
    """Rotation vectors (..., 3) of rotation matrices (..., 3, 3).

    The unit quaternion is an eigenvector of the largest eigenvalue (Bar-Itzhack 2000).
    """
    K = np.empty((*R.shape[:-2], 4, 4))
    K[..., :3, :3] = R + np.swapaxes(R, -1, -2)
    K[..., range(3), range(3)] -= np.trace(R, axis1=-2, axis2=-1)[..., None]
    skew = np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], axis=-1)
    K[..., 3, :3] = K[..., :3, 3] = skew
    K[..., 3, 3] = np.trace(R, axis1=-2, axis2=-1)
    quaternion = np.linalg.eigh(K)[1][..., -1]
    quaternion *= np.where(quaternion[..., 3:] < 0.0, -1.0, 1.0)
    sine = np.linalg.norm(quaternion[..., :3], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, quaternion[..., 3:])
    return np.asarray(quaternion[..., :3] * np.where(sine > 0.0, angle / np.where(sine > 0.0, sine, 1.0), 2.0))


def poses(arm: al.Arm, q: Array) -> tuple[Array, list[al.Task]]:
    """The poses of the last frame at `q`, and a task whose target is each pose."""
    frame = arm.frame_names[-1]
    X = arm.pose(q, frame)
    return X, [al.Task(frame, "xyz rx ry rz", np.concatenate([X[..., :3, 3], rotation_vectors(X[..., :3, :3])], axis=-1))]


def check(arm: al.Arm, X: Array, found: al.InverseKinematics, tolerance: float) -> None:
    """Assert by forward kinematics that every pose marked as reached is reached within the joint limits."""
    good = found.reached
    # The tolerance applies to each entry of the error. The rotation vector adds up to 1e-7 near a rotation by pi.
    assert np.abs(arm.pose(found.q[good], arm.frame_names[-1]) - X[good]).max() <= 10 * tolerance + 1e-7
    assert np.all((found.q[good] >= arm.limits["q_min"]) & (found.q[good] <= arm.limits["q_max"]))


def near(name: str) -> tuple[list[Case], float]:
    """Time of poses of one arm on one and two threads, from starts within 0.3 rad of a solution; and the share of poses reached."""
    arm, rng = al.load_urdf(al.example_urdf(name)), np.random.default_rng(1)
    low, high = np.maximum(arm.limits["q_min"], -np.pi), np.minimum(arm.limits["q_max"], np.pi)
    q = rng.uniform(low, high, (POSES, arm.n))
    X, tasks = poses(arm, q)
    starts = np.clip(q + rng.uniform(-0.3, 0.3, q.shape), low, high)
    found = al.inverse_kinematics(arm, tasks, starts, threads=1)
    check(arm, X, found, 1e-9)
    again = al.inverse_kinematics(arm, tasks, starts, threads=2)
    assert np.array_equal(found.q, again.q) and np.array_equal(found.iterations, again.iterations)
    frame, target = arm.frame_names[-1], np.array(tasks[0].__getnewargs_ex__()[1]["target"])
    first = found.restarts == 0
    direct = [al.Task(frame, "xyz rx ry rz", target[first])]
    for i in range(0, POSES, 512):
        one = al.inverse_kinematics(arm, [al.Task(frame, "xyz rx ry rz", target[i])], starts[i])
        assert one.q.tobytes() == found.q[i].tobytes()
    group = f"{name}: {POSES} poses to 1e-9 from starts within 0.3 rad, {np.median(found.iterations):.0f} steps in the median: us per pose"
    cases = [
        Case(
            group,
            f"{name}, {threads} thread{'s' * (threads > 1)}",
            lambda threads=threads: al.inverse_kinematics(arm, tasks, starts, threads=threads),
            per=POSES,
            unit="us",
            scale=1e6,
            threads=threads,
        )
        for threads in (1, 2)
    ]
    count = int(first.sum())
    label = f"{name}, the {first.mean():.1%} that need no random start"
    cases.append(Case(group, label, lambda: al.inverse_kinematics(arm, direct, starts[first], threads=1), per=count, unit="us", scale=1e6))
    return cases, float(found.reached.mean())


def success(name: str, arm: al.Arm, tolerance: float = 1e-5) -> str:
    """A row of the table: share of random reachable poses that are reached from random starts."""
    rng = np.random.default_rng(2)
    low, high = arm.limits["q_min"], arm.limits["q_max"]
    low, high = np.where(np.isfinite(low), low, -np.pi), np.where(np.isfinite(high), high, np.pi)
    q, starts = (rng.uniform(low, high, (RANDOM, arm.n)) for _ in range(2))
    X, tasks = poses(arm, q)
    began = time.process_time()
    found = al.inverse_kinematics(arm, tasks, starts, tolerance=tolerance, threads=1)
    mean = (time.process_time() - began) / RANDOM * 1e3
    check(arm, X, found, tolerance)
    first = float(np.mean(found.reached & (found.restarts == 0)))
    return f"| {name} | {arm.n} | {found.reached.mean():.2%} | {first:.1%} | {mean:.3f} ms | {TRAC_IK.get(name, '')} |"


def main() -> None:
    options = reporting.arguments(__doc__.splitlines()[0]).parse_args()
    reporting.require_release("bench_inverse_kinematics")
    share = timing.busy()
    measured = [near(name) for name in ("six_axis", "seven_axis")]
    cases = [case for group, _ in measured for case in group]
    timing.measure(cases, options.rounds, options.core, lambda text: None)
    verdicts = []
    for (one, _, direct), found in measured:
        rate = 1e6 / one.median
        name = one.name.split(",")[0]
        verdicts.append((f"{name}: poses per second and core", f">= {GOAL:,}", f"{rate:,.0f}", rate >= GOAL))
        alone = 1e6 / direct.median
        verdicts.append((f"{name}: poses without random starts, per second and core (aim)", f">= {AIM:,}", f"{alone:,.0f}", alone >= AIM))
        verdicts.append((f"{name}: near poses solved", "100 %", f"{found:.2%}", found == 1.0))
    timing.pin([options.core])
    table = [
        f"Of {RANDOM:,} random reachable poses, from random starts within the limits, to 1e-5 m and rad:",
        "",
        "| arm | joints | found | from the first start | mean time | TRAC-IK 1.5.1, by its authors |",
        "|---|---:|---:|---:|---:|---:|",
        *(success(name, arm) for name, arm in arms().items()),
    ]
    timing.pin(timing.cores())
    if not (options.markdown or options.readme):
        print("\n".join(table))
    text = reporting.report(cases, verdicts, share, options.markdown or options.readme, tuple(table))
    reporting.finish("inverse_kinematics", text, options.readme)


if __name__ == "__main__":
    main()
