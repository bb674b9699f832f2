"""`Run` and `BatchRun`: fields, storage that detects damage, tables, figures. The runs are synthetic, not simulated."""

from __future__ import annotations

import pickle
import zipfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from armlet.errors import FormatError, InputError
from armlet.run import BatchRun, Run, load
from armlet.status import Status

T = np.linspace(0.0, 10.0, 400)
ARRAYS = ("t", "q", "v", "tau", "estimate")


def motion(t: float) -> tuple[NDArray[np.float64], ...]:
    phase = np.array([t, 1.7 * t])
    rate = np.array([1.0, 1.7])
    return 0.5 * np.sin(phase), 0.5 * rate * np.cos(phase), -0.5 * rate**2 * np.sin(phase)


class Adaptive:
    """A replacement for the law of this name."""

    motion = _joint_motion = staticmethod(motion)


PLANT = SimpleNamespace(arm=SimpleNamespace(parameters=np.array([2.0, 0.5, 0.5]), joint_types=("prismatic", "revolute")))


def fields() -> dict[str, Any]:
    decay = np.exp(-T)[:, None]
    desired = np.array([motion(t)[0] for t in T])
    return {
        "t": T,
        "q": desired - decay * [0.4, -0.3],
        "v": decay * [1.0, 2.0],
        "tau": decay * [30.0, -12.0],
        "estimate": (1 - decay) * [1.8, 0.4, 0.55],
        "status": 0,
        "stats": {"steps": 400, "evaluations": np.int64(1600)},
        "monitors": {"lyapunov": 4.4 * np.exp(-2 * T), "lyapunov_balance": 1e-12 * np.sin(T), "skewness": 0 * T},
    }


@pytest.fixture
def run() -> Run:
    return Run(fields(), law=Adaptive(), plant=PLANT)


@pytest.fixture
def batch() -> BatchRun:
    one = fields()
    rows = {name: np.stack([one[name], 2 * one[name]]) for name in ARRAYS[1:]}
    monitors = {name: np.stack([value, value]) for name, value in one["monitors"].items()}
    stats = {"steps": np.array([400, 7])}
    return BatchRun(rows | {"t": T, "status": [0, 1], "monitors": monitors, "stats": stats}, law=Adaptive(), plant=PLANT)


