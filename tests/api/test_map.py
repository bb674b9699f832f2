"""The picture and the table of docs/map.md.

The picture contains all parts of the core. The table lists the files that a new law, method, task, plant or monitor changes.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from test_layering import BELOW

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs/map.md").read_text(encoding="utf-8")
SOURCES = ("rust/core/src", "rust/py/src", "python/armlet")
#: Files that do not count: lists of exports, demonstrations and unit tests.
LEFT_OUT = re.compile(r"__init__\.pyi?$|rust/py/src/lib\.rs$|/(demo|live)/|tests\.rs$")
#: The examples in the table of docs/map.md, each with a pattern that matches the names of the example in the sources.
NAMES = {
    "JointImpedance": r"JointImpedance|joint_impedance",
    "ros2": r"Ros2|\bros2\b",
    "CentreOfMass": r"CentreOfMass",
    "VelocityArm": r"VelocityArm|\bVelocitySpec",
    "torque_error": r"TorqueError|torque_error",
}
ROWS = re.findall(r"^\| (an? [^|]+?) \| `(\w+)` \| (\d+) \| (`[^|]+`) \|$", PAGE, re.MULTILINE)


def code(path: Path) -> str:
    """A source without comments, docstrings, lists of modules and unit tests."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".rs":
        text = re.sub(r"^mod \w+;$|^pub use \w+::\*;$", "", text, flags=re.MULTILINE)
        return re.sub(r"//[^\n]*|/\*.*?\*/", "", text, flags=re.DOTALL).partition("#[cfg(test)]")[0]
    return re.sub(r'""".*?"""|#[^\n]*', "", text, flags=re.DOTALL)


def naming(pattern: str, top: Path) -> set[str]:
    """The source files in `top` that match the pattern."""
    files = [path for part in SOURCES for path in (top / part).rglob("*") if path.suffix in (".rs", ".py", ".pyi")]
    kept = [path for path in files if not LEFT_OUT.search(path.relative_to(top).as_posix())]
    return {path.relative_to(top).as_posix() for path in kept if re.search(pattern, code(path))}


def test_every_kind_has_its_row() -> None:
    assert [row[0] for row in ROWS] == ["a law", "an integration method", "a task of an arm", "a plant", "a monitor"]
    assert [row[1] for row in ROWS] == list(NAMES)


@pytest.mark.parametrize(("what", "example", "count", "files"), ROWS, ids=[row[0] for row in ROWS])
def test_the_files_that_a_new_part_touches(what: str, example: str, count: str, files: str) -> None:
    """If this test fails, write the files that it found into the row of docs/map.md. Fewer files are better."""
    listed = re.findall(r"`([^`]+)`", files)
    assert [name for name in listed if not (ROOT / name).is_file()] == []
    assert sorted(naming(NAMES[example], ROOT)) == listed
    assert len(listed) == int(count)


def test_a_name_in_code_is_found_and_one_in_a_comment_is_not(tmp_path: Path) -> None:
    files = {
        "rust/core/src/a.rs": "// Ros2\nfn f() {}\n#[cfg(test)]\nmod tests { use Ros2; }\n",
        "rust/core/src/b.rs": "let x = Ros2;\n",
        "python/armlet/c.py": '"""ros2"""\nx = 1  # ros2\n',
        "python/armlet/d.py": 'x = "ros2"\n',
        "python/armlet/demo/e.py": 'x = "ros2"\n',
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    assert naming(NAMES["ros2"], tmp_path) == {"rust/core/src/b.rs", "python/armlet/d.py"}


def test_the_picture_has_every_part() -> None:
    words = set(re.findall(r"[a-z_]+", " ".join(re.findall(r">([^<]+)</text>", (ROOT / "docs/images/house.svg").read_text()))))
    rooms = {path.parent.name for path in (ROOT / "python/armlet").glob("*/__init__.py")}
    assert set(BELOW) - words == set() and rooms - words == set()
