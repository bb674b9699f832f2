"""The numbers of a closed loop by name, and loops in which one number differs by a small step.

A *loop* is a plant, a law and a start. `"law.kp"` is an argument of the law, and `"plant.stiffness"` an argument of the plant.
`"arm.parameters"` are the inertial parameters of the plant's arm, and `"law.arm.parameters"` of the law's arm. `"arm.damping"`,
`"arm.friction"` and `"arm.armature"` are the joint damping, friction and armature of the arm. `"law.motion.amplitude"` is an argument of
the law's motion, and `"law.tasks.0.gain"` an argument of its first task. `"q0"`, `"v0"`, `"theta0"`, `"theta_dot0"` are the start.

The core runs a loop as machine code, its *programs*. The *set-up* computes the inputs of the programs from the numbers of the loop. The
derivative of the inputs with respect to a number is a finite difference of fourth order. The results of a run are never differenced. The
step is 2^-10 times the number, rounded down to a power of two. The relative error is about 1e-12 if the set-up computes with the number,
and 1e-13 if the set-up copies the number.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, TypeAlias

import numpy as np

from .. import _core
from ..arguments import shown
from ..errors import InputError
from .events import JointStops
from .recorded import Array

__all__ = [
    "RULES",
    "START",
    "STEP",
    "Loop",
    "NamedNumber",
    "Together",
    "Variants",
    "Varied",
    "entry_variants",
    "loop_with",
    "named_numbers",
    "stacked",
    "together",
    "varied",
    "varied_rows",
]

START = ("q0", "v0", "theta0", "theta_dot0")
#: Numbers that an arm has for each joint, in addition to its inertial parameters.
DRIVES = ("damping", "friction", "armature")
#: Fourth-order difference rules: offsets in steps, and weights of the differences from the middle value. The rules are central, forward
#: (all offsets > 0) and backward (all offsets < 0).
RULES = (
    ((-2.0, -1.0, 1.0, 2.0), (1 / 12, -8 / 12, 8 / 12, -1 / 12)),
    ((1.0, 2.0, 3.0, 4.0), (4.0, -3.0, 4 / 3, -1 / 4)),
    ((-1.0, -2.0, -3.0, -4.0), (-4.0, 3.0, -4 / 3, 1 / 4)),
)
STEP = 2.0**-10
#: A number with fewer entries than FEW gets four separate loops per entry.
FEW = 4
#: The golden ratio minus 1. Its multiples modulo 1 are spread evenly over [0, 1].
GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0

#: Plant, law and initial state of a control loop.
Loop: TypeAlias = tuple[Any, Any, Mapping[str, Any]]
#: Four copies of a control loop in which one entry of a named number is changed, and the weight of each copy in the derivative.
Variants: TypeAlias = tuple[list[Loop], list[float]]


@dataclass(frozen=True)
class NamedNumber:
    """The name of a number, and the value of this number in a loop. The value is an array, and its elements are the entries."""

    name: str
    value: Array


@dataclass(frozen=True)
class Varied:
    """The loops for the derivatives with respect to named numbers: run 0 is the loop itself, and the varied loops follow.

    Attributes:
        plants, laws: one plant and law for all R runs, or a list with one per run.
        start: q0, v0, theta0 and theta_dot0 of each run, (R, n) each; None where the loop has its default.
        weights: weights of the differences between the four varied runs and run 0, for each of the P entries, (P, 4). For a batch they
            are (B, P, 4), and the runs of its rows follow one another.
        names: the names with their values, in the order of the P entries.
        codes: for each name, the `codes` of `Together`, or None if each entry has four separate loops. Empty means None for all names.
        apart: a function that returns the loops for the same derivatives with four separate loops for each entry. None if each loop
            changes at most one entry.
    """

    plants: Any
    laws: Any
    start: dict[str, Array | None]
    weights: Array
    names: tuple[NamedNumber, ...]
    codes: tuple[list[int] | None, ...] = ()
    apart: Callable[[], Varied] | None = None

    @property
    def runs(self) -> tuple[Any, Any, Any, Array, list[int | tuple[int, list[int]]]]:
        """The first arguments of the core's derivative functions: plants, laws, q0, weights, and the number of entries of each name."""
        sizes = [named.value.size for named in self.names]
        codes = self.codes or [None] * len(sizes)
        parts = [size if code is None else (size, code) for size, code in zip(sizes, codes, strict=True)]
        return self.plants, self.laws, self.start["q0"], self.weights, parts


