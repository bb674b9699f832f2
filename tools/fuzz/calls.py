"""One call of the public API as a self-contained snippet. A seed and a call number always give the same snippet."""

from __future__ import annotations

import random
from dataclasses import dataclass

from signatures import Parameter, Target
from values import Values

IMPORTS = "import numpy as np, armlet as al, odd\nfrom decimal import Decimal\nfrom fractions import Fraction\nfrom pathlib import Path\n"
FIGURE = "from matplotlib.figure import Figure\n"
# Arguments that a call may change, or that contain objects which may change.
CHANGED = {"out", "fig", "executor", "progress"}
# Functions that search for several ms per entry of their result. A result of 10^8 entries would take days.
SEARCHES = {"smallest_reduced_inertia"}
MANY = "10**8"


@dataclass(frozen=True)
class Call:
    """Source texts of a call: of the object that owns the method ("" for none), of the arguments by variable, and of the call itself."""

    target: str
    owner: str
    arguments: tuple[tuple[str, str, bool], ...]  # variable, source, whether the call must not change it
    body: str

    def __str__(self) -> str:
        lines = [f"owner = {self.owner}"] if self.owner else []
        lines += [f"{variable} = {source}" for variable, source, _ in self.arguments]
        text = "\n".join([*lines, self.body])
        return IMPORTS + (FIGURE if "Figure()" in text else "") + text


def call(targets: list[Target], seed: int, number: int) -> Call:
    """Call number `number`.

    Of 100 calls, 40 have plausible arguments, 45 one odd argument, the others up to 3. In a few calls an argument is missing or added.
    """
    chance = random.Random(f"{seed} {number}")
    target = chance.choice(targets)
    values = Values(chance)
    owner = values.instance(target.owner) if target.owner else ""
    if target.attribute:
        return Call(target.path, owner, (), f"result = owner.{target.name}")
    given = [p for p in target.parameters if p.kind != "keywords" and (p.required or chance.random() < 0.35)]
    chosen = _odd_ones(chance, given)
    if chance.random() < 0.03 and given:
        given.pop(chance.randrange(len(given)))
    arguments, parts = [], []
    by_name = False
    for k, parameter in enumerate(given):
        source = values.odd() if parameter.name in chosen else values.argument(target.path, parameter)
        while MANY in source and target.name in SEARCHES:
            source = values.odd()
        if not source:
            continue
        # An argument is positional if it may be and no earlier argument is omitted.
        by_name = by_name or parameter.kind == "keyword" or target.parameters[k].name != parameter.name
        parts.append(f"{parameter.name}=a{k}" if by_name else f"a{k}")
        arguments.append((f"a{k}", source, parameter.name not in CHANGED))
    if any(p.kind == "keywords" for p in target.parameters):
        parts += _keywords(values, target)
    if chance.random() < 0.01:
        parts.append("unknown=1.0")
    name = {"": f"al.{target.name}"}.get(target.owner, f"owner.{target.name}")
    return Call(target.path, owner, tuple(arguments), f"result = {name}({', '.join(parts)})")


def _odd_ones(chance: random.Random, given: list[Parameter]) -> set[str]:
    draw = chance.random()
    count = 0 if draw < 0.4 else 1 if draw < 0.85 else chance.randint(1, 3)
    return {p.name for p in chance.sample(given, min(count, len(given)))}


def _keywords(values: Values, target: Target) -> list[str]:
    """Keyword arguments of a call that accepts `**keywords` and passes them on."""
    if target.name == "Simulator":
        return [f"dt={values.positive(1e-3, 1e-2)}"]
    known = {"metrics": ("band", "settle", "tolerance"), "sweep": ("band", "settle"), "Event": ("direction", "stop", "name")}
    names = known.get(target.name, known.get(target.owner, ()))
    chosen = [name for name in names if values.chance.random() < 0.3]
    return [f"{name}={values.odd() if values.chance.random() < 0.5 else values.positive()}" for name in chosen]
