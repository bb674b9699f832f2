"""`make quick` chooses tests that belong to the changed files, and leaves out tests with markers."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from scripts import imported

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def quick() -> Any:
    return imported(ROOT / "tools" / "quick.py")


@pytest.mark.parametrize(
    ("file", "expected"),
    [
        ("python/armlet/srdf.py", ["api/test_robot_files.py"]),
        ("python/armlet/run/metrics.py", ["api/test_loop_metrics.py"]),
        ("python/armlet/reference/friction.py", ["parity/test_friction_parity.py", "identities/test_friction_identities.py"]),
        ("rust/core/src/law/adaptive/composite.rs", ["parity/test_composite_parity.py", "identities/test_composite.py"]),
        ("rust/core/src/plan/time_path/mod.rs", ["parity/test_time_path_parity.py", "oracles/test_time_path_oracle.py"]),
        ("rust/core/src/integrate/radau5.rs", ["identities/test_integrate_identities.py", "reference/test_reference_integrate.py"]),
        ("tests/api/test_gym.py", ["api/test_gym.py"]),
        ("docs/arms.md", []),
    ],
)
def test_related_tests_are_chosen(quick: Any, file: str, expected: list[str]) -> None:
    found = [path.relative_to(ROOT / "tests").as_posix() for path in quick.chosen([ROOT / file])]
    assert set(expected) <= set(found) and bool(found) == bool(expected)
    kinds = [name.split("/")[0] for name in found]
    assert len(kinds) == len(set(kinds))


def test_every_source_file_has_tests(quick: Any) -> None:
    sources = [*(ROOT / "rust/core/src").rglob("*.rs"), *(ROOT / "rust/py/src").rglob("*.rs"), *(ROOT / "python/armlet").rglob("*.py")]
    assert len(sources) > 300
    assert [path for path in sources if not quick.chosen([path])] == []


def test_changed_files_come_from_git_or_from_the_command_line(quick: Any) -> None:
    assert all(path.is_file() for path in quick.changed())
    command = [sys.executable, "-P", str(ROOT / "tools" / "quick.py"), "--list"]
    done = subprocess.run([*command, "python/armlet/srdf.py"], cwd=ROOT, capture_output=True, text=True, timeout=60, check=True)
    assert "tests/api/test_robot_files.py" in done.stdout.split()
    done = subprocess.run([*command, "README.md"], cwd=ROOT, capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "quick: no changed source\n"


def test_tests_that_compile_have_the_marker() -> None:
    def imports(tree: ast.Module) -> set[str]:
        return {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module is not None}

    trees = {path: ast.parse(path.read_text()) for path in (ROOT / "tests/api").glob("test_*.py")}
    compiling = [path.name for path, tree in trees.items() if "compiled_c" in imports(tree)]
    marked = [path.name for path, tree in trees.items() if "pytest.mark.compile" in map(ast.unparse, ast.walk(tree))]
    assert len(compiling) == 6 and sorted(marked) == sorted([*compiling, "test_realtime.py", "test_tools.py"])