@dataclass(frozen=True)
class Together:
    """Loops that each change several entries of a number at once. From them the core finds which inputs of the programs each entry changes.

    Attributes:
        loops: the *probes*, in each of which some of the entries vary, then four loops in which all entries vary.
        weights: for each entry, the weights of the four loops in its derivative.
        codes: for each entry, an integer. Bit b is set if the entry varies in probe b. All codes have the same number of set bits.
    """

    loops: list[Loop]
    weights: list[list[float]]
    codes: list[int]


def named_numbers(plant: Any, law: Any, start: Mapping[str, Array | None]) -> dict[str, Array]:
    """Return the value of every number of a loop by name."""
    found = {name: value for name, value in start.items() if value is not None}
    found["v0"] = found.get("v0", np.zeros_like(found["q0"]))
    for name, value in _numbers(plant, "plant."):
        found[name.removeprefix("plant.") if name.startswith("plant.arm.") else name] = value
    found.update(_numbers(law, "law."))
    return found


def _arguments(thing: Any) -> Mapping[str, Any]:
    """Return the arguments with which the object `thing` was made, by name."""
    if isinstance(thing, list | tuple):
        return {str(i): each for i, each in enumerate(thing)}
    if isinstance(thing, JointStops):
        return {field.name: getattr(thing, field.name) for field in fields(thing)}
    make = getattr(thing, "__getnewargs_ex__", None)
    arguments: Mapping[str, Any] = make()[1] if make is not None else {}
    return arguments


def _numbers(thing: Any, prefix: str) -> Iterator[tuple[str, Array]]:
    if isinstance(thing, _core.Arm):
        yield f"{prefix}parameters", np.asarray(thing.parameters, dtype=np.float64)
        drives = thing.limits
        yield from ((prefix + name, np.array(drives[name])) for name in DRIVES if name in drives)
        return
    for name, value in _arguments(thing).items():
        numbers = _as_numbers(value)
        if numbers is not None:
            yield prefix + name, numbers
        else:
            yield from _numbers(value, f"{prefix}{name}.")
    if isinstance(thing, _core.Adaptive) and _arguments(thing).get("estimate") is None:
        yield f"{prefix}estimate", np.zeros(len(thing.parameter_names))


def _as_numbers(value: Any) -> Array | None:
    """Return an argument as an array of numbers, or None if it is not numeric."""
    if isinstance(value, bool | np.bool_ | int | str) or value is None:
        return None
    if isinstance(value, list | tuple) and not all(isinstance(each, float | int | list | tuple | np.ndarray) for each in value):
        return None
    try:
        numbers = np.asarray(value)
    except ValueError:
        return None
    return numbers.astype(np.float64) if numbers.dtype.kind == "f" and numbers.size else None


def _with(thing: Any, path: Sequence[str], value: Array) -> Any:
    """Return a copy of the object `thing` in which the number at `path` is replaced by `value`."""
    name, *rest = path
    if isinstance(thing, _core.Arm):
        return thing.with_drives(**{name: value}) if name in DRIVES else thing.with_parameters(value)
    if isinstance(thing, list | tuple):
        return type(thing)((_with(each, rest, value) if rest else value) if str(i) == name else each for i, each in enumerate(thing))
    if isinstance(thing, JointStops):
        return replace(thing, **{name: value})  # type: ignore[arg-type]  # the constructor also accepts arrays
    places, arguments = thing.__getnewargs_ex__()
    return type(thing)(*places, **{**arguments, name: _with(arguments[name], rest, value) if rest else value})


def loop_with(plant: Any, law: Any, start: Mapping[str, Any], name: str, value: Array) -> Loop:
    """Return a copy of the loop in which the number `name` is replaced by `value`."""
    if name in START:
        return plant, law, {**start, name: value}
    path = (f"plant.{name}" if name.startswith("arm.") else name).split(".")
    if path[0] == "plant":
        return _with(plant, path[1:], value), law, start
    return plant, _with(law, path[1:], value), start


def _scale(name: str, value: Array, index: tuple[int, ...]) -> float:
    """Return the magnitude of an entry, from which the step of the finite difference is computed."""
    largest = float(np.abs(value).max()) or 1.0
    if name.endswith("arm.parameters") or name.endswith(tuple(f"arm.{drive}" for drive in DRIVES)):
        return largest  # the set-up copies these numbers, so one step for all entries is accurate
    size = abs(float(value[index]))
    if value.ndim == 2 and value.shape[0] == value.shape[1]:
        i, j = index
        size = max(size, math.sqrt(abs(float(value[i, i] * value[j, j]))))
    return size or largest


