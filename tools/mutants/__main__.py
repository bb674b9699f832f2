"""`make test-mutants`: count the bugs that the fast tests notice. Each bug of mutants.toml is in a copy of the sources, behind a switch.

The copy is built once, with low optimisation and with assertions. The environment variable ARMLET_MUTANT selects the bug; 0 selects none.
For each bug, the tests that mutants.toml names run first, then the others, until one fails. A bug that no test notices *survives*. The
exit code is 1 if more than 5 % of the bugs survive, or if one survives that is not explained in `KNOWN`. Each text of mutants.toml must
occur exactly once in its file, otherwise the program stops.

    python tools/mutants                       all bugs
    python tools/mutants --only 3 17           bugs 3 and 17
    python tools/mutants --keep                use the existing build
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build" / "mutants"
COPY = BUILD / "sources"
#: Sources, and files that the tests read, which are copied.
PARTS = ("rust", "python", "tests", "docs", "examples", "tools", "Cargo.toml", "Cargo.lock", ".cargo", "pyproject.toml", "README.md")
OTHERS = ("Makefile", "CHANGELOG.md", "CONTRIBUTING.md", "RELEASING.md", "LICENSE", "CITATION.cff", "clippy.toml", "rustfmt.toml")
#: Tests, in this order. The last one compares the bits of many results.
PYTEST = (
    "parity", "oracles", "identities/test_adaptive_identities.py", "identities/test_arm_derivatives.py",
    "identities/test_elastic_identities.py", "identities/test_equilibrium_identities.py", "identities/test_event_identities.py",
    "identities/test_identification.py", "identities/test_integrate_identities.py", "identities/test_loop_identities.py",
    "identities/test_mintime_identities.py", "identities/test_priority_limits.py", "identities/test_task_identities.py",
    "identities/test_time_path_identities.py", "identities/test_torque_sensor_identities.py", "api/test_arm_batches.py",
    "api/test_batches.py", "api/test_programs.py", "api/test_priority_programs.py", "api/test_run.py", "api/test_bit_hashes.py",
)  # fmt: skip
ALL_UNITS = ("lib", "suite", *PYTEST)
#: Descriptions of bugs that no fast test can notice, with the reason.
KNOWN: dict[str, str] = {
    "a known program taken for other limits of effort": "no fault: limits are inputs of a program, and a run without them has fewer inputs",
    "a known program taken for another wall": "no fault: its numbers are inputs of a program, its frame is compared with the shape",
}
LEAST = 0.95
SWITCH = """
/// Whether bug `n` of tools/mutants is switched on.
#[allow(missing_docs)]
pub fn mutant(n: u32) -> bool {
    use std::sync::atomic::{AtomicU32, Ordering};
    static CHOSEN: AtomicU32 = AtomicU32::new(u32::MAX);
    let mut chosen = CHOSEN.load(Ordering::Relaxed);
    if chosen == u32::MAX {
        chosen = std::env::var("ARMLET_MUTANT").ok().and_then(|text| text.parse().ok()).unwrap_or(0);
        CHOSEN.store(chosen, Ordering::Relaxed);
    }
    chosen == n
}
"""


def mutants() -> list[dict[str, Any]]:
    return tomllib.loads((Path(__file__).parent / "mutants.toml").read_text())["mutant"]


def insert(source: str, text: str, bug: str, number: int, crate: str, statement: bool) -> str:
    """Return the source with the bug behind its switch.

    Raises:
        ValueError: the text does not occur exactly once.
    """
    found = source.count(text)
    if found != 1:
        raise ValueError(f"expected the text once, got {found} times: {text}")
    switched = f"if {crate}::mutant({number}) {{ {bug} }} else {{ {text} }}"
    return source.replace(text, switched if statement else f"({switched})")


def copy(bugs: list[dict[str, Any]]) -> None:
    """Copy the sources with all bugs to build/mutants/sources. Unchanged files keep their modification times."""
    faults = []
    sources: dict[str, str] = {}
    for number, bug in enumerate(bugs, 1):
        file = bug["file"]
        before = sources.get(file) or (ROOT / "rust" / file).read_text()
        crate = "crate" if file.startswith("core") else "armlet_core"
        try:
            sources[file] = insert(before, bug["text"], bug["bug"], number, crate, bug.get("statement", False))
        except ValueError as error:
            faults.append(f"mutant {number}, rust/{file}: {error}")
    if faults:
        sys.exit("\n".join(faults))
    sources["core/src/lib.rs"] = (sources.get("core/src/lib.rs") or (ROOT / "rust/core/src/lib.rs").read_text()) + SWITCH
    shutil.rmtree(COPY, ignore_errors=True)
    skip = shutil.ignore_patterns("*.so", "__pycache__", "target", "_build", "auto_examples")
    for name in (*PARTS, *OTHERS):
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, COPY / name, ignore=skip)
        elif (ROOT / name).exists():
            COPY.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, COPY / name)
    for file, source in sources.items():
        (COPY / "rust" / file).write_text(source)


def cargo(*arguments: str) -> list[dict[str, Any]]:
    # This profile optimises to save time, and keeps assertions and overflow checks.
    environment = os.environ | {"CARGO_TARGET_DIR": str(BUILD / "target"), "RUSTFLAGS": "-Awarnings", "CARGO_PROFILE_DEV_OPT_LEVEL": "1"}
    command = ["cargo", *arguments, "--locked", "--message-format=json-render-diagnostics"]
    done = subprocess.run(command, cwd=COPY, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    return [json.loads(line) for line in done.stdout.splitlines()]


def build() -> dict[str, str]:
    """Build the test binaries and return their paths by name. The extension is copied to the folder where Python imports it."""
    made = cargo("test", "--no-run", "--package", "armlet-core", "--lib", "--test", "suite")
    names = {"armlet_core": "lib", "suite": "suite"}
    binaries = {names[m["target"]["name"]]: m["executable"] for m in made if m.get("executable") and m["target"]["name"] in names}
    made = cargo("build", "--package", "armlet-py", "--features", "pyo3/extension-module")
    libraries = [file for m in made if m["reason"] == "compiler-artifact" for file in m["filenames"] if Path(file).stem == "lib_core"]
    shutil.copy2(libraries[-1], COPY / "python/armlet/_core.abi3.so")
    (BUILD / "binaries.json").write_text(json.dumps(binaries))
    return binaries


def passes(binaries: dict[str, str], unit: str, number: int, timeout: float) -> tuple[bool, str]:
    """Whether a unit of tests passes with a bug switched on, and the name of the first failed test.

    A unit is a test binary or a file of Python tests.
    """
    environment = os.environ | {"ARMLET_MUTANT": str(number), "RUST_MIN_STACK": "268435456", "PYTHONPATH": str(COPY / "python")}
    kind, _, names = unit.partition(" ")
    if kind in binaries:
        # Reading the environment variable allocates memory, so every test that counts allocations would fail. These tests are skipped.
        command, where = [binaries[kind], *names.split(), "--test-threads", "2", "--skip", "alloc"], COPY / "rust/core"
    else:
        options = ["-c", str(COPY / "pyproject.toml"), "--rootdir", str(COPY), "-x", "-q", "-p", "no:cacheprovider", "--tb=no"]
        command, where = [sys.executable, "-m", "pytest", *options, str(COPY / "tests" / unit)], COPY
    process = subprocess.Popen(
        command, cwd=where, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, start_new_session=True
    )
    late = threading.Event()

    def end(hangs: bool) -> None:
        if hangs:
            late.set()
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)

    timer = threading.Timer(timeout, end, [True])
    timer.start()
    try:
        assert process.stdout is not None
        for line in process.stdout:
            if line.startswith(("FAILED ", "ERROR ")) or line.rstrip().endswith("... FAILED"):
                end(False)
                return False, line.split()[1].removeprefix("tests/")
        if process.wait() == 0:
            return True, ""
        return False, "(a hang)" if late.is_set() else "(the process ended)"
    finally:
        timer.cancel()
        process.stdout.close()
        process.wait()


def main() -> int:
    parser = argparse.ArgumentParser(prog="mutants", description="bugs on purpose, and whether the tests notice")
    parser.add_argument("--only", type=int, nargs="+", help="numbers of mutants, from 1")
    parser.add_argument("--keep", action="store_true", help="the copy as it was built before")
    given = parser.parse_args()
    bugs = mutants()
    if given.keep:
        binaries = json.loads((BUILD / "binaries.json").read_text())
    else:
        copy(bugs)
        begun = time.monotonic()
        binaries = build()
        print(f"built {len(bugs)} bugs in {time.monotonic() - begun:.0f} s", flush=True)
    seconds: dict[str, float] = {}

    def without(unit: str) -> float:
        """The seconds that a unit of tests takes without a bug. The unit must pass."""
        if unit not in seconds:
            begun = time.monotonic()
            whole, name = passes(binaries, unit, 0, 1800.0)
            seconds[unit] = time.monotonic() - begun
            print(f"without a bug: {unit}: {seconds[unit]:.0f} s", flush=True)
            if not whole:
                sys.exit(f"{unit} fails without a bug: {name}")
        return seconds[unit]

    killed, alive = [], []
    for number, bug in enumerate(bugs, 1):
        if given.only and number not in given.only:
            continue
        begun = time.monotonic()
        for unit in dict.fromkeys((*bug["tests"], *ALL_UNITS)):
            whole, name = passes(binaries, unit, number, 60.0 + 10.0 * without(unit))
            if not whole:
                break
        (alive if whole else killed).append(bug)
        verdict = "SURVIVES" if whole else f"noticed by {unit}: {name}"
        print(f"{number:3} {bug['file']}: {bug['what']}: {verdict} ({time.monotonic() - begun:.0f} s)", flush=True)
    total = len(killed) + len(alive)
    print(f"\n{len(killed)} of {total} bugs noticed")
    for bug in alive:
        print(f"survives: {bug['file']}: {bug['what']}: {KNOWN.get(bug['what'], 'no reason known')}")
    return int(len(killed) < LEAST * total or any(bug["what"] not in KNOWN for bug in alive))


if __name__ == "__main__":
    sys.exit(main())
