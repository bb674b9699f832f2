"""Checks that a `Table` field cannot express: motions that laws need, values that laws take from the plant, the source of a robot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from .fields import OneOf
from .tables import KNOWN, LAWS, SCENARIO

__all__ = ["RIGID", "across", "knowing", "needs_of"]

RIGID = {"kind": "RigidArm"}


def needs_of(law: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of the tables that a law requires, including tables that its inner law requires."""
    own = LAWS.kinds[law["kind"]].needs
    return (*own, *needs_of(law["law"])) if "law" in law else own


def knowing(law: Mapping[str, Any], plant: Mapping[str, Any]) -> dict[str, Any]:
    """The values of a law. The entries of `KNOWN` that the law lacks are copied from the plant, also for an inner law."""
    keys = LAWS.kinds[law["kind"]].keys
    values = {key: value for key, value in law.items() if key != "kind"}
    values |= {ours: plant[theirs] for ours, theirs in KNOWN.items() if ours in keys and ours not in values}
    if "law" in law:
        values["law"] = {"kind": law["law"]["kind"]} | knowing(law["law"], plant)
    return values


def across(data: Mapping[str, Any]) -> Iterator[str]:
    """The contradictions between the tables of a scenario. Each single table has already been checked."""
    law, plant, needs = data["law"], data.get("plant", RIGID), needs_of(data["law"])
    if "motion" in needs and "motion" not in data:
        yield f"$.motion: is missing: the law {_named(law)} follows one: expected a table with kind = one of {_kinds('motion')}"
    for place, each in [("law", law)] + ([("law.law", law["law"])] if "law" in law else []):
        for ours, theirs in KNOWN.items():
            if ours in LAWS.kinds[each["kind"]].keys and ours not in each and theirs not in plant:
                yield f"$.{place}.{ours}: is missing: expected a number or a list of numbers, or a plant ElasticArm to take it from"
    for table in ("arm", "model"):
        if data.get(table, {}).get("kind") == "urdf" and ("path" in data[table]) == ("xml" in data[table]):
            yield f"$.{table}.path: expected either path or xml, got {'both' if 'path' in data[table] else 'neither'}"
    if "motion" in data and "motion" not in needs:
        followers = ", ".join(name for name, each in LAWS.kinds.items() if "motion" in each.needs)
        yield f"$.motion: is not used by the law {_named(law)}: expected a law that follows a motion ({followers}), or no motion"


def _named(law: Mapping[str, Any]) -> str:
    return str(law["law"]["kind"] if "law" in law else law["kind"])


def _kinds(table: str) -> str:
    what = SCENARIO.keys[table]
    assert isinstance(what, OneOf)
    return ", ".join(what.kinds)