def same(a: Run | BatchRun, b: Run | BatchRun) -> None:
    assert type(a) is type(b)
    for name in (*ARRAYS, "parameters"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    assert a.theta is None and b.theta is None
    assert a.monitors.keys() == b.monitors.keys()
    for name in a.monitors:
        np.testing.assert_array_equal(a.monitors[name], b.monitors[name])
    assert a.units == b.units and a.law_name == b.law_name
    np.testing.assert_array_equal(a.status, b.status)
    assert a.stats.keys() == b.stats.keys()
    for name in a.stats:
        np.testing.assert_array_equal(a.stats[name], b.stats[name])
    wanted, got = a.desired(), b.desired()
    assert wanted is not None and got is not None
    for x, y in zip(wanted, got, strict=True):
        np.testing.assert_array_equal(x, y)


def test_fields(run: Run) -> None:
    assert run.status is Status.SUCCESS
    assert run.units == ("m", "rad")
    assert len(run) == 400
    assert "Adaptive" in repr(run) and "n=2" in repr(run) and "success" in repr(run)


def test_unknown_field_is_refused() -> None:
    with pytest.raises(InputError, match="wrong_name"):
        Run(fields() | {"wrong_name": 1})


def test_desired_is_the_motion(run: Run) -> None:
    desired = run.desired()
    assert desired is not None
    np.testing.assert_array_equal(desired[1], [motion(t)[1] for t in T])


def test_rows_of_a_batch(batch: BatchRun) -> None:
    assert len(batch) == 2 and [row.status for row in batch] == [Status.SUCCESS, Status.DIVERGED]
    np.testing.assert_array_equal(batch[-1].q, 2 * fields()["q"])
    assert batch[1].stats == {"steps": 7}
    assert "1 success, 1 diverged" in repr(batch)
    with pytest.raises(IndexError):
        batch[2]


def test_rows_with_their_own_motion_and_parameters(tmp_path: Path) -> None:
    one = fields()
    laws = [SimpleNamespace(_joint_motion=lambda t, k=k: (np.full(2, k * t), np.full(2, k), np.zeros(2))) for k in (1.0, 2.0)]
    plants = [PLANT, SimpleNamespace(arm=SimpleNamespace(parameters=np.array([3.0, 1.0, 1.0])))]
    rows = {name: np.stack([one[name]] * 2) for name in ("q", "v")}
    batch = BatchRun(rows | {"t": np.stack([T, T / 2]), "status": 0}, law=laws, plant=plants)
    for first in (batch, pickle.loads(pickle.dumps(batch))):
        desired = first[1].desired()
        assert desired is not None
        np.testing.assert_array_equal(desired[0][:, 0], 2.0 * (T / 2))
        np.testing.assert_array_equal(first[1].parameters, [3.0, 1.0, 1.0])
        np.testing.assert_array_equal(first[1].t, T / 2)


def test_storage_returns_the_same(run: Run, batch: BatchRun, tmp_path: Path) -> None:
    for thing in (run, batch):
        thing.save(tmp_path / "x.armlet")
        same(thing, load(tmp_path / "x.armlet"))
    assert [p.name for p in tmp_path.iterdir()] == ["x.armlet"]


def test_a_run_of_an_earlier_version_names_its_engine(tmp_path: Path) -> None:
    """Earlier versions used the name "portable" for the interpreter."""
    stats = {"steps": 400, "engine": "portable"}
    Run(fields() | {"stats": stats}, law=Adaptive(), plant=PLANT).save(tmp_path / "x.armlet")
    assert load(tmp_path / "x.armlet").stats["engine"] == "portable"


def test_pickle_returns_the_same(run: Run, batch: BatchRun) -> None:
    for thing in (run, batch):
        same(thing, pickle.loads(pickle.dumps(thing)))


def test_any_damage_is_noticed(run: Run, tmp_path: Path) -> None:
    """A truncated file, a flipped byte, or appended bytes raise FormatError."""
    path = tmp_path / "x.armlet"
    run.save(path)
    whole = path.read_bytes()
    # Some bytes of the file, and each of the last 2,000, which contain the archive's directory.
    for position in [*range(0, len(whole) - 2000, 499), *range(len(whole) - 2000, len(whole))]:
        for damaged in (whole[:position], whole[:position] + bytes([whole[position] ^ 0x04]) + whole[position + 1 :]):
            # Each damaged file is a new file, because some disks are slow when a file is overwritten.
            other = tmp_path / f"{position}.{len(damaged)}"
            other.write_bytes(damaged)
            with pytest.raises(FormatError, match=r"^load: "):
                load(other)
            other.unlink()
    path.write_bytes(whole + b"\0")
    with pytest.raises(FormatError):
        load(path)


def test_a_changed_number_is_noticed_by_the_checksum(run: Run, tmp_path: Path) -> None:
    """The container's checks pass here, so only the checksum can detect the change."""
    run.save(tmp_path / "x.armlet")
    with np.load(tmp_path / "x.armlet") as container:
        arrays = dict(container)
    arrays["q"][3, 0] += 1e-15
    with (tmp_path / "y.armlet").open("wb") as file:
        np.savez(file, **arrays)
    with pytest.raises(FormatError, match="checksum"):
        load(tmp_path / "y.armlet")


def test_foreign_files_are_refused(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "x"
    path.write_text("time,q\n")
    with pytest.raises(FormatError, match="npz"):
        load(path)
    np.savez(tmp_path / "y.npz", q=T)
    with pytest.raises(FormatError, match="header"):
        load(tmp_path / "y.npz")
    with zipfile.ZipFile(tmp_path / "z.zip", "w") as archive:
        archive.writestr("q.npy", pickle.dumps({"a": 1}))
    with pytest.raises(FormatError):
        load(tmp_path / "z.zip")
    with pytest.raises(FileNotFoundError):
        load(tmp_path / "nowhere")


def test_a_failed_write_leaves_the_old_file(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "x.armlet"
    run.save(path)
    before = path.read_bytes()

    def full(fd: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space left"):
        run.save(path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["x.armlet"]


def test_tables(run: Run, batch: BatchRun) -> None:
    table = run.to_pandas()
    assert table.index.name == "t"
    wanted = ["q1", "q2", "v1", "v2", "tau1", "tau2", "estimate1", "estimate2", "estimate3", "lyapunov", "lyapunov_balance", "skewness"]
    assert list(table.columns) == wanted
    np.testing.assert_array_equal(table["tau2"], run.tau[:, 1])  # type: ignore[index]
    rows = batch.to_pandas()
    assert rows.index.names == ["run", "t"]
    np.testing.assert_array_equal(rows.loc[1, "q1"], batch.q[1, :, 0])


def test_figure(run: Run) -> None:
    """Every panel has data, a title, and an axis with its unit."""
    from matplotlib.figure import Figure

    axes = run.plot(Figure())
    # Positions, errors and inputs have one panel per unit.
    assert axes.shape == (3, 3)
    for ax in axes.flat:
        assert ax.get_title(loc="left")
        assert "(" in ax.get_ylabel()
        assert ax.lines
    assert all("(s)" in ax.get_xlabel() for ax in axes[-1])
    np.testing.assert_allclose(axes[0, 2].lines[0].get_ydata(), 0.4 * np.exp(-T), atol=1e-15)
    axes[0, 0].figure.canvas.draw()


def test_figure_without_matplotlib(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ImportError, match=r"pip install '\.\[plot\]'"):
        run.plot()
