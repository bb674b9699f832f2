"""If the machine lacks a tool, one line reports it before anything is built or downloaded."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TOOLS = ("sh", "make", "find", "awk", "sed", "cut", "sort", "head", "printf", "cat")
GOOD = {
    "python3": f'exec "{sys.executable}" "$@"',
    "cargo": "echo cargo 1.95.0",
    "rustc": "echo 'rustc 1.95.0 (abc 2026-01-01)'",
    "cc": "exit 0",
}


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    """A folder for PATH with basic tools, and replacements for the tools that armlet needs."""
    for tool in TOOLS:
        found = shutil.which(tool)
        assert found, tool
        (tmp_path / tool).symlink_to(found)
    for name, body in GOOD.items():
        put(tmp_path, name, body)
    return tmp_path


def put(folder: Path, name: str, body: str) -> None:
    (folder / name).write_text(f"#!/bin/sh\n{body}\n")
    (folder / name).chmod(0o755)


def require(folder: Path, command: str = "sh tools/require.sh") -> subprocess.CompletedProcess[str]:
    environment = {key: value for key, value in os.environ.items() if key not in ("PYTHON", "CC", "MAKEFLAGS", "MAKELEVEL", "MFLAGS")}
    return subprocess.run(command.split(), cwd=ROOT, env=environment | {"PATH": str(folder)}, capture_output=True, text=True)


def test_a_complete_machine_gives_no_output(machine: Path) -> None:
    result = require(machine)
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")


@pytest.mark.parametrize(
    ("name", "body", "words"),
    [
        ("cargo", None, "Rust (cargo)"),
        ("rustc", None, "Rust (rustc)"),
        ("rustc", "echo 'rustc 1.70.0 (abc 2023-01-01)'", "Rust >= "),
        ("cc", None, "a C linker"),
        ("python3", None, "Python >= 3.11"),
        ("python3", "[ $1 = --version ] && echo Python 3.9.2\nexit 1", "Python 3.9.2"),
        ("python3", f'case "$*" in *ensurepip*) exit 1;; esac\nexec "{sys.executable}" "$@"', "venv and ensurepip"),
    ],
)
def test_a_missing_tool_is_named(machine: Path, name: str, body: str | None, words: str) -> None:
    (machine / name).unlink()
    if body is not None:
        put(machine, name, body)
    result = require(machine)
    assert result.returncode == 1
    (line,) = result.stderr.splitlines()
    assert line.startswith("armlet needs ") and words in line


def test_make_prints_the_same_line(machine: Path) -> None:
    (machine / "cargo").unlink()
    result = require(machine, "make --no-print-directory tools")
    assert result.returncode != 0
    assert [line for line in result.stderr.splitlines() if not line.startswith("make: ***")] == [
        "armlet needs Rust (cargo), not found on PATH: https://rustup.rs"
    ]
