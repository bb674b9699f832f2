"""The sources follow the rules of tools/source_rules.py, and each rule detects a deliberate violation."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest
from scripts import imported

ROOT = Path(__file__).resolve().parents[2]


RULES = imported(ROOT / "tools" / "source_rules.py")
SOURCES = RULES.sources(ROOT / "rust", ROOT / "python")


def test_no_file_is_too_long() -> None:
    assert sum(path.suffix == ".py" for path in SOURCES) > 100 and sum(path.suffix == ".rs" for path in SOURCES) > 300
    assert RULES.long_files(SOURCES) == {}


def test_no_folder_is_too_full() -> None:
    assert RULES.full_folders(SOURCES) == {}


def test_no_function_is_too_long() -> None:
    found = {str(path): RULES.long_functions(path) for path in SOURCES}
    assert {path: longer for path, longer in found.items() if longer} == {}


def test_no_ten_lines_stand_twice() -> None:
    assert RULES.repeated(SOURCES) == []


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("a.py", "def f(x):\n{body}    return x\n", {"f:1": 82}),
        ("a.py", "# Long: one formula.\ndef f(x):\n{body}    return x\n", {}),
        ("a.py", "# Long: one formula.\n@g\ndef f(x):\n{body}    return x\n", {}),
        ("a.py", '# About x.\ndef f(x):\n    """One.\n\n    Two."""\n{body}', {"f:2": 81}),
        ("a.py", "def f(x):\n{less}    return x\n", {}),
        ("a.rs", "fn f<T>(x: f64) -> [f64; 2] {{\n{body}}}\n", {"f:1": 82}),
        ("a.rs", '#[test]\nfn f() {{\n    let c = "}}"; // }}\n{less}}}\nfn g() {{}}\n', {"f:2": 81}),
        ("a.rs", "// Long: a table.\n#[test]\nfn f() {{\n{body}}}\n", {}),
        ("a.rs", "trait A {{\n    fn f(x: f64);\n{body}}}\n", {}),
    ],
)
def test_long_functions_are_detected(name: str, text: str, expected: dict[str, int], tmp_path: Path) -> None:
    (tmp_path / name).write_text(text.format(body="    x = x\n" * 80, less="    x = x\n" * 78))
    assert RULES.long_functions(tmp_path / name) == expected


def test_long_files_are_detected(tmp_path: Path) -> None:
    (tmp_path / "long.rs").write_text("\n" * 401)
    (tmp_path / "short.py").write_text("\n" * 400)
    assert RULES.long_files(RULES.sources(tmp_path)) == {tmp_path / "long.rs": 401}
    # The docstrings of a stub are copies.
    for name, more in (("copied.pyi", ""), ("long.pyi", "x: int\n" * 400)):
        (tmp_path / name).write_text('def f() -> None:\n    """One.\n' + "\n" * 500 + '    """\n' + more)
    assert RULES.long_files(RULES.sources(tmp_path)) == {tmp_path / "long.pyi": 400 + 1, tmp_path / "long.rs": 401}


def test_full_folders_are_detected(tmp_path: Path) -> None:
    for folder, head, text in (
        ("a", "mod.rs", "//! Files.\n"),
        ("b", "mod.rs", "//! Files.\n//!\n//! The folder is flat, because it is one table.\n"),
        ("c", "__init__.py", '"""The folder is flat, because\n"""\n'),
        ("d", "__init__.py", '"""Files.\n\nThe folder is flat, because it is one table.\n"""\n'),
    ):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / head).write_text(text)
        for i in range(15):
            (tmp_path / folder / f"{i}.{head[-2:]}").write_text("")
    assert RULES.full_folders(RULES.sources(tmp_path)) == {tmp_path / "a": 16, tmp_path / "c": 16}
    (tmp_path / "a" / "0.rs").unlink()
    (tmp_path / "c" / "0.py").rename(tmp_path / "c" / "0.pyi")
    assert RULES.full_folders(RULES.sources(tmp_path)) == {}


def test_repeated_lines_are_detected(tmp_path: Path) -> None:
    lines = [f"x{i} = {i}" for i in range(12)]
    (tmp_path / "a.py").write_text("\n".join(["first = 1", *lines, "a = 1"]))
    (tmp_path / "b.py").write_text("def f():\n" + "\n\n".join("    " + line for line in lines) + "\n    b = 1\n")
    (tmp_path / "c.py").write_text("\n".join(lines[:9]))
    (tmp_path / "d.pyi").write_text("\n".join(lines))
    assert RULES.repeated(RULES.sources(tmp_path)) == [[(tmp_path / "a.py", 2, 12), (tmp_path / "b.py", 2, 12)]]
    # Parameters of functions may repeat.
    parameters = ",\n".join(f"    x{i}: int = {i}" for i in range(12))
    (tmp_path / "a.py").write_text(f"def f(\n{parameters},\n): ...\n")
    (tmp_path / "b.py").write_text(f"def g(\n{parameters},\n): ...\n")
    assert RULES.repeated(RULES.sources(tmp_path)) == []
    # Parameters may also repeat if the function is written in Rust.
    (tmp_path / "a.py").unlink()
    (tmp_path / "b.py").unlink()
    for name, kind in (("a.rs", "&Bound<'py, PyAny>"), ("b.rs", "&Bound<'py, PyAny>"), ("c.rs", "&[f64]"), ("d.rs", "&[f64]")):
        given = "\n".join(f"    x{i}: {kind}," for i in range(12))
        (tmp_path / name).write_text(f"fn {name[0]}(\n{given}\n) {{}}\n")
    assert RULES.repeated(RULES.sources(tmp_path)) == [[(tmp_path / "c.rs", 2, 13), (tmp_path / "d.rs", 2, 13)]]


def test_arms_of_models_are_not_constructed_again() -> None:
    """No test constructs an arm of `models.py` again, except in a program for another process, which is text here."""
    tests = ROOT / "tests"
    tree = ast.parse((tests / "models.py").read_text())
    constants = [node.value for node in tree.body if isinstance(node, ast.Assign)]
    texts = {ast.unparse(value) for value in constants if isinstance(value, ast.Call)}
    assert len(texts) == 10
    files = {path: path.read_text() for path in sorted(tests.rglob("*.py")) if path.name != "models.py"}
    again = [
        f"{path.relative_to(ROOT / 'tests')}:{node.lineno}"
        for path, source in files.items()
        if any(text.replace("'", '"') in source for text in texts)  # to parse all files takes a second
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Call) and ast.unparse(node) in texts
    ]
    assert again == []


def test_python_files_are_formatted() -> None:
    command = [sys.executable, "-m", "ruff", "format", "--check", "--no-cache", "python", "tests", "tools", "examples", "benches", "docs"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout
