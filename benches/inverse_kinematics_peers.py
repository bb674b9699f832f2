"""Number of poses that pink and mink reach from one start, on the arms of `bench_inverse_kinematics.py`.

    pip install pin-pink mink daqp
    python -P benches/inverse_kinematics_peers.py [poses]

pink and mink solve one quadratic program per step for a velocity within the joint limits. They have no random starts, so their shares
compare with the column "from the first start". Gain and duration of a step are one. A pose is reached within 1e-5 m and rad, in at most
200 steps.
"""

from __future__ import annotations

import re
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parent))
import bench_inverse_kinematics as ours

import armlet as al

Array = NDArray[np.float64]
STEPS, TOLERANCE = 200, 1e-5


def far(arm: al.Arm, q: Array, X: Array) -> float:
    """The largest entry of the pose error (m, rad), computed with armlet's kinematics."""
    Y = arm.pose(q, arm.frame_names[-1])
    turn = ours.rotation_vectors((X[:3, :3] @ Y[:3, :3].T)[None])[0]
    return float(np.abs(np.concatenate([X[:3, 3] - Y[:3, 3], turn])).max())


def by_pink(arm: al.Arm, path: Path, X: Array, starts: Array) -> int:
    """Number of poses that pink reaches."""
    import pink
    import pinocchio as pin

    model = pin.buildModelFromUrdf(str(path))
    frame, found = arm.frame_names[-1], 0
    for target, q0 in zip(X, starts, strict=True):
        task = pink.FrameTask(frame, position_cost=1.0, orientation_cost=1.0, lm_damping=1e-3)
        task.set_target(pin.SE3(target[:3, :3], target[:3, 3]))
        at = pink.Configuration(model, model.createData(), q0)
        for _ in range(STEPS):
            if far(arm, at.q, target) <= TOLERANCE:
                found += 1
                break
            try:
                v = pink.solve_ik(at, [task], 1.0, solver="daqp", limits=[at.model.configuration_limit])
            except Exception:
                break
            at.integrate_inplace(v, 1.0)
    return found


def by_mink(arm: al.Arm, path: Path, X: Array, starts: Array) -> int:
    """Number of poses that mink reaches."""
    import mink
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(path))
    limits = [mink.ConfigurationLimit(model)]
    name, found = arm.frame_names[-1], 0
    # MuJoCo's compiler merges links on fixed joints. The last remaining body is the body of the last joint.
    kind = mujoco.mjtObj.mjOBJ_BODY
    body = name if mujoco.mj_name2id(model, kind, name) >= 0 else mujoco.mj_id2name(model, kind, model.nbody - 1)
    for target, q0 in zip(X, starts, strict=True):
        at = mink.Configuration(model)
        at.update(q0)
        offset = np.linalg.inv(at.get_transform_frame_to_world(body, "body").as_matrix()) @ arm.pose(q0, name)
        wanted = mink.SE3.from_matrix(target @ np.linalg.inv(offset))
        task = mink.FrameTask(body, "body", position_cost=1.0, orientation_cost=1.0, lm_damping=1e-3)
        task.set_target(wanted)
        for _ in range(STEPS):
            if far(arm, at.q, target) <= TOLERANCE:
                found += 1
                break
            try:
                v = mink.solve_ik(at, [task], 1.0, "daqp", limits=limits)
            except Exception:
                break
            at.integrate_inplace(v, 1.0)
    return found


def row(name: str, arm: al.Arm, count: int) -> str:
    """A row of the table: shares of the poses that pink and mink reach."""
    rng = np.random.default_rng(2)
    low, high = arm.limits["q_min"], arm.limits["q_max"]
    low, high = np.where(np.isfinite(low), low, -np.pi), np.where(np.isfinite(high), high, np.pi)
    q, starts = (rng.uniform(low, high, (count, arm.n)) for _ in range(2))
    X, tasks = ours.poses(arm, q)
    found = al.inverse_kinematics(arm, tasks, starts, tolerance=TOLERANCE, restarts=0, threads=1)
    cells: list[Any] = [f"{found.reached.mean():.1%}"]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.urdf"
        # Pinocchio's reader requires an effort and a velocity in every limit.
        path.write_text(re.sub(r"<limit (?![^>]*effort)", '<limit effort="1000" velocity="100" ', arm.to_urdf()[0]))
        for solve in (by_pink, by_mink):
            began = time.process_time()
            reached = solve(arm, path, X, starts)
            cells.append(f"{reached / count:.1%}, {(time.process_time() - began) / count * 1e3:.1f} ms")
    return f"| {name} | {' | '.join(cells)} |"


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    print(f"Of {count} random reachable poses, from one random start:\n")
    print("| arm | armlet | pink | mink |\n|---|---:|---:|---:|")
    for name, arm in ours.arms().items():
        print(row(name, arm, count), flush=True)


if __name__ == "__main__":
    main()
