"""Content of the sdist and the wheel: they contain all sources and nothing from earlier builds or runs, and they can be imported.

`make test` builds both once and names them in ARMLET_SDIST and ARMLET_WHEEL. Without these names (pytest called directly) a new sdist is
built, and the installed package is checked instead of the wheel.
"""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import tarfile
import venv
import zipfile
from importlib import metadata
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FROM_MAKE = os.environ.get("ARMLET_MAKE_TEST") == "1"
PACKAGE = ["__init__.py", "py.typed", "_core/__init__.pyi", "errors.py", "status.py"]
PACKAGE += ["run/records.py", "figures/run.py", "cli/__init__.py", "demo/__init__.py"]


def artefact(variable: str) -> Path | None:
    """The file that make names in `variable`; None if pytest was called directly."""
    value = os.environ.get(variable)
    if value:
        return Path(value)
    assert not FROM_MAKE, f"make test did not set {variable}"
    return None


def stale(names: list[str]) -> list[str]:
    """Names that an sdist must not contain: compiled code, caches, outputs of builds and runs."""
    folders = {"__pycache__", "build", "dist", "out", "target", ".venv", ".git", ".mypy_cache", ".ruff_cache", ".pytest_cache", "results"}
    endings = (".pyc", ".so", ".pyd", ".dylib", ".dll", ".whl", ".tar.gz", ".egg-info", ".orig", "~")
    return [name for name in names if folders & set(name.split("/")[:-1]) or name.endswith(endings)]


@pytest.fixture(scope="module")
def sdist_names(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    sdist = artefact("ARMLET_SDIST")
    if sdist is None:
        out = tmp_path_factory.mktemp("sdist")
        subprocess.run([sys.executable, "-m", "maturin", "sdist", "--out", str(out)], cwd=ROOT, check=True)
        (sdist,) = out.glob("armlet-*.tar.gz")
    with tarfile.open(sdist) as archive:
        return [name.split("/", 1)[1] for name in archive.getnames()]


@pytest.fixture(scope="module")
def wheel_names() -> list[str]:
    wheel = artefact("ARMLET_WHEEL")
    if wheel is not None:
        with zipfile.ZipFile(wheel) as archive:
            return archive.namelist()
    # pip writes caches and the command-line launcher during installation. They are not in the wheel.
    names = [str(file) for file in metadata.files("armlet") or []]
    return [name for name in names if "__pycache__" not in name and not name.startswith("..")]


def test_rule_sees_planted_leftovers() -> None:
    planted = ["python/armlet/_core.abi3.so", "python/armlet/__pycache__/run.cpython-311.pyc", "build/lib/x.py", "dist/armlet-0.1.0.tar.gz"]
    assert stale([*planted, "python/armlet/run/records.py", "tools/build.sh"]) == planted


def test_sdist_has_no_leftovers(sdist_names: list[str]) -> None:
    assert stale(sdist_names) == []


def test_sdist_is_complete(sdist_names: list[str]) -> None:
    """The sdist contains all tracked sources. So it is sufficient to build, test and read armlet."""
    kinds = {".github": ".yml", "python": ".py", "rust": ".rs", "tests": ".py", "examples": ".py", "docs": ".md", "requirements": ".txt"}
    wanted = [str(p.relative_to(ROOT)) for top, end in kinds.items() for p in (ROOT / top).rglob(f"*{end}") if "_build" not in p.parts]
    wanted += [str(p.relative_to(ROOT)) for p in (ROOT / "tests" / "vectors").glob("*.json")]
    wanted += ["Cargo.toml", "Cargo.lock", "pyproject.toml", "Makefile", "LICENSE", "README.md", "PKG-INFO"]
    assert sorted(set(wanted) - set(sdist_names)) == []


def test_wheel_contains_only_package_and_metadata(wheel_names: list[str]) -> None:
    extension = [name for name in wheel_names if name.startswith("armlet/_core.") and name.endswith((".so", ".pyd"))]
    leftovers = [name for name in stale(wheel_names) if name not in extension]
    tops = {name.split("/")[0] for name in wheel_names}
    dist_info = {top for top in tops if top.startswith("armlet-") and top.endswith(".dist-info")}
    assert leftovers == []
    assert len(dist_info) == 1
    assert tops - dist_info <= {"armlet", "armlet.pth"}  # the .pth belongs to an editable installation
    if "armlet.pth" not in tops:
        assert len(extension) == 1, extension
        assert "abi3" in extension[0]
        assert [name for name in PACKAGE if f"armlet/{name}" not in wheel_names] == []
        assert any(name.endswith("licenses/LICENSE") for name in wheel_names)


def test_tests_see_the_installed_wheel() -> None:
    """Under make, the tested package is the wheel, not the source tree."""
    import armlet

    where = Path(armlet.__file__).resolve()
    assert where.is_relative_to(Path(sysconfig.get_path("platlib")).resolve()) or (not FROM_MAKE and where.is_relative_to(ROOT / "python"))


def test_import_needs_only_numpy(tmp_path: Path) -> None:
    """In an environment with only the wheel and numpy, armlet imports, reports its version, and loads nothing optional."""
    venv.create(tmp_path / "clean", with_pip=False, symlinks=os.name != "nt")
    python = tmp_path / "clean" / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    where = "import sysconfig; print(sysconfig.get_path('platlib'))"
    report = subprocess.run([python, "-c", where], capture_output=True, text=True, check=True)
    site = Path(report.stdout.strip())
    import numpy

    # Only numpy of this environment is added to the path.
    numpy_dir = Path(numpy.__file__).parent
    for folder in [numpy_dir, numpy_dir.parent / "numpy.libs"]:
        if folder.exists():
            (site / folder.name).symlink_to(folder, target_is_directory=True)
    wheel = artefact("ARMLET_WHEEL")
    if wheel is not None:
        command = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", "--no-deps", "--no-index", str(wheel)]
        subprocess.run(command, check=True)
    else:
        import armlet

        (site / "armlet").symlink_to(Path(armlet.__file__).parent, target_is_directory=True)
    code = (
        "import sys, armlet, armlet.cli; print(armlet.__version__); "
        "others = {'matplotlib', 'scipy', 'pandas', 'xarray', 'viser', 'numba'} & set(sys.modules); assert not others, others"
    )
    run = subprocess.run([python, "-I", "-c", code], capture_output=True, text=True, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    assert run.stdout.strip() == metadata.version("armlet")
    assert not (site / "matplotlib").exists()