def _variants(loop: Loop, named: NamedNumber, index: tuple[int, ...]) -> Variants:
    """Return four copies of `loop` in which the entry of the number at `index` is changed, and their weights in the derivative."""
    step = STEP * 2.0 ** math.floor(math.log2(_scale(named.name, named.value, index)))
    refused: InputError | None = None
    mirrored = len(index) == 2 and index[0] != index[1] and named.value.shape[0] == named.value.shape[1]
    for symmetric in (False, True) if mirrored else (False,):
        for offsets, weights in RULES:
            try:
                loops = [loop_with(*loop, named.name, _moved(named.value, index, offset * step, symmetric)) for offset in offsets]
            except InputError as error:
                refused = error
                continue
            return loops, [weight / step for weight in weights]
    raise InputError(f"sensitivity: {named.name} cannot be varied at {shown(float(named.value[index]))}: {refused}")


def _moved(value: Array, index: tuple[int, ...], by: float, symmetric: bool) -> Array:
    moved = value.copy()
    if symmetric:  # the entry and its mirror entry change by `by / 2` each, so that a symmetric matrix remains symmetric
        moved[index] += by / 2
        moved[index[::-1]] += by / 2
    else:
        moved[index] += by
    return moved


def varied(function: str, plant: Any, law: Any, start: Mapping[str, Array | None], names: Sequence[str]) -> Varied:
    """Make the loops for the derivatives with respect to the numbers `names` of one loop.

    Raises:
        InputError: the loop has no number of a name, a name occurs twice, or a number cannot be varied.
    """
    loop, chosen = (plant, law, start), chosen_numbers(function, named_numbers(plant, law, start), names)

    def alone(k: int) -> list[Variants]:
        return [_variants(loop, chosen[k], index) for index in np.ndindex(chosen[k].value.shape)]

    return stacked(loop, chosen, [together(loop, named, list(np.ndindex(named.value.shape))) for named in chosen], alone)


def varied_rows(function: str, loops: Sequence[Loop], names: Sequence[str]) -> Varied:
    """Make the loops for the derivatives with respect to the numbers `names` of each of the B rows of a batch.

    The numbers have P entries. The field `weights`, (B, P, 4), has the weights of the four varied loops of each entry. The field `names`
    has the values of the first row.

    Raises:
        InputError: a row has no number of a name, the shape of a number differs between rows, or a number cannot be varied.
    """
    made: dict[tuple[int, int], tuple[list[NamedNumber], dict[tuple[str, tuple[int, ...]], Variants]]] = {}
    rows: list[Varied] = []
    for r, (plant, law, start) in enumerate(loops):
        key = (id(plant), id(law))
        if key not in made:
            made[key] = chosen_numbers(function, named_numbers(plant, law, start), names), {}
        numbers, entries = made[key]
        own = [NamedNumber(named.name, np.asarray(start[named.name])) if start.get(named.name) is not None else named for named in numbers]
        if rows and [named.value.shape for named in own] != [named.value.shape for named in rows[0].names]:
            raise InputError(f"{function}: sensitivity names numbers of several shapes: expected one shape (first bad index {r})")
        variants: list[Variants] = []
        for named in own:
            for index in np.ndindex(named.value.shape):
                if named.name in START:
                    variants.append(_variants((plant, law, start), named, index))
                    continue
                place = (named.name, index)
                if place not in entries:
                    entries[place] = _variants((plant, law, start), named, index)
                others, weights = entries[place]
                variants.append(([(other, control, start) for other, control, _ in others], weights))
        rows.append(_stacked((plant, law, start), own, variants))
    return _joined(rows)


def _joined(rows: Sequence[Varied]) -> Varied:
    def each(values: Sequence[Any]) -> Any:
        if not any(isinstance(value, list) for value in values) and all(value is values[0] for value in values):
            return values[0]
        runs = 1 + 4 * len(rows[0].weights)
        return [one for value in values for one in (value if isinstance(value, list) else [value] * runs)]

    start = {part: None if rows[0].start[part] is None else np.concatenate([row.start[part] for row in rows]) for part in START}
    plants, laws = each([row.plants for row in rows]), each([row.laws for row in rows])
    return Varied(plants, laws, start, np.stack([row.weights for row in rows]), rows[0].names)


