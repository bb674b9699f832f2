"""The drawing of an arm on a page: lines between its joints, as in `figures.skeleton`."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import _core
from ..figures.skeleton import Skeleton

__all__ = ["drawing"]


def drawing(arm: _core.Arm, further: list[str]) -> dict[str, Any]:
    """Return what a page needs to draw an arm from the poses of its joints. `further` are other frames that are drawn.

    `parents` and `places` are the parent and the place of each joint. `frames` are the indices of drawn frames, and `carriers` the joints
    that carry them. The last frame is the tip. `reach` is the size of the picture, m, around `centre`. `flat`
    has the two axes of a plane arm.
    """
    if arm.tip_frame is None:
        # The slide of the planar PR arm moves along x. Its link has the angle q2 from the y axis, and a length for the picture alone.
        return {"kind": "PR", "frames": [], "reach": 1.6, "centre": [0.0, 0.0, 0.0], "flat": [0, 1]}
    skeleton = Skeleton("export_web", arm)
    others = {arm.frame_names.index(frame) for frame in further} - set(skeleton.frames)
    frames = [*sorted(others), *(k for k in skeleton.frames if k != skeleton.tip), skeleton.tip]
    random = np.random.default_rng(0)
    samples = random.uniform(-np.pi, np.pi, (64, arm.n))
    slides = [kind == "prismatic" for kind in arm.joint_types]
    samples[:, slides] /= 2.0 * np.pi
    lines = skeleton.lines(samples)
    cloud = lines.cloud()
    spread = np.ptp(cloud, axis=0)
    thin = int(np.argmin(spread))
    flat = [i for i in range(3) if i != thin] if spread[thin] <= 1e-9 * max(float(spread.max()), 1.0) else None
    base = skeleton.lines(np.zeros((1, arm.n))).links[0, 0, 0]
    return {
        "kind": "tree",
        "frames": frames,
        "carriers": [arm.frame_joints[k] for k in frames],
        "parents": [int(parent) for parent in skeleton.parents],
        "places": skeleton.places.tolist(),
        "reach": float(np.linalg.norm(cloud - base, axis=1).max()) or 1.0,
        "centre": base.tolist(),
        "flat": flat,
    }
