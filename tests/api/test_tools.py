"""Tools that find gaps of the tests: the fuzz test knows all public functions and every kind of fault; mutants are inserted."""

from __future__ import annotations

import inspect
import subprocess
import sys
import tomllib
from pathlib import Path
from random import Random
from typing import Any

import pytest
from scripts import imported

import armlet as al

TOOLS = Path(__file__).resolve().parents[2] / "tools"


def tool(path: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Import a module of a tool. The tool's folder is on the path, because its modules import each other by name."""
    file = TOOLS / path
    monkeypatch.syspath_prepend(str(file.parent))
    return imported(file)


def test_the_fuzz_calls_all_that_is_public(monkeypatch: pytest.MonkeyPatch) -> None:
    """The fuzz test calls every function and every class with a method or constructor. Every parameter has plausible values."""
    signatures = tool("fuzz/signatures.py", monkeypatch)
    targets = signatures.targets()
    names = {target.owner or target.name for target in targets}
    plain = {name for name in al.__all__ if callable(getattr(al, name)) and not issubclass_of_exception(getattr(al, name))}
    # The other classes are results that have only fields.
    assert plain - names <= signatures.RESULTS
    assert {"Arm.bias", "simulate", "BangBangBatch.__getitem__", "Run.metrics", "Arm.from_dh", "Law.__call__"} <= {t.path for t in targets}
    values = tool("fuzz/values.py", monkeypatch).Values(Random(1))
    unknown = {
        f"{target.path}({parameter.name})"
        for target in targets
        for parameter in target.parameters
        if values.by_name(target.path, parameter.name) is None and values.by_type(parameter.annotation) is None
    }
    assert unknown <= {"Run.animate(arm)", "Event(arguments)"}


def issubclass_of_exception(thing: object) -> bool:
    return inspect.isclass(thing) and issubclass(thing, Exception)


def test_a_call_of_the_fuzz_is_its_seed_and_number(monkeypatch: pytest.MonkeyPatch) -> None:
    signatures, calls = tool("fuzz/signatures.py", monkeypatch), tool("fuzz/calls.py", monkeypatch)
    targets = signatures.targets()
    made = [str(calls.call(targets, 3, number)) for number in range(300)]
    assert made == [str(calls.call(targets, 3, number)) for number in range(300)]
    assert len(set(made)) > 250 and made != [str(calls.call(targets, 4, number)) for number in range(300)]
    for text in made:
        compile(text, "call", "exec")


@pytest.mark.parametrize(
    ("argument", "body", "kind"),
    [
        ("[1.0]", "result = a0[0] / 0.0", "foreign exception"),
        ("[1.0]", "raise al.InternalError('x')", "panic"),
        ("[1.0]", "raise type('PanicException', (BaseException,), {})('x')", "panic"),
        ("[1.0]", "a0[0] = 2.0; result = None", "changed input"),
        ("np.zeros(3)", "a0[1] = 2.0; result = None", "changed input"),
        ("{'a': [np.zeros(3)]}", "a0['a'][0][1] = 2.0; result = None", "changed input"),
        ("[1.0]", "result = sum(i for i in range(10**6))", "slow"),
        ("[1.0]", "raise al.ModelError('x')", None),
        ("[1.0]", "raise TypeError('x')", None),
        ("[1.0]", "result = np.add(a0, 1.0)", None),
    ],
)
def test_the_fuzz_knows_a_fault(argument: str, body: str, kind: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    child, calls = tool("fuzz/child.py", monkeypatch), tool("fuzz/calls.py", monkeypatch)
    found = child.run(calls.Call("made up", "", (("a0", argument, True),), body), 1e-3 if kind == "slow" else 60.0)
    assert (found and found[0]) == kind, found


def test_the_fuzz_runs() -> None:
    """Twenty calls run in a child process. The report counts them, and a fault is printed with its snippet."""
    command = [sys.executable, str(TOOLS / "fuzz"), "--seed", "1", "--calls", "20"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode in (0, 1) and "fuzz: seed 1: 20 calls of " in done.stdout, done.stderr
    assert ("== " in done.stdout) == (done.returncode == 1)


def test_a_bug_is_put_in_once_or_not_at_all(monkeypatch: pytest.MonkeyPatch) -> None:
    mutants = tool("mutants/__main__.py", monkeypatch)
    assert mutants.insert("y = a + b;", "a + b", "a - b", 7, "crate", False) == "y = (if crate::mutant(7) { a - b } else { a + b });"
    assert mutants.insert("x += 1;", "x += 1;", "", 2, "armlet_core", True) == "if armlet_core::mutant(2) {  } else { x += 1; }"
    for source in ("y = a - b;", "y = a + b; z = a + b;"):
        with pytest.raises(ValueError, match="expected the text once, got"):
            mutants.insert(source, "a + b", "a - b", 7, "crate", False)
    listed = mutants.mutants()
    # Each text of the list must occur exactly once in the sources.
    rust = TOOLS.parent / "rust"
    assert [bug["what"] for bug in listed if (rust / bug["file"]).read_text().count(bug["text"]) != 1] == []
    assert len(listed) >= 40 and all({"file", "text", "bug", "what", "tests"} <= set(bug) for bug in listed)
    assert len({bug["what"] for bug in listed}) == len(listed)
    assert {bug["file"].split("/")[0] for bug in listed} == {"core", "py"}
    # The switch takes a whole expression, or whole statements.
    for bug in listed:
        for text in (bug["text"], bug["bug"]):
            assert all(text.count(first) == text.count(last) for first, last in ("()", "[]", "{}")), text
            assert bug.get("statement", False) or (not text.endswith(";") and ("{" in text or not text.startswith("if "))), text


def test_the_latency_script_starts_with_the_command_of_make() -> None:
    """With `python -P` the folder of a script is not on sys.path. The script must still find its modules."""
    script = TOOLS.parent / "benches" / "latency.py"
    done = subprocess.run([sys.executable, "-P", str(script), "--help"], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and "--trials" in done.stdout, done.stderr[-2000:]


def test_every_folder_of_tests_has_a_command() -> None:
    """`make test` runs each folder of tests, except the folders that pyproject.toml leaves out. Another command runs each of those."""
    root = TOOLS.parent
    left_out = tomllib.loads((root / "pyproject.toml").read_text())["tool"]["pytest"]["ini_options"]["norecursedirs"]
    makefile = (root / "Makefile").read_text()
    assert "$(ROOT)/tests $(PYTEST)" in makefile
    for folder in left_out:
        assert list((root / "tests" / folder).glob("test_*.py")) and f"$(ROOT)/tests/{folder}" in makefile, folder


@pytest.mark.parametrize(("first", "second", "expected"), [(0, 0, 0), (3, 0, 3), (0, 4, 4), (3, 4, 3)])
def test_two_commands_fail_if_one_does(first: int, second: int, expected: int) -> None:
    command = ["sh", str(TOOLS / "beside.sh"), f"sleep 0.2; echo first; exit {first}", f"echo second; exit {second}"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == expected, done.stderr
    assert done.stdout.split() == ["first", "second"]


@pytest.mark.compile
def test_an_example_that_does_not_compile_is_named(tmp_path: Path) -> None:
    """`tools/rustdoc.sh` runs examples, and names one that does not compile, with its file and line."""
    source = "/// ```\n/// let x: u8 = 1;\n/// ```\npub fn sound() {}\n\n/// ```\n/// let x: u8 = VALUE;\n/// ```\npub fn broken() {}\n"
    command = ["sh", str(TOOLS / "rustdoc.sh"), "--edition=2024", "--test", "lib.rs"]
    for value, fails in (("1", False), ("1.0", True)):
        (tmp_path / "lib.rs").write_text(source.replace("VALUE", value))
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
        named = "lib.rs - broken (line 6)" in done.stdout.partition("test result")[2] + done.stderr
        assert (done.returncode != 0, named) == (fails, fails), done.stdout + done.stderr
