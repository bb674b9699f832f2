"""Search for the smallest value of a function of the unit cube: random starts, steps along the gradient, and a local search.

    minimise over u in [0, 1]^k   m(u)

The starts are the point of the caller, corners of the cube, and a Latin hypercube [McKayEtAl1979]. In each coordinate of a Latin
hypercube, every point has another one of equal intervals. A step from `u` along the gradient `g` is projected onto the cube. It has several
lengths `t`:

    u_next = clip(u - t d),   d = g / max|g|  or  d = sign(g)

The local search moves one coordinate or all of them by a step. The step is halved after a round without a smaller value.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["Axis", "CubeSearch"]

Array: TypeAlias = NDArray[np.float64]

#: Lengths of the steps along the sign of the gradient, and along the gradient. They are multiples of the radius of the start.
SIGNED, STRAIGHT = (1.0, 0.25, 0.0625), (1.0, 0.25)
#: Smallest radius of a start, and smallest step of the local search, in a cube with edges of length 1.
FINEST = 2.0**-12
#: Number of points per round of the local search in which all coordinates move.
MIXED = 4
#: Largest number of points that are drawn together at the end.
TOGETHER = 64
#: Largest number of points between two reports of the progress.
PIECE = 1024


@dataclass(frozen=True)
class Axis:
    """A coordinate of the cube.

    Args:
        kind: "smooth" has derivatives, "ordered" has none, and "free" has no order: each of its values is drawn independently.
        count: number of values of a coordinate with discrete values; None for a continuous one.
        consecutive: whether points that are drawn together have consecutive values, such as seeds that share a batch.
    """

    kind: Literal["smooth", "ordered", "free"]
    count: int | None = None
    consecutive: bool = False


class CubeSearch:
    """One search. It stores every point, its value and its stage.

    Args:
        evaluate: computes the values of S points (S, k), as (S,).
        slope: computes the gradient at a point, (k,). None means that there is no gradient at this point.
        axes: the coordinates.
        budget: largest number of values and gradients.
        seed: seed of the random numbers.
    """

    def __init__(
        self, evaluate: Callable[[Array], Array], slope: Callable[[Array], Array | None], axes: Sequence[Axis], budget: int, seed: int
    ) -> None:
        self.evaluate, self.slope, self.axes, self.budget = evaluate, slope, list(axes), budget
        self.random = np.random.default_rng([seed, 3])
        self.points: list[Array] = []
        self.values: list[float] = []
        self.stages: list[str] = []
        self.gradients = 0
        #: Whether the local search reached its smallest step, and tried every value of the free coordinates there.
        self.converged = False
        self.smooth, self.moved, self.free = (
            np.array([axis.kind in kinds for axis in axes]) for kinds in (("smooth",), ("smooth", "ordered"), ("free",))
        )
        self.known: set[bytes] = set()
        self.report: Callable[[int, float], object] = lambda done, best: None

    @property
    def left(self) -> int:
        """The number of values and gradients that may still be computed."""
        return self.budget - len(self.values) - self.gradients

    @property
    def best(self) -> int:
        """The index of the point with the smallest value; the first of equal ones."""
        return int(np.argmin(self.values))

    @property
    def at_bottom(self) -> bool:
        """Whether a value is -infinity, so that no other one can be smaller."""
        return bool(self.values) and self.values[self.best] == -np.inf

    def search(self, own: Array, starts: int, report: Callable[[int, float], object]) -> None:
        """Run all stages. `own` is the first start, (k,). `report` is called with the spent budget and the smallest value so far."""
        self.report = report
        self._draw(own, max(self.budget // 2, 1))
        if self.smooth.any() and not self.at_bottom:
            self._descend(starts, reserve=self.left // 2)
        if self.moved.any():
            self._refine()
        if self.free.any():
            self._redraw()

    def _run(self, stage: str, points: Array) -> Array:
        """Compute the values of points, (S,). A point that exceeds the budget has the value infinity."""
        points = self._snapped(points)
        values = np.full(len(points), np.inf)
        fresh: list[int] = []
        for i, point in enumerate(points):
            if point.tobytes() not in self.known and len(fresh) < self.left:
                self.known.add(point.tobytes())
                fresh.append(i)
        for first in range(0, len(fresh), PIECE):
            part = fresh[first : first + PIECE]
            values[part] = self.evaluate(points[part])
            self.points += list(points[part])
            self.values += values[part].tolist()
            self.stages += [stage] * len(part)
            self.report(self.budget - self.left, self.values[self.best])
        return values

    def _snapped(self, points: Array) -> Array:
        """Return the points with the middles of the intervals of discrete values."""
        points = np.clip(points, 0.0, 1.0)
        for j, axis in enumerate(self.axes):
            if axis.count is not None:
                points[:, j] = (np.minimum(np.floor(points[:, j] * axis.count), axis.count - 1) + 0.5) / axis.count
        return points

    def _redrawn(self, points: Array) -> Array:
        """Return the points with new random values of the free coordinates."""
        points = points.copy()
        for j, axis in enumerate(self.axes):
            if axis.kind == "free":
                assert axis.count is not None, "free coordinates are discrete"
                if axis.consecutive:
                    drawn = (int(self.random.integers(axis.count)) + np.arange(len(points))) % axis.count
                else:
                    drawn = self.random.integers(axis.count, size=len(points))
                points[:, j] = (drawn + 0.5) / axis.count
        return points

    def _draw(self, own: Array, count: int) -> None:
        """Compute the values of the starts: `own`, corners, and a Latin hypercube."""
        k, dimensions = len(self.axes), int(self.moved.sum())
        few = count // 4
        if 2**dimensions <= few:
            signs = np.array(list(np.ndindex(*[2] * dimensions)), dtype=np.float64).reshape(2**dimensions, dimensions)
        else:
            signs = self.random.integers(0, 2, (few, dimensions)).astype(np.float64)
        corners = np.full((len(signs), k), 0.5)
        corners[:, self.moved] = signs
        rest = max(count - 1 - len(corners), 0)
        cells = self.random.permuted(np.tile(np.arange(rest), (k, 1)), axis=1).T
        cube = (cells + self.random.random((rest, k))) / max(rest, 1)
        self._run("start", np.vstack([own[None], self._redrawn(np.vstack([corners, cube]))])[:count])

    def _descend(self, starts: int, reserve: int) -> None:
        """Follow the gradient from the best starts, until no step is better or `reserve` values are left."""
        per_step = len(SIGNED) + len(STRAIGHT) + 1
        starts = min(starts, max((self.left - reserve) // (3 * per_step), 1))
        order = np.argsort(self.values, kind="stable")[:starts]
        active = [(self.points[i], self.values[i], 1.0) for i in order]
        while active and self.left > reserve:
            trials: list[tuple[Array, float, float, Array]] = []
            for point, value, radius in active:
                slope = self._slope(point) if self.left > reserve else None
                if slope is not None:
                    largest = np.abs(slope).max()
                    steps = [-radius * t * np.sign(slope) for t in SIGNED] + [-radius * t * slope / largest for t in STRAIGHT]
                    trials.append((point, value, radius, point + np.array(steps)))
            if not trials:
                return
            values = self._run("gradient", np.vstack([points for *_, points in trials]))
            active = []
            for (point, value, radius, points), found in zip(trials, np.split(values, len(trials)), strict=True):
                least = int(found.argmin())
                if found[least] < value:
                    active.append((self._snapped(points)[least], float(found[least]), min(2.0 * radius, 1.0)))
                elif radius / 16.0 > FINEST:
                    active.append((point, value, radius / 16.0))
            if self.at_bottom:
                return

    def _slope(self, point: Array) -> Array | None:
        """Return the gradient of the smooth coordinates at a point, without the parts that point out of the cube."""
        slope = self.slope(point)
        if slope is None:
            return None
        self.gradients += 1
        slope = np.where(self.smooth, slope, 0.0)
        outwards = ((point <= 0.0) & (slope > 0.0)) | ((point >= 1.0) & (slope < 0.0))
        slope = np.where(outwards, 0.0, slope)
        return slope if np.isfinite(slope).all() and slope.any() else None

    def _refine(self) -> None:
        """Search near the best point. The step is halved after a round without a smaller value."""
        step = 1.0
        while step >= FINEST and self.left > 0 and not self.at_bottom:
            centre, value = self.points[self.best], self.values[self.best]
            alone = self._alone(centre, step)
            found = self._run("local", np.vstack([alone, self._mixed(centre, step)]))
            moves = (alone - centre)[found[: len(alone)] < value]
            if len(moves) > 1:
                # Each of these moves has a smaller value, so all of them together are tried too.
                self._run("local", centre[None] + moves.sum(axis=0))
            step = step if self.values[self.best] < value else step / 2.0
        self.converged = step < FINEST and not self.free.any()

    def _redraw(self) -> None:
        """Draw new values of the free coordinates at the best point, until the budget is spent or there are no new points."""
        fresh = True
        while fresh and self.left > 0 and not self.at_bottom:
            before = len(self.values)
            self._run("local", self._redrawn(np.tile(self.points[self.best], (min(self.left, TOGETHER), 1))))
            fresh = len(self.values) > before
        self.converged = not fresh

    def _alone(self, centre: Array, step: float) -> Array:
        """Return points at which one coordinate of `centre` has moved by `step`, or to the next value of a discrete coordinate."""
        points = np.tile(centre, (2 * int(self.moved.sum()), 1))
        for i, j in enumerate(np.flatnonzero(self.moved)):
            count = self.axes[j].count
            points[2 * i : 2 * i + 2, j] += np.array([-1.0, 1.0]) * (step if count is None else max(step, 1.0 / count))
        return self._snapped(points)

    def _mixed(self, centre: Array, step: float) -> Array:
        """Return points at which all coordinates have moved by at most `step`, with free coordinates drawn again in some of them."""
        points = np.tile(centre, (MIXED, 1))
        points[:, self.moved] += step * self.random.uniform(-1.0, 1.0, (MIXED, int(self.moved.sum())))
        return np.vstack([points, self._redrawn(np.tile(centre, (2 * MIXED, 1)))]) if self.free.any() else points
