"""Blocks of random paths of small arms, timed one by one and checked together by numpy.

The checks are those of test_time_path_identities.py. They use neither the planner nor the arm's dynamics.

    tau_j = sum_(k >= j) m_k (p_k - P_j) x (a_k - g) + I_k phi_k_ddot   (d'Alembert; P_j joint, p_k centre of mass, phi_k absolute angle)
    natural spline by its second derivatives, solved as a dense matrix for all paths of a block
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]
EPS = float(np.finfo(np.float64).eps)
PROMISE = 1e-9
STRATA = ("nominal", "tiny", "limits", "repeated", "reversed", "end speed", "idle", "friction")
#: Number of paths of a block. They share one arm and one number of waypoints.
SIZE = 250
#: Numbers of checked times of a path: at grid points, at random, and in pairs. Differences are computed from pairs around the middle of a
#: segment.
NODES, ANYWHERE, PAIRS = 8, 24, 10
APART = 1e-3


class Planar:
    """A planar arm of uniform rods of 1 kg/m."""

    def __init__(self, lengths: list[float], gravity: float) -> None:
        self.arm, self.n, self.gravity = al.planar_arm(lengths, gravity=(0.0, -gravity)), len(lengths), gravity
        self.l = np.array(lengths)
        # Upper bounds of the entries of the mass matrix and of the weight.
        self.mass, self.weight = float(self.l.sum() ** 3), gravity * float(self.l.sum() ** 2)

    def torques(self, q: Array, v: Array, a: Array) -> Array:
        """Joint torques (..., n), N m."""
        phi, w, dw = (np.cumsum(x, axis=-1) for x in (q, v, a))
        c, s, l = np.cos(phi), np.sin(phi), self.l
        # The contribution of each rod to the acceleration and position of the next rods.
        ax, ay, px, py = -(dw * s + w * w * c) * l, (dw * c - w * w * s) * l, c * l, s * l
        at = [np.cumsum(x, axis=-1) - x for x in (px, py, ax, ay)]
        X, Y, AX, AY = at[0] + 0.5 * px, at[1] + 0.5 * py, at[2] + 0.5 * ax, at[3] + 0.5 * ay + self.gravity
        tau = np.empty_like(q)
        for j in range(self.n):
            moment = (X[..., j:] - at[0][..., j : j + 1]) * AY[..., j:] - (Y[..., j:] - at[1][..., j : j + 1]) * AX[..., j:]
            tau[..., j] = (l[j:] * (moment + l[j:] ** 2 / 12 * dw[..., j:])).sum(axis=-1)
        return tau


class Slide:
    """A prismatic joint with a revolute joint, in a horizontal plane: [[A, B cos q2], [B cos q2, C]] a + (-B sin q2 v2^2, 0)."""

    def __init__(self) -> None:
        self.A, self.B, self.C = 2.0, 0.5, 0.5
        self.arm, self.n, self.mass, self.weight = al.planar_pr(self.A, self.B, self.C), 2, 2.5, 0.0

    def torques(self, q: Array, v: Array, a: Array) -> Array:
        c, s = np.cos(q[..., 1]), np.sin(q[..., 1])
        first = self.A * a[..., 0] + self.B * (c * a[..., 1] - s * v[..., 1] ** 2)
        return np.stack([first, self.B * c * a[..., 0] + self.C * a[..., 1]], axis=-1)


LENGTHS = ([0.5], [0.5, 0.4], [0.5, 0.4, 0.2])
LIGHT = [*(Planar(lengths, 0.0) for lengths in LENGTHS), Slide()]
HEAVY = [*(Planar(lengths, 9.81) for lengths in LENGTHS), Slide()]


class Splines:
    """Natural cubic splines through q (B, K, n) at s (B, K), for all paths of a block."""

    def __init__(self, s: Array, q: Array) -> None:
        B, K, _ = q.shape
        h = np.diff(s, axis=1)
        slope = np.diff(q, axis=1) / h[..., None]
        lhs, rhs = np.broadcast_to(np.eye(K), (B, K, K)).copy(), np.zeros_like(q)
        for k in range(1, K - 1):
            lhs[:, k, k - 1], lhs[:, k, k], lhs[:, k, k + 1] = h[:, k - 1], 2 * (h[:, k - 1] + h[:, k]), h[:, k]
            rhs[:, k] = 6 * (slope[:, k] - slope[:, k - 1])
        M = np.linalg.solve(lhs, rhs)
        w = h[..., None]
        self.s, self.q = s, q
        # Each piece about its left end is q + d z + m z^2/2 + r z^3/6.
        self.d = slope - w * (2 * M[:, :-1] + M[:, 1:]) / 6
        self.m, self.r = M[:, :-1], (M[:, 1:] - M[:, :-1]) / w

    def piece(self, at: Array) -> NDArray[np.int64]:
        """Indices of the pieces that contain the path positions `at` (B, T)."""
        return np.asarray((at[..., None] >= self.s[:, None, 1:-1]).sum(axis=-1))

    def __call__(self, at: Array, k: NDArray[np.int64]) -> tuple[Array, Array, Array]:
        """q, q' and q'', each (B, T, n), at the path positions `at` (B, T) on the pieces `k` (B, T)."""
        row = np.arange(at.shape[0])[:, None]
        z = (at - self.s[row, k])[..., None]
        d, m, r = self.d[row, k], self.m[row, k], self.r[row, k]
        return self.q[row, k] + z * (d + z * (m / 2 + z * r / 6)), d + z * (m + z * r / 2), m + z * r

    def third(self, k: NDArray[np.int64]) -> Array:
        """Magnitude (B, T, n) of the third derivative on the pieces `k` (B, T)."""
        return np.abs(self.r[np.arange(k.shape[0])[:, None], k])


