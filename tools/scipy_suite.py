"""scipy's own tests of `solve_ivp`, run on armlet's methods: `make test-scipy`.

    python tools/scipy_suite.py

The tests are in the installed scipy, `scipy/integrate/_ivp/tests/test_ivp.py`. While they run, `dopri5`, `dop853`, `radau5` and `rodas4`
replace RK45, DOP853, Radau and BDF, both by name and as classes. All tests must pass except those of EXCEPTIONS. The tests of EXCEPTIONS
must fail, so the list is never longer than necessary. An exception may concern one solver only. Then the test must pass if scipy's own
solver is used in that place.
"""

from __future__ import annotations

import importlib
import sys
import tempfile
from pathlib import Path
from typing import Any

import pytest
import scipy

import armlet as al

IN_PLACE = {"RK45": "dopri5", "DOP853": "dop853", "Radau": "radau5", "BDF": "rodas4"}

# For each test: the reason of the exception, and the solver that armlet cannot replace in it (None: all solvers).
EXCEPTIONS: dict[str, tuple[str, str | None]] = {
    "test_integration_complex": ("complex states are refused: armlet integrates real ones", None),
    "test_integration": ("fewer than 3 Jacobians are expected: rodas4, a Rosenbrock method, takes one for each step", "BDF"),
    "test_integration_stiff[BDF]": ("fewer than 200 Jacobians are expected: rodas4 takes one for each step", "BDF"),
}


class Swap:
    """A pytest plugin. While a test runs it replaces scipy's solvers, except those in `originals`. It records the results."""

    def __init__(self, originals: dict[str, str] | None = None) -> None:
        self.originals = originals or {}
        self.passed: set[str] = set()
        self.failed: set[str] = set()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Any:
        table = importlib.import_module("scipy.integrate._ivp.ivp").METHODS
        module = item.getparent(pytest.Module).obj  # type: ignore[union-attr]
        theirs = {name: table[name] for name in IN_PLACE if name != self.originals.get(item.name)}
        for name in theirs:
            table[name] = al.scipy_method(IN_PLACE[name])
            setattr(module, name, table[name])
        try:
            return (yield)
        finally:
            table.update(theirs)
            for name, solver in theirs.items():
                setattr(module, name, solver)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        name = report.nodeid.partition("::")[2]
        if not report.passed:
            self.failed.add(name)
        elif report.when == "call":
            self.passed.add(name)


def run(originals: dict[str, str] | None = None, only: list[str] | None = None) -> Swap:
    """Run scipy's test file, or only the tests `only` of it."""
    root = Path(scipy.__file__).parent
    file = root / "integrate" / "_ivp" / "tests" / "test_ivp.py"
    if not file.exists():
        sys.exit(f"scipy_suite: scipy {scipy.__version__} is installed without its tests: {file}")
    swap = Swap(originals)
    quiet = ["-q", "--no-header", "--no-summary", "--tb=no", "-p", "no:cacheprovider", "--import-mode=importlib"]
    names = [f"{file}::{name}" for name in only] if only is not None else [str(file)]
    with tempfile.TemporaryDirectory() as folder:
        # An empty pytest.ini prevents other settings; only scipy's conftest.py is used.
        settings = Path(folder) / "pytest.ini"
        settings.write_text("[pytest]\n")
        pytest.main([*quiet, "-c", str(settings), "--rootdir", str(root), "--confcutdir", str(root), *names], plugins=[swap])
    return swap


def main() -> int:
    first = run()
    originals = {test: solver for test, (_, solver) in EXCEPTIONS.items() if solver is not None}
    second = run(originals, sorted(originals))
    total, ours = len(first.passed | first.failed), ", ".join(IN_PLACE.values())
    count, theirs = len(first.passed - first.failed), ", ".join(IN_PLACE)
    print(f"\nscipy {scipy.__version__}: {count} of {total} tests pass with {ours} in place of {theirs}")
    for test, (reason, solver) in EXCEPTIONS.items():
        back = "" if solver is None else f" (passes with scipy's {solver} back in its place)"
        print(f"  exception: {test}: {reason}{back}")
    wrong = [f"{test} fails" for test in sorted(first.failed - EXCEPTIONS.keys())]
    wrong += [f"{test} passes: it is no exception" for test in sorted(EXCEPTIONS.keys() - first.failed)]
    wrong += [f"{test} fails without {IN_PLACE[originals[test]]} too" for test in sorted(set(originals) - (second.passed - second.failed))]
    for line in wrong:
        print(f"scipy_suite: {line}")
    return 1 if wrong or not first.passed else 0


if __name__ == "__main__":
    sys.exit(main())
