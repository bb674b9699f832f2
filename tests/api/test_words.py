"""`tools/words.py` counts long sentences and banned words, and its allowances only shrink. `make check` runs it on the sources."""

from __future__ import annotations

from pathlib import Path

import pytest
from scripts import imported

ROOT = Path(__file__).resolve().parents[2]


WORDS = imported(ROOT / "tools" / "words.py")
LONG = "word " * 25 + "end."
SHORT = "word " * 24 + "end."


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("a.md", f"{SHORT} {SHORT}\n", (0, 0)),
        ("a.md", f"{LONG}\n", (1, 0)),
        ("a.md", f"It is so because {LONG}\n", (0, 0)),
        ("a.md", f"It is so because of a very {LONG}\n", (1, 0)),
        ("a.md", f"{LONG[:60]}\n{LONG[60:]} {SHORT}\n", (1, 0)),
        ("a.md", f"- {SHORT[:-1]}\n- {SHORT}\n", (0, 0)),
        ("a.md", f"- {SHORT[:-1]}\n  {SHORT}\n", (1, 0)),
        ("a.md", f"| {SHORT} | {SHORT} |\n", (0, 0)),
        ("a.md", f"| {LONG} | short |\n", (1, 0)),
        ("a.md", f"```python\n{LONG} told\n```\n\n    {LONG} told\n", (0, 0)),
        ("a.md", f"Code `{LONG}` and a [link]({LONG}) are one word each.\n", (0, 0)),
        ("a.md", "The pace is told; the space is not. Task 2 asks for nothing.\n", (0, 2)),
        ("a.md", "Nothing is wrong with `ways` and `pace`.\n", (0, 0)),
        ("a.py", f'"""{LONG}"""\n\n\ndef f():\n    """All the same."""\n    raise ValueError(f"{{f}} was told {SHORT}")\n', (2, 2)),
        ("a.py", f'"""Sum.\n\na = b    {SHORT}\nbb = c   {SHORT}\n"""\n', (0, 0)),
        ("a.py", f'"""Sum.\n\nArgs:\n    x: {SHORT}\n    y: {SHORT}\n\n>>> {LONG}\n"""\n', (0, 0)),
        ("a.rs", f'//! {LONG}\n\n/// Told.\nfn f() {{\n    // {LONG}\n    let a = "{SHORT} \\\n        word";\n}}\n', (1, 1)),
        ("a.rs", f'let c = "    double q;\n    {LONG}";\nlet xml = "<a>{LONG}</a>";\nlet text = "{LONG}";\n', (1, 0)),
    ],
)
def test_faults_are_detected(name: str, text: str, expected: tuple[int, int], tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    assert tuple(map(len, WORDS.faults(tmp_path / name))) == expected


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("a.rs", "pub fn look(&self) {}\n", ["look"]),
        ("a.rs", "struct A {\n    pub kept: f64, // whole: 1\n}\n", ["kept"]),
        ("a.rs", "fn f(back: &mut [f64], keep_alive: bool) {}\nconst SPARE: u8 = 1;\nmod rest;\n", ["SPARE", "rest", "back"]),
        ("a.rs", 'fn f() {\n    let rest: u8 = 1;\n    \'back: loop {}\n    let a = "fn look keep: ";\n    rest::f();\n}\n', []),
        ("rest.rs", "", ["rest"]),
        ("a.py", "def forget(self, whole=1):\n    self.kept = rest = whole\n", ["forget", "whole", "kept"]),
        ("a.py", "FINE = 1\n\n\nclass A:\n    again: int\n\n    def f(self):\n        rest = 2\n", ["FINE", "again"]),
    ],
)
def test_banned_names_are_detected(name: str, text: str, expected: list[str], tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    assert sorted(WORDS.names(tmp_path / name)) == sorted(expected)


def test_a_banned_name_fails_the_check(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "tools").mkdir()
    (tmp_path / WORDS.ALLOWED).write_text("")
    for folder in ("python/armlet/run", "python/armlet"):
        (tmp_path / folder).mkdir(parents=True, exist_ok=True)
        (tmp_path / folder / "a.py").write_text("def f(keep):\n    return keep\n")
    assert WORDS.main([], tmp_path) == 1
    assert capsys.readouterr().out == "python/armlet/a.py: keep is a banned name\n"


def test_allowances_only_shrink(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "tools").mkdir()
    (tmp_path / "README.md").write_text(f"{LONG} We were told.\n")
    allowed = tmp_path / WORDS.ALLOWED
    allowed.write_text("")
    assert WORDS.main([], tmp_path) == 1 and "README.md: (1, 1) long" in capsys.readouterr().out
    assert WORDS.main(["--lower"], tmp_path) == 1 and allowed.read_text() == ""  # `--lower` never raises an allowance
    allowed.write_text('"README.md" = [1, 1]\n')
    assert WORDS.main([], tmp_path) == 0
    allowed.write_text('"README.md" = [2, 1]\n"gone.md" = [1, 0]\n')
    assert WORDS.main([], tmp_path) == 1 and "for README.md, gone.md" in capsys.readouterr().out
    assert WORDS.main(["--lower"], tmp_path) == 0 and allowed.read_text() == '"README.md" = [1, 1]\n'
