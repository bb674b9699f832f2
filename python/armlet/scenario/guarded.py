"""Tables for a guarded law: its inner law, and its observer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from .. import _core
from .fields import Field, Flag, Kind, Numbers, OneOf, Table, Text

__all__ = ["with_guarded"]

_GAIN = Numbers(depth=2, low=0.0, strict=True)
_POSITIVE = Numbers(low=0.0, strict=True)
_OBSERVER = Table({"gain": _GAIN, "friction": Flag(), "threshold": Numbers(depth=1, low=0.0, strict=True)}, ("gain",))


def with_guarded(kinds: Mapping[str, Kind]) -> OneOf:
    """The kinds of laws `kinds`, and `Guarded` with any of them as its inner law."""
    keys: dict[str, Field] = {
        "law": OneOf(kinds),
        "observer": _OBSERVER,
        "reaction": Text(("stop", "float", "retract")),
        **dict.fromkeys(("stiffness", "damping"), _GAIN),
        **dict.fromkeys(("speed", "duration"), _POSITIVE),
    }
    return OneOf(dict(kinds) | {"Guarded": Kind(keys, ("law", "observer"), _maker(OneOf(kinds)), ("arm",))})


def _maker(laws: OneOf) -> Callable[..., _core.Law]:
    def guarded(arm: _core.Arm, law: Mapping[str, Any], observer: Mapping[str, Any], motion: Any = None, **options: Any) -> _core.Law:
        inner = laws.make(law, arm=arm) if motion is None else laws.make(law, arm=arm, motion=motion)
        return _core.Guarded(inner, _core.MomentumObserver(arm, **observer), **options)

    return guarded
