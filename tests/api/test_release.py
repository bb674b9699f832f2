"""Release checks detect faults: licences that are not allowed, and wheels that do not agree with their tags."""

from __future__ import annotations

import base64
import hashlib
import struct
import zipfile
from pathlib import Path

import pytest
from scripts import imported

TOOLS = Path(__file__).resolve().parents[2] / "tools"


audit, check_wheel, neutral = (imported(TOOLS / name) for name in ("audit.py", "release/check_wheel.py", "release/neutral.py"))
LICENCES = {"MIT", "Unicode-3.0", "Apache-2.0 WITH LLVM-exception"}


@pytest.mark.parametrize(
    ("licence", "permitted"),
    [
        ("MIT", True),
        ("MIT/Apache-2.0", True),
        ("Apache-2.0 OR GPL-3.0", False),
        ("(MIT OR Apache-2.0) AND Unicode-3.0", True),
        ("MIT AND GPL-3.0", False),
        ("Apache-2.0 WITH LLVM-exception", True),
        (None, False),
    ],
)
def test_licences(licence: str | None, permitted: bool) -> None:
    assert audit.permitted(licence, LICENCES) is permitted


def test_crates_are_permitted() -> None:
    packages = audit.crates()
    assert {"armlet-core", "armlet-py", "nalgebra", "pyo3"} <= {package["name"] for package in packages}
    assert {name: faults for name, check in audit.CHECKS.items() if (faults := check(packages))} == {}


def elf(processor: int, glibc: str) -> bytes:
    return b"\x7fELF" + bytes(14) + struct.pack("<H", processor) + f"GLIBC_{glibc}".encode()


def wheel(folder: Path, platform: str, binary: bytes, *, without: str = "") -> Path:
    path = folder / f"armlet-0.1.0-cp311-abi3-{platform}.whl"
    info = "armlet-0.1.0.dist-info/"
    names = ["armlet/__init__.py", "armlet/py.typed", f"{info}METADATA", f"{info}licenses/LICENSE", f"{info}sboms/armlet.cyclonedx.json"]
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("armlet/_core.abi3.so", binary)
        for name in names:
            if not without or without not in name:
                archive.writestr(name, "")
    return path


@pytest.mark.parametrize(
    ("platform", "binary", "without", "wrong"),
    [
        ("manylinux_2_17_x86_64", elf(62, "2.17"), "", ""),
        ("manylinux2014_x86_64.manylinux_2_17_x86_64", elf(62, "2.34"), "", "glibc 2.17"),
        ("manylinux_2_17_aarch64", elf(62, "2.17"), "", "of linux x86_64"),
        ("macosx_11_0_arm64", b"\xcf\xfa\xed\xfe" + struct.pack("<I", 0x0100000C), "", ""),
        ("win_amd64", elf(62, "2.17"), "", "of linux"),
        ("manylinux_2_17_x86_64", elf(62, "2.17"), "sboms", "bill of materials"),
        ("manylinux_2_17_x86_64", elf(62, "2.17"), "LICENSE", "LICENSE is missing"),
    ],
)
def test_wheels(tmp_path: Path, platform: str, binary: bytes, without: str, wrong: str) -> None:
    faults = check_wheel.faults(wheel(tmp_path, platform, binary, without=without))
    assert (not faults) if not wrong else any(wrong in fault for fault in faults)


def test_the_folder_of_the_build_leaves(tmp_path: Path) -> None:
    """Only the bill of materials and its hash in RECORD change."""
    path = wheel(tmp_path, "manylinux_2_17_x86_64", elf(62, "2.17"), without="sboms")
    bill, record = ("armlet-0.1.0.dist-info/" + name for name in ("sboms/armlet.cyclonedx.json", "RECORD"))
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(bill, '{"ref": "path+file:///home/rust/armlet/rust/core#armlet-core@0.1.0", "url": "registry+https://x#y"}')
        archive.writestr(record, f"armlet/__init__.py,sha256=abc,0\n{bill},sha256=old,1\n{record},,\n")
    (fault,) = check_wheel.faults(path)
    assert fault == "the bill of materials names a folder of the build: path+file:///home/rust/armlet/rust/core"
    with zipfile.ZipFile(path) as archive:
        before = {name: archive.read(name) for name in archive.namelist()}
    neutral.neutral(path)
    assert check_wheel.faults(path) == [] and list(tmp_path.iterdir()) == [path]
    with zipfile.ZipFile(path) as archive:
        after = {name: archive.read(name) for name in archive.namelist()}
    assert list(after) == list(before) and {name for name in after if after[name] != before[name]} == {bill, record}
    assert after[bill] == b'{"ref": "path+file:///armlet/rust/core#armlet-core@0.1.0", "url": "registry+https://x#y"}'
    digest = base64.urlsafe_b64encode(hashlib.sha256(after[bill]).digest()).rstrip(b"=").decode()
    expected = ["armlet/__init__.py,sha256=abc,0", f"{bill},sha256={digest},{len(after[bill])}", f"{record},,"]
    assert after[record].decode().splitlines() == expected


def test_the_changelog_has_one_screen_for_a_version() -> None:
    """A version has at most 60 lines. The first one, which nobody used before, has neither corrections nor changes."""
    versions = (TOOLS.parent / "CHANGELOG.md").read_text().split("\n## ")[1:]
    assert [version.partition("\n")[0] for version in versions if version.count("\n") > 60] == []
    assert [line for line in versions[-1].splitlines() if line.startswith("#")] == ["### Added", "### Limits"]
