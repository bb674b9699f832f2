"""Counts of the generic code of laws and plants, which are built for one run and for one number type."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CORE = ROOT / "rust" / "core" / "src"
#: Numbers with one lane per run: the number types, the planners, the motions, and the batches of programs.
LANES = ("scalar/", "plan/", "motion/", "trace/sym.rs")
BATCHES = {
    f"simulate/{name}.rs" for name in ("assembly", "fixed/steps", "runs/structures", "sampled/sampler", "sampled/torque_sensing", "world")
}
IMPL = re.compile(r"^impl(?:<(?P<parameters>[^{]*?)>)? (?:Equations|PlantEquations)(?:<[\w:]+>)? for (?P<type>\w+)", re.MULTILINE)


def lanes_in(sources: dict[str, str]) -> dict[str, int]:
    """The number of mentions of `from_lanes` per file, outside the files that compute in lanes."""
    counts = {name: text.count("from_lanes") for name, text in sources.items()}
    return {name: count for name, count in counts.items() if count and not name.startswith(LANES) and name not in BATCHES}


def type_parameters(source: str) -> dict[str, set[str]]:
    """For each law and plant of a file, the type parameters of its implementation."""
    found = {}
    for impl in IMPL.finditer(source):
        names = [each.split(":")[0].strip() for each in (impl["parameters"] or "").split(",")]
        found[impl["type"]] = {name for name in names if name and not name.startswith(("'", "const "))}
    return found


def mentions(name: str, sources: dict[str, str]) -> dict[str, int]:
    """The number of mentions of a type per file. Parts of longer names do not count, nor does the variant `Reaction::Float`."""
    counts = {path: len(re.findall(rf"(?<!::)\b{name}\b(?!\(Option)", text)) for path, text in sources.items()}
    return {path: count for path, count in counts.items() if count}


def sources() -> dict[str, str]:
    return {path.relative_to(CORE).as_posix(): path.read_text() for path in sorted(CORE.rglob("*.rs"))}


def test_only_planners_motions_and_batches_have_lanes() -> None:
    counted = lanes_in(sources())
    print(f"from_lanes outside of planners, motions and batches: {sum(counted.values())}")
    assert counted == {}
    assert lanes_in({"law/pid.rs": "S::from_lanes(|lane| of(lane).kp)", "plan/sine.rs": "S::from_lanes"}) == {"law/pid.rs": 1}


def test_laws_and_plants_have_no_type_parameter() -> None:
    found: dict[str, set[str]] = {}
    for name, text in sources().items():
        if name.startswith(("law/", "plant/")):
            found |= type_parameters(text)
    print(f"laws and plants in a control loop: {len(found)}")
    assert len(found) > 12
    assert {name: more for name, more in found.items() if more} == {}
    law = "impl<'a, S: Real, D, const TORQUE: bool> Equations<S> for Tracking<'a, S, D, TORQUE>\nwhere\n"
    assert type_parameters(law) == {"Tracking": {"S", "D"}}


@pytest.mark.parametrize("pattern", [r"\bmul_add\b", r"\bneg_mul_add\b", r"\btrig: &"])
def test_formulas_have_plain_operators_and_no_tables_of_sines(pattern: str) -> None:
    """Recordings contract products and sums, and the arm of a formula knows its sines and cosines."""
    formulas = {name: text for name, text in sources().items() if name.startswith(("law/", "plant/", "simulate/"))}
    found = {name: len(re.findall(pattern, text)) for name, text in formulas.items()}
    assert {name: count for name, count in found.items() if count} == {}
    assert re.search(pattern, "fn f(trig: &[Sym]) { a.mul_add(b, c) + a.neg_mul_add(b, c) }")


@pytest.mark.parametrize("name", ["Dual", "Float"])
def test_there_is_no_second_number_type_of_one_run(name: str) -> None:
    found = mentions(name, sources())
    print(f"mentions of {name}: {sum(found.values())}")
    assert found == {}
    planted = {"law/pid.rs": f"use crate::scalar::{{{name}, Real}};\nlet x: {name} = {name}(1.0); // {name}s"}
    assert mentions(name, planted) == {"law/pid.rs": 3}