@dataclass
class Block:
    stratum: str
    mover: Any
    q: Array
    """Waypoints, (B, K, n). Neighbours are different."""
    given: list[Array]
    """Paths as arguments of the planner, one per problem."""
    splines: Splines
    lower: Array
    upper: Array
    viscous: Array
    keywords: list[dict[str, Any]] = field(default_factory=list)


def block(stratum: str, rng: np.random.Generator, size: int = SIZE) -> Block:
    """Random problems that are all feasible: the torques can hold the arm everywhere, with a margin."""
    light = stratum in ("tiny", "limits", "end speed", "idle") or rng.random() < 0.5
    mover = (LIGHT if light else HEAVY)[rng.integers(4)]
    n, K = mover.n, int(rng.integers(2, 5))
    q = rng.uniform(-1.5, 1.5, (size, K, n))
    if stratum == "tiny":
        near = (q - q[:, :1]) * 10.0 ** rng.uniform(-16.0, -6.0, (size, 1, 1))
        away = near + np.where(rng.random((size, 1, 1)) < 0.3, rng.uniform(-1.0, 1.0, (size, 1, n)), 0.0)
        # If rounding makes neighbouring waypoints equal, the offset is omitted.
        alike = (np.diff(away, axis=1) == 0.0).all(axis=2).any(axis=1)
        q = np.where(alike[:, None, None], near, away)
    if stratum == "idle":
        q = np.where(rng.random((size, 1, n)) < 0.5, 0.3, q)
        moving = rng.integers(0, n, size)
        q[np.arange(size), :, moving] = np.cumsum(rng.uniform(0.1, 1.0, (size, K)), axis=1)
    if stratum == "reversed":
        q = np.concatenate([q, q[:, -2::-1]], axis=1)
        K = q.shape[1]
    given = [np.repeat(path, rng.integers(1, 4, K), axis=0) for path in q] if stratum == "repeated" else list(q)
    size_of = np.abs(q).max(axis=(1, 2))[:, None]
    steps = np.linalg.norm(np.diff(q, axis=1) / size_of[..., None], axis=2)
    along = np.concatenate([np.zeros((size, 1)), np.cumsum(steps, axis=1)], axis=1)
    splines = Splines(along / along[:, -1:], q)
    held = np.zeros((size, n))
    if mover.weight > 0.0:
        at = np.broadcast_to(np.linspace(0.0, 1.0, 100), (size, 100))
        pose = splines(at, splines.piece(at))[0]
        held = np.abs(mover.torques(pose, np.zeros_like(pose), np.zeros_like(pose))).max(axis=1)
    span = 10.0 ** rng.uniform(-3.0, 8.0, (size, n)) if stratum == "limits" else rng.uniform(1.0, 30.0, (size, n))
    upper = held * 1.05 + span
    lower = -np.where(rng.random((size, 1)) < 0.5, 1.0, rng.uniform(0.5, 1.0, (size, n)) if light else 1.0) * upper
    upper = np.where(rng.random((size, 1)) < 0.3, rng.uniform(1.0, 3.0, (size, n)), 1.0) * upper
    viscous = np.zeros((size, n))
    if stratum == "friction":
        viscous = 10.0 ** rng.uniform(-3.0, 0.0, (size, n))
    fast, quick = rng.random(size) < 0.5, rng.random(size) < 0.3
    v_max, a_max = rng.uniform(0.5, 5.0, (size, n)), rng.uniform(1.0, 20.0, (size, n))
    grids = np.where(rng.random(size) < 0.02, 0, rng.integers(9, 42, size))
    b = Block(stratum, mover, q, given, splines, lower, upper, viscous)
    if stratum == "end speed":
        # The end speed is on the speed limit. Torque limits are large, so that they do not bind.
        lower[:], upper[:] = -1e6, 1e6
        last = np.ones((size, 1))
        slope = np.abs(splines(last, splines.piece(last))[1][:, 0])
        ends = np.min(np.divide(v_max, slope, out=np.full_like(slope, np.inf), where=slope > 0), axis=1)
    for i in range(size):
        keywords: dict[str, Any] = {"tau_max": np.stack([lower[i], upper[i]], axis=1)}
        if grids[i]:
            keywords["grid"] = int(grids[i])
        if stratum == "end speed":
            keywords |= {"v_max": v_max[i], "end_speed": float(ends[i])}
        else:
            if fast[i]:
                keywords["v_max"] = v_max[i]
            if quick[i]:
                keywords["a_max"] = a_max[i]
        if stratum == "friction":
            keywords["friction"] = viscous[i]
        b.keywords.append(keywords)
    return b


