"""`python tools/source_rules.py`: find too long files and functions, too full folders, and repeated lines, in the Rust and Python sources.

A file has at most 400 lines, not counting docstrings of stubs, which `tools/stub_docs.py` copies from Rust. A function has at most 80
lines without its docstring, unless a comment `Long: ..` directly above it gives the reason. A folder has at most 15 files, unless a
sentence `The folder is flat, because ..` in `mod.rs` or `__init__.py` gives the reason. No ten consecutive lines occur twice. The last
rule ignores blank lines and indentation, stubs, and the parameters of Python functions, in Python and in Rust. Parameters may repeat,
because a caller reads the whole list at its function.
"""

from __future__ import annotations

import ast
import re
import sys
from collections import Counter, defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FILE, FUNCTION, RUN, FOLDER = 400, 80, 10, 15
SUFFIXES = (".rs", ".py", ".pyi")
REASON = re.compile(r"^\s*(#|//) Long: \S")
#: Files whose documentation describes their folder, and the pattern of the sentence with a reason.
HEADS = ("mod.rs", "lib.rs", "main.rs", "__init__.py")
FLAT = re.compile(r"^(//! |# )?The folder is flat, because \S", re.MULTILINE)
#: Pattern of a parameter of a Python function that is written in Rust.
PARAMETER = re.compile(r"^\w+: (Option<)?&Bound<'(py|_), PyAny>>?,$")
#: Pattern of Rust comments and literals, whose braces do not count.
ASIDE = re.compile(r"""//[^\n]*|/\*.*?\*/|r(#*)".*?"\1|"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])'""", re.DOTALL)


def sources(*tops: Path) -> list[Path]:
    """All Rust and Python files in the folders `tops`."""
    found = [path for top in tops for path in sorted(top.rglob("*")) if path.suffix in SUFFIXES and "target" not in path.parts]
    return [path for path in found if path.is_file()]


def long_files(paths: list[Path], most: int = FILE) -> dict[Path, int]:
    """Files with more than `most` lines, and their numbers of lines."""
    lengths = {path: path.read_text(encoding="utf-8").count("\n") for path in paths}
    for path in lengths:
        if path.suffix == ".pyi":
            nodes = [
                node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.FunctionDef | ast.ClassDef)
            ]
            lengths[path] -= sum(docstring_lines(node) for node in nodes)
    return {path: lines for path, lines in lengths.items() if lines > most}


def full_folders(paths: list[Path], most: int = FOLDER) -> dict[Path, int]:
    """Folders with more than `most` files and without a reason, and their numbers of files."""
    counts = Counter(path.parent for path in paths if path.suffix != ".pyi")

    def says_why(folder: Path) -> bool:
        return any(FLAT.search(head.read_text(encoding="utf-8")) for head in map(folder.joinpath, HEADS) if head.is_file())

    return {folder: count for folder, count in counts.items() if count > most and not says_why(folder)}


def functions_of_python(source: str) -> list[tuple[str, int, int, int]]:
    """For each function: name, first line (that of a decorator), line of the name, both from 1, and length without docstring."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            first = min([node.lineno, *(each.lineno for each in node.decorator_list)])
            found.append((node.name, first, node.lineno, (node.end_lineno or 0) - node.lineno + 1 - docstring_lines(node)))
    return found


def docstring_lines(node: ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef) -> int:
    """The number of lines of a docstring."""
    text = node.body[0]
    return 0 if ast.get_docstring(node) is None else (text.end_lineno or 0) - text.lineno + 1


def functions_of_rust(source: str) -> list[tuple[str, int, int, int]]:
    """Return the values of `functions_of_python` for Rust.

    Here the first line and the line of the name are equal: attributes are ignored.
    """
    text = ASIDE.sub(lambda match: re.sub(r"[^\n]", " ", match.group()), source)
    found = []
    for match in re.finditer(r"\bfn\s+(\w+)", text):
        depth, opened, end = 0, False, match.end()
        for mark in re.compile(r"[][(){};]").finditer(text, match.end()):
            end = mark.end()
            opened = opened or mark.group() == "{"
            depth += (mark.group() in "([{") - (mark.group() in ")]}")
            if depth == 0 and mark.group() in ";}":
                break  # a declaration without a body, or the end of the body
        if not opened:
            continue
        line = text.count("\n", 0, match.start()) + 1
        found.append((match.group(1), line, line, text.count("\n", match.start(), end) + 1))
    return found


def long_functions(path: Path, most: int = FUNCTION) -> dict[str, int]:
    """Functions of a file that are too long and have no comment `Long: ..`: their lengths by `name:line`."""
    source = path.read_text(encoding="utf-8")
    lines = source.splitlines()

    def says_why(first: int) -> bool:
        above = first - 2
        while above >= 0 and re.match(r"\s*(#|//)", lines[above]):
            if REASON.match(lines[above]):
                return True
            above -= 1
        return False

    functions = functions_of_rust(source) if path.suffix == ".rs" else functions_of_python(source)
    return {f"{name}:{line}": length for name, first, line, length in functions if length > most and not says_why(first)}


def counted_lines(path: Path) -> list[tuple[int, str]]:
    """The lines of a file that count for the rule of repeated lines, with their numbers from 1."""
    source = path.read_text(encoding="utf-8")
    skipped: set[int] = set()
    if path.suffix == ".py":
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                skipped |= set(range(node.lineno, node.body[0].lineno))
    lines = [(k, line.strip()) for k, line in enumerate(source.splitlines(), 1) if line.strip() and k not in skipped]
    return [(k, line) for k, line in lines if path.suffix != ".rs" or not PARAMETER.match(line)]


def repeated(paths: list[Path], run: int = RUN) -> list[list[tuple[Path, int, int]]]:
    """Groups of places with the same text, which has at least `run` lines. A place is (file, first line from 1, number of lines)."""
    texts: dict[Path, list[tuple[int, str]]] = {}
    places: dict[tuple[str, ...], list[tuple[Path, int]]] = defaultdict(list)
    for path in paths:
        if path.suffix == ".pyi":
            continue
        texts[path] = kept = counted_lines(path)
        for i in range(len(kept) - run + 1):
            places[tuple(line for _, line in kept[i : i + run])].append((path, i))
    found: list[list[tuple[Path, int, int]]] = []
    done: set[tuple[Path, int]] = set()
    for group in places.values():
        if len(group) < 2 or any(place in done for place in group):
            continue
        length = run
        while len({texts[path][i + length][1] if i + length < len(texts[path]) else (path, i) for path, i in group}) == 1:
            length += 1
        done |= {(path, i + k) for path, i in group for k in range(length - run + 1)}
        found.append([(path, texts[path][i][0], length) for path, i in group])
    return found


def main() -> int:
    paths = sources(ROOT / "rust", ROOT / "python")
    faults = [f"{path.relative_to(ROOT)}: {lines} lines" for path, lines in long_files(paths).items()]
    faults += [f"{folder.relative_to(ROOT)}: {count} files" for folder, count in full_folders(paths).items()]
    faults += [f"{path.relative_to(ROOT)}: {name}: {lines} lines" for path in paths for name, lines in long_functions(path).items()]
    for group in repeated(paths):
        faults.append(f"{group[0][2]} equal lines: " + ", ".join(f"{path.relative_to(ROOT)}:{line}" for path, line, _ in group))
    print("\n".join(faults))
    return int(bool(faults))


if __name__ == "__main__":
    sys.exit(main())
