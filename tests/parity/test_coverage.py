"""Every public name has a parity test or a written reason: `covered.toml` against the package and against the tests that it names."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest
from walk import HERE, compares_with_reference, public, spoken, words

TABLE = tomllib.loads((HERE / "covered.toml").read_text())


def faults(table: dict[str, Any], names: list[str], folder: Path = HERE) -> list[str]:
    """Return the errors of a table like `covered.toml`, one line each."""
    silent, covered, reasons, missing = table["silent"], table["covered"], table["reasons"], table["missing"]
    listed = [name for group in (*covered.values(), *reasons.values(), missing["names"]) for name in group]
    excused = {name for group in reasons.values() for name in group}
    found = [f"{name}: in the table {listed.count(name)} times" for name in sorted(set(listed)) if listed.count(name) > 1]
    found += [f"{name}: in the table, not in the package" for name in listed if name not in names]
    for name in names:
        call, _, argument = name.rstrip(")").partition("(")
        if name not in listed and argument not in silent and not (argument and call in excused):
            found.append(f"{name}: neither a parity test nor a reason")
    for test, group in covered.items():
        file, _, function = test.partition("::")
        path = folder / file
        said = spoken(path, function) if path.exists() else None
        if said is None:
            found.append(f"{test}: no such test")
        elif not compares_with_reference(path):
            found.append(f"{test}: compares with no reference")
        else:
            found += [f"{name}: {test} does not speak of it" for name in group if not words(name) <= said]
    found += [f"{reason!r} is no reason" for reason in (*reasons, *silent.values()) if len(reason.split()) < 2]
    if len(missing["names"]) != missing["at_most"]:
        found.append(f"missing: at_most is {missing['at_most']}, and {len(missing['names'])} names are missing")
    return found


def test_every_public_name_is_covered_or_has_a_reason(capsys: pytest.CaptureFixture[str]) -> None:
    names = public()
    assert faults(TABLE, names) == []
    covered, reasons = (sum(map(len, TABLE[part].values())) for part in ("covered", "reasons"))
    missing = TABLE["missing"]["at_most"]
    implied = len(names) - covered - reasons - missing
    with capsys.disabled():
        print(
            f"\n{len(names)} public names and arguments: {covered} in parity tests, {reasons} with a reason, "
            f"{implied} arguments under such a reason, {missing} missing"
        )


def changed(part: str, change: Any) -> dict[str, Any]:
    """Return the table with `part` replaced by `change(part)`."""
    return TABLE | {part: change(TABLE[part])}


def without(name: str, groups: dict[str, list[str]]) -> dict[str, list[str]]:
    return {key: [each for each in group if each != name] for key, group in groups.items()}


@pytest.mark.parametrize(
    ("table", "fault"),
    [
        (changed("covered", lambda c: without("Arm.mass_matrix", c)), "Arm.mass_matrix: neither a parity test nor a reason"),
        (changed("covered", lambda c: without("PDGravity.terms", c)), "PDGravity.terms: neither a parity test nor a reason"),
        (changed("covered", lambda c: without("Simulator.step(force)", c)), "Simulator.step(force): neither a parity test nor a reason"),
        (changed("covered", lambda c: without("simulate(tau_max)", c)), "simulate(tau_max): neither a parity test nor a reason"),
        (changed("reasons", lambda r: without("tune", r)), "tune: neither a parity test nor a reason"),
        (changed("silent", lambda s: {}), "Arm.pose(out): neither a parity test nor a reason"),
        (changed("covered", lambda c: c | {"test_arm_parity.py::test_gone": []}), "test_arm_parity.py::test_gone: no such test"),
        (changed("covered", lambda c: c | {"gone.py::test_trees": []}), "gone.py::test_trees: no such test"),
        (
            changed("covered", lambda c: c | {"test_coverage.py::test_no_names_are_lost": []}),
            "test_coverage.py::test_no_names_are_lost: compares with no reference",
        ),
        (changed("reasons", lambda r: r | {"It is gone.": ["gone"]}), "gone: in the table, not in the package"),
        (changed("reasons", lambda r: r | {"Why": []}), "'Why' is no reason"),
        (changed("reasons", lambda r: r | {"Twice over.": ["Arm.pose"]}), "Arm.pose: in the table 2 times"),
        (
            changed("covered", lambda c: without("Arm.pose", c) | {"test_mintime_parity.py::test_bang_bang_time": ["Arm.pose"]}),
            "Arm.pose: test_mintime_parity.py::test_bang_bang_time does not speak of it",
        ),
        (changed("missing", lambda m: m | {"at_most": m["at_most"] + 1}), "missing: at_most is"),
    ],
)
def test_a_fault_of_the_table_is_detected(table: dict[str, Any], fault: str) -> None:
    assert any(found.startswith(fault) for found in faults(table, public()))


def test_no_names_are_lost() -> None:
    names = public()
    some = {"Arm.mass_matrix", "Arm.bias(friction)", "simulate(tau_max)", "Adaptive(natural)", "Event.joint", "PrioritySolver.for_arm(eps)"}
    assert some <= {*names}
    assert {"Quintic.__call__", "Adaptive.terms", "Law.terms(theta)", "Run.sample"} <= {*names} and "Metrics.update" not in names
    assert len(names) > 500
    assert words("Arm.bias(friction)") == {"bias", "friction"} and words("simulate") == {"simulate"}
    assert words("Quintic.__call__") == {"Quintic"} and words("Adaptive.terms") == {"Adaptive", "terms"}
    said = spoken(HERE / "test_loops_parity.py", "test_forces_in_steps")
    # `spoken` follows the definitions that a test uses: here a dictionary of options, and a function with the class that it names.
    assert said is not None and {"force", "sample_time", "law_pair", "CartesianImpedance"} <= said and "threads" not in said
