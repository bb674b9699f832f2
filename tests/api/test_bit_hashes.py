"""The bits of every kind of result, compared with the hashes in the repository, on every instruction set of this processor.

One process per instruction set, selected by ARMLET_ISA, computes the results. Every division of the work must give equal bits. The
tests use 1, 2, 3, 5 and 8 threads, 1, 5 and 16 rows at a time, and other orders of rows.
"""

from __future__ import annotations

import copy
import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from scripts import imported

TOOL = Path(__file__).resolve().parents[2] / "tools" / "bit_hashes.py"


bits = imported(TOOL)
KEPT = json.loads(bits.FILE.read_text())


@pytest.fixture(scope="module")
def hashes() -> dict[str, Any]:
    """All hashes by instruction set. The processes run in parallel."""
    names = bits.available()
    with ThreadPoolExecutor(len(names)) as pool:
        return dict(zip(names, pool.map(lambda name: bits.of(name, True), names), strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("name", bits.available())
def test_the_bits_are_those_of_the_file_however_the_work_is_divided(name: str, hashes: dict[str, Any]) -> None:
    found = hashes[name]
    batches = found["batches"]
    assert list(batches) == list(bits.WAYS) and len(batches["as it is"]) == len(bits.BATCHES)
    differing = {way: [case for case in each if each[case] != batches["as it is"][case]] for way, each in batches.items()}
    assert {way: cases for way, cases in differing.items() if cases} == {}
    wrong = bits.differences(KEPT, found)
    assert not wrong, "\n".join([*wrong, bits.ADVICE])


@pytest.mark.slow
@pytest.mark.parametrize("name", bits.available())
def test_the_interpreter_has_the_bits_of_machine_code(name: str, hashes: dict[str, Any]) -> None:
    found = bits.of(name, False, ARMLET_PROGRAMS="interpreter")
    assert found["programs"] == "interpreter"
    assert bits.flat(found) == bits.flat(hashes[name])


def test_the_file_is_for_all_instruction_sets() -> None:
    assert list(KEPT["sets"]) == list(bits.SETS)
    cases = [sorted(hashes) for hashes in KEPT["sets"].values()]
    assert cases[0] == cases[1] == cases[2] and len(cases[0]) > 20


def test_differences_are_named() -> None:
    """The names of a changed hash, a new case and a missing case are reported.

    If the hashes in the file are from another C library, nothing is reported.
    """
    hashes = {"a": "1", "b": "2", "c": "3"}
    found = {"set": "avx2", "libm": "x", "functions": {"a": "1", "b": "9"}, "batches": {"as it is": {"d": "4"}}}
    kept = {"libm": "x", "sets": {"avx2": hashes}}
    wanted = ["avx2: b: the bits changed", "avx2: c: is in the file alone", "avx2: d: is not in the file"]
    assert bits.differences(kept, found) == wanted
    other = copy.deepcopy(kept) | {"libm": "y"}
    assert bits.differences(other, found) == []


def test_a_hash_sees_one_bit() -> None:
    import numpy as np

    values = np.array([[1.0, np.nan, -0.0]])
    changed = [values + 0.0, values * (1.0 + 2.3e-16), values.T, values.ravel()]
    assert len({bits.digest([each]) for each in [values, *changed]}) == 5
    assert bits.digest([values]) == bits.digest([values.copy()])