def chosen_numbers(function: str, known: Mapping[str, Array], names: Sequence[str]) -> list[NamedNumber]:
    """Select the numbers `names` from the dict `known` of all numbers of a loop.

    Raises:
        InputError: a name is not in `known`, or occurs twice.
    """
    chosen = []
    for i, name in enumerate(names):
        if name not in known:
            problem = f"expected names of {sorted(known)}, got {shown(name)} (first bad index {i})"
            raise InputError(f"{function}: sensitivity has an unknown name: {problem}")
        if name in names[:i]:
            raise InputError(f"{function}: sensitivity names {name} twice: expected each name once (first bad index {i})")
        chosen.append(NamedNumber(name, known[name]))
    return chosen


def entry_variants(loop: Loop, name: str, value: Array, index: tuple[int, ...]) -> Variants:
    """Return four copies of `loop` in which the entry of the number `name` at `index` is changed, and their weights in the derivative."""
    return _variants(loop, NamedNumber(name, value), index)


def together(loop: Loop, named: NamedNumber, indices: Sequence[tuple[int, ...]]) -> Together | None:
    """Make loops that each change several entries of a number at once. The entries are at `indices`.

    Return None for fewer than FEW entries, for square matrices, motions, targets, tasks and the start, and if an entry cannot be varied.
    """
    name, value = named.name, named.value
    moving = name in START or any(part in name for part in ("motion.", "target", "tasks."))
    if moving or len(indices) < FEW or (value.ndim > 1 and value.shape[0] == value.shape[-1]):
        return None
    bits = next(bits for bits in itertools.count(2) if math.comb(bits, bits // 2) >= len(indices))
    chosen = itertools.islice(itertools.combinations(range(bits), bits // 2), len(indices))
    codes = [sum(1 << bit for bit in code) for code in chosen]
    steps = [STEP * 2.0 ** math.floor(math.log2(_scale(name, value, index))) for index in indices]

    def moved(by: Iterable[float]) -> Loop:
        other = value.copy()
        for index, each in zip(indices, by, strict=True):
            other[index] += each
        return loop_with(*loop, name, other)

    # Each entry varies by a different multiple of its step, so that the changes of two entries do not cancel in an input.
    parts = [(1.0 + math.modf((i + 1) * GOLDEN)[0]) * step for i, step in enumerate(steps)]
    offsets, weights = RULES[0]
    try:
        probes = [moved(part if code >> bit & 1 else 0.0 for part, code in zip(parts, codes, strict=True)) for bit in range(bits)]
        four = [moved(offset * step for step in steps) for offset in offsets]
    except InputError:
        return None
    return Together([*probes, *four], [[weight / step for weight in weights] for step in steps], codes)


def stacked(
    loop: Loop,
    names: Sequence[NamedNumber],
    shared: Sequence[Together | None],
    alone: Callable[[int], Sequence[Variants]],
) -> Varied:
    """Join the loop and the varied loops of each name `k`.

    The varied loops `shared[k]` each change several entries at once. If `shared[k]` is None, the varied loops are `alone(k)`, four for each
    entry.
    """

    def apart() -> Varied:
        return _stacked(loop, names, [variant for k in range(len(names)) for variant in alone(k)])

    if not any(shared):
        return apart()
    variants: list[Variants | Together] = []
    for k, group in enumerate(shared):
        variants.extend(alone(k) if group is None else [group])
    codes = tuple(None if group is None else group.codes for group in shared)
    return replace(_stacked(loop, names, variants), codes=codes, apart=apart)


def _stacked(loop: Loop, names: Sequence[NamedNumber], variants: Sequence[Variants | Together]) -> Varied:
    plant, law, start = loop
    plants, laws, starts, weights = [plant], [law], [dict(start)], []
    for variant in variants:
        loops, own = (variant.loops, variant.weights) if isinstance(variant, Together) else (variant[0], [variant[1]])
        weights.extend(own)
        for other, control, begun in loops:
            plants.append(other)
            laws.append(control)
            starts.append(dict(begun))
    rows: dict[str, Array | None] = {}
    for part in START:
        values = [each.get(part) for each in starts]
        given = next((each for each in values if each is not None), None)
        rows[part] = None if given is None else np.array([np.zeros_like(given) if each is None else each for each in values])
    one_plant, one_law = all(each is plant for each in plants), all(each is law for each in laws)
    weighed = np.array(weights, dtype=np.float64).reshape(-1, 4)
    return Varied(plant if one_plant else plants, law if one_law else laws, rows, weighed, tuple(names))