@dataclass
class Verdict:
    """Result of a block: smallest reported margin, largest excess of a limit, and failures as (index, description)."""

    count: int
    margin: float
    excess: float
    points: int
    failed: list[tuple[int, str]]


def judge(b: Block, rng: np.random.Generator) -> Verdict:
    size, n, T = len(b.given), b.mover.n, NODES + ANYWHERE + 2 * PAIRS
    z = np.zeros((size, T))
    z[:, NODES : NODES + ANYWHERE] = rng.random((size, ANYWHERE))
    z[:, NODES + ANYWHERE : T - PAIRS], z[:, T - PAIRS :] = 0.5 - APART, 0.5 + APART
    pick = rng.random((size, NODES + ANYWHERE + PAIRS))
    q, v, a = (np.full((size, T, n), np.nan) for _ in range(3))
    s0, s1, t0, step, rate = (np.full((size, T), np.nan) for _ in range(5))
    failed: list[tuple[int, str]] = []
    margin, points = np.inf, 0
    duration = np.full(size, np.nan)
    for i in range(size):
        p = al.time_path(b.mover.arm, b.given[i], **b.keywords[i])
        if not p.feasible or p.reason is not None:
            failed.append((i, f"refused: {p.reason}"))
            continue
        t, s, s_dot = p.t, p.s, p.s_dot
        duration[i], margin, points = p.duration, min(margin, p.margin), points + t.size
        k = (pick[i] * (t.size - 1)).astype(np.int64)
        k = np.concatenate([k, k[-PAIRS:]])
        t0[i], step[i], s0[i], s1[i], rate[i] = t[k], t[k + 1] - t[k], s[k], s[k + 1], s_dot[k]
        q[i], v[i], a[i] = p(t0[i] + z[i] * step[i])
        if not (np.isfinite(t).all() and np.isfinite(s_dot).all() and t[-1] == duration[i] > 0.0 and p.margin >= -PROMISE):
            failed.append((i, f"duration {duration[i]}, margin {p.margin}"))
    had = np.isfinite(duration)
    found = -np.inf

    def refuse(bad: Array, what: str) -> None:
        """Record failures. `bad` is (B, T, n), (B, T) or (B,)."""
        hit = bad.reshape(size, -1).any(axis=1) & had
        failed.extend((int(i), what) for i in np.flatnonzero(hit))

    with np.errstate(invalid="ignore", divide="ignore"):
        refuse(~(np.isfinite(q) & np.isfinite(v) & np.isfinite(a)), "not finite")
        tau = b.mover.torques(q, v, a) + b.viscous[:, None] * v
        load = b.mover.mass * (np.abs(a).sum(axis=-1) + np.square(v).sum(axis=-1)) + b.mover.weight
        rounding = 64 * EPS * load[..., None] + 16 * EPS * np.abs(tau) + 4 * EPS * b.viscous[:, None] * np.abs(v)
        for name, values, lower, upper, slack in (
            ("tau_max", tau, b.lower, b.upper, rounding),
            ("v_max", v, None, limits(b, "v_max"), 0.0),
            ("a_max", a, None, limits(b, "a_max"), 0.0),
        ):
            lower = -upper if lower is None else lower
            past = np.maximum((values - slack - upper[:, None]) / upper[:, None], (values + slack - lower[:, None]) / lower[:, None])
            found = max(found, float(np.nanmax(past, initial=-np.inf)))
            refuse(past > PROMISE, f"{name} exceeded")
        # Samples must be on the path. Newton's method in the segment finds the s of each sample.
        piece, span = b.splines.piece(0.5 * (s0 + s1)), s1 - s0
        most = np.abs(b.q).max(axis=(1, 2))[:, None, None]
        size_of = np.abs(b.q - b.q[:, :1]).max(axis=(1, 2))[:, None, None]
        s = s0 + z * span
        # Where a path of one joint turns back, q' is zero, and Newton's method converges only by one bit per step. So 40 steps are taken
        # then.
        for steps in (5, 40):
            for _ in range(steps):
                where, slope, _ = b.splines(s, piece)
                s = np.clip(s + ((q - where) * slope).sum(axis=-1) / np.maximum(np.square(slope).sum(axis=-1), 1e-300), s0, s1)
            where, slope, bend = b.splines(s, piece)
            off = ~(np.abs(where - q) <= 1e-9 * size_of + 4 * EPS * most)
            if not off[had].any():
                break
        refuse(off, "off the path")
        square = np.square(slope).sum(axis=-1)
        # Where a path turns back, q' is nearly zero, and ds/dt cannot be determined there.
        steep = square > 1e-4 * square.max(axis=1)[:, None]
        speed = np.where(steep, (v * slope).sum(axis=-1) / square, 0.0)
        push = ((a - bend * speed[..., None] ** 2) * slope).sum(axis=-1) / square
        fast, most_a = np.abs(v).max(axis=(1, 2))[:, None, None], np.abs(a).max(axis=(1, 2))[:, None, None]
        # `doubt` is the uncertainty of s, `turn` the resulting uncertainty of the tangent.
        doubt = ((1e-9 * size_of + 16 * EPS * most)[..., 0] / np.sqrt(np.where(steep, square, 1.0)))[..., None]
        third = b.splines.third(piece).max(axis=-1, keepdims=True) * doubt
        turn = (np.abs(bend).max(axis=-1, keepdims=True) + third) * doubt
        refuse(steep[..., None] & (np.abs(v - slope * speed[..., None]) > 1e-9 * fast + turn * speed[..., None]), "speed off the path")
        told, allowed = np.abs(v - slope * rate[..., None]), 1e-9 * fast + turn * rate[..., None]
        refuse((steep[..., None] & (told > allowed))[:, :NODES], "s_dot is not that of v")
        square_speed = (speed**2)[..., None]
        # The uncertainty of ds/dt is that of the tangent divided by |q'|. The square of ds/dt has twice this uncertainty.
        rough = third + turn + 2 * np.abs(bend) * turn / np.sqrt(np.where(steep, square, 1.0))[..., None]
        allowed = 1e-6 * most_a + 1e-9 * np.abs(slope) * square_speed + 2 * (turn * np.abs(push)[..., None] + rough * square_speed)
        refuse(steep[..., None] & (np.abs(a - slope * push[..., None] - bend * square_speed) > allowed), "acceleration off the path")
        # Differences of q give v, and differences of v give a. The tolerance is h^2 times the next derivative, plus rounding of q and of
        # the time.
        first, second = slice(T - 2 * PAIRS, T - PAIRS), slice(T - PAIRS, T)
        h = (2 * APART * step[:, first])[..., None]
        late = 4 * EPS * duration[:, None, None] / h
        differ = np.abs((q[:, second] - q[:, first]) / h - 0.5 * (v[:, first] + v[:, second]))
        refuse(differ > (1e-5 + late) * fast + 4 * EPS * most / h, "v is not that of q")
        differ = np.abs((v[:, second] - v[:, first]) / h - 0.5 * (a[:, first] + a[:, second]))
        refuse(differ > (1e-4 + late) * most_a + 8 * EPS * fast / h, "a is not that of v")
    return Verdict(size, margin, found, points, failed)


def limits(b: Block, name: str) -> Array:
    """The limits `name` of a block, (B, n); infinite if a path has none."""
    none = np.full(b.mover.n, np.inf)
    return np.stack([keywords.get(name, none) for keywords in b.keywords])


def trial(stratum: str, number: int, seed: int, size: int = SIZE) -> Verdict:
    """Compute and check block `number` of a stratum."""
    rng = np.random.default_rng([seed, STRATA.index(stratum), number])
    return judge(block(stratum, rng, size), rng)
