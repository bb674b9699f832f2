"""Sweeps into a file system that becomes full or read-only during the sweep. Each runs in a separate mount namespace (Linux)."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

API = Path(__file__).resolve().parents[1] / "api"

PROGRAM = """
import subprocess, sys
from pathlib import Path
sys.path.insert(0, {api!r})
from test_sweep import DRAWS, SCENARIO, same
import armlet as al

def mount(*options):
    subprocess.run(["mount", *options, str(out)], check=True)

def files():
    return {{path.name: path.read_bytes() for path in sorted(out.iterdir())}}

out = Path(sys.argv[1])
wanted = al.sweep(SCENARIO, DRAWS, draws=480, seed=7, chunk=8)
"""

FULL = """
mount("-t", "tmpfs", "-o", "size=128k", "tmpfs")
for trial, size in enumerate(("128k", "192k", "200k", "256k")):
    mount("-o", f"remount,size={size}", "-t", "tmpfs")
    try:
        al.sweep(SCENARIO, DRAWS, draws=480, seed=7, chunk=8, out=out)
    except OSError as error:
        print(type(error).__name__, error.strerror)
    else:
        raise SystemExit("the disk was large enough")
    assert not [name for name in files() if name.startswith(".armlet")], files().keys()
before = files()
assert 5 < len(before) < 61, len(before)
mount("-o", "remount,size=64m", "-t", "tmpfs")
calls = []
same(wanted, al.sweep(SCENARIO, DRAWS, draws=480, seed=7, chunk=8, out=out, progress=lambda done, _: calls.append(done)))
after = files()
assert len(after) == 61 and all(after[name] == held for name, held in before.items())
assert len(calls) + len(before) == 61
print("rows kept", 8 * (len(before) - 1), "of 480, chunks run after", len(calls))
"""

READ_ONLY = """
mount("-t", "tmpfs", "tmpfs")
kept = []
for stop in (3, 11, 40):
    calls = []
    def shut(done, total):
        calls.append(done)
        if len(calls) == stop:
            mount("-o", "remount,ro", "-t", "tmpfs")
    try:
        al.sweep(SCENARIO, DRAWS, draws=480, seed=7, chunk=8, out=out, progress=shut)
    except OSError as error:
        print(type(error).__name__, error.strerror)
    else:
        raise SystemExit("it was written to what is read-only")
    # The disk is read-only from the start. So the sweep raises the error before the first run.
    calls = []
    try:
        al.sweep(SCENARIO, DRAWS, draws=480, seed=8, chunk=8, out=out / "new", progress=shut)
    except OSError as error:
        assert not calls, calls
    kept.append(len(files()))
    mount("-o", "remount,rw", "-t", "tmpfs")
same(wanted, al.sweep(SCENARIO, DRAWS, draws=480, seed=7, chunk=8, out=out))
assert kept == [4, 15, 55], kept
"""


def in_namespace(program: str, tmp_path: Path) -> str:
    """Run a program where it may mount file systems: as root, or as root of a user namespace."""
    out = tmp_path / "out"
    out.mkdir()
    unshare = ["unshare", "--mount"] if os.geteuid() == 0 else ["unshare", "--mount", "--map-root-user"]
    code = PROGRAM.format(api=str(API)) + program
    done = subprocess.run([*unshare, sys.executable, "-P", "-c", code, str(out)], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    print(done.stdout)
    return done.stdout


def test_a_disk_that_fills_up(tmp_path: Path) -> None:
    """Finished chunks are unchanged, and no partial file remains. With new space the sweep gives the table of an undisturbed sweep."""
    assert in_namespace(FULL, tmp_path).splitlines()[:4] == ["OSError No space left on device"] * 4


def test_a_disk_that_turns_read_only(tmp_path: Path) -> None:
    assert in_namespace(READ_ONLY, tmp_path).splitlines() == ["OSError Read-only file system"] * 3
