"""A sweep into a folder that cannot be written: one line, no partial files, and it can be continued later."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from test_sweep import DRAWS, SCENARIO, same, toml

import armlet as al

OPTIONS = {"draws": 40, "seed": 3, "chunk": 10}
# This code limits the files of its process to 4 KiB, less than a chunk. A write then fails as on a full disk.
LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
from armlet.cli import main
sys.exit(main(["sweep", sys.argv[1], "--out", sys.argv[2]]))
"""


def test_a_disk_without_room(tmp_path: Path) -> None:
    file, out = tmp_path / "s.toml", tmp_path / "out"
    file.write_text(toml(dict(SCENARIO.data) | {"sweep": {"vary": DRAWS, **OPTIONS}}))
    wanted = al.sweep(SCENARIO, DRAWS, **OPTIONS)  # type: ignore[arg-type]  # OPTIONS has only counts

    class Stop(Exception):
        pass

    def stop(done: int, total: int) -> None:
        raise Stop

    with pytest.raises(Stop):
        al.sweep(al.Scenario.load(file), out=out, progress=stop)
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    assert sorted(before) == ["chunk-000000.npz", "sweep.json"] and len(before["chunk-000000.npz"]) > 4096
    done = subprocess.run(
        [sys.executable, "-P", "-c", LIMITED, str(file), str(out)], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2
    assert done.stderr.startswith("armlet: ") and done.stderr.count("\n") == 1 and "file too large" in done.stderr
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    same(wanted, al.sweep(al.Scenario.load(file), out=out))


@pytest.mark.parametrize("place", ["file", "below a file", "not ours"])
def test_a_place_that_cannot_be_written(place: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The error is raised before any run."""
    from armlet.cli import main

    (tmp_path / "taken").write_text("")
    out = {"file": tmp_path / "taken", "below a file": tmp_path / "taken" / "out", "not ours": Path("/proc/armlet")}[place]
    calls: list[int] = []
    with pytest.raises(OSError):
        al.sweep(SCENARIO, DRAWS, draws=40, out=out, progress=lambda done, _: calls.append(done))
    assert calls == []
    file = tmp_path / "s.toml"
    file.write_text(toml(dict(SCENARIO.data) | {"sweep": {"vary": DRAWS, **OPTIONS}}))
    assert main(["sweep", str(file), "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert said.startswith("armlet: ") and said.count("\n") == 1 and str(out.name if place == "not ours" else "taken") in said
