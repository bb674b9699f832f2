"""`python tools/stub_docs.py`: write the docstrings of the built extension `armlet._core` into its stubs, where editors find them.

The docstrings come from the Rust sources, and the stubs have no other ones. `--check` lists the stubs that differ, and writes nothing.
Names with a leading underscore have no docstring. A property without a docstring takes its line of the list in the docstring of its
class, such as ``- `kp`, `kd`: gains, (n,).``.
"""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
STUBS = ROOT / "python/armlet/_core"
FIELD = re.compile(r"^- ((?:`\w+`(?:, | and )?)+)[^:`]*: (.*?)(?=\n- |\n\n|\Z)", re.MULTILINE | re.DOTALL)
#: A change of a source: line and column of its start and of its end (lines from 0), and the new text.
Edit = tuple[tuple[int, int], tuple[int, int], str]


def fields(text: str) -> dict[str, str]:
    """The descriptions of fields in the list of a class's docstring. Entries with a semicolon may describe a second field."""
    found = {}
    for names, description in FIELD.findall(text):
        line = " ".join(description.split())
        for name in re.findall(r"`(\w+)`", names):
            found[name] = line[0].upper() + line[1:].split("; `")[0].rstrip(".") + "."
    return found


def text_of(thing: Any) -> str:
    """The docstring of an object of the extension, without indentation."""
    made = None if thing is None else thing.__doc__
    return inspect.cleandoc(made) if isinstance(made, str) else ""


def literal(text: str, indent: int) -> str:
    """A docstring as source, indented."""
    body = text.replace('"""', r"\"\"\"")
    lines = body.split("\n")
    raw = "r" if "\\" in body else ""
    if len(lines) == 1 and not body.endswith('"'):
        return f'{raw}"""{body}"""'
    return "\n".join([f'{raw}"""{lines[0]}', *(" " * indent + line if line else "" for line in lines[1:]), " " * indent + '"""'])


def edits(tree: ast.Module, module: ModuleType) -> Iterator[Edit]:
    """The changes of a stub that has no docstrings."""
    for node in tree.body:
        if not isinstance(node, ast.FunctionDef | ast.ClassDef) or node.name.startswith("_"):
            continue
        thing = getattr(module, node.name)
        text = text_of(thing)
        if isinstance(node, ast.FunctionDef):
            yield from of_function(node, text)
            continue
        if text:
            first = node.body[0]
            start = (min([first.lineno, *(each.lineno for each in getattr(first, "decorator_list", []))]) - 1, node.col_offset + 4)
            yield start, start, literal(text, start[1]) + "\n" + " " * start[1]
        listed = fields(text)
        for member in node.body:
            if isinstance(member, ast.FunctionDef) and not member.name.startswith("_") and not is_setter(member):
                own = text_of(member_of(thing, member.name))
                yield from of_function(member, own or listed.get(member.name, ""))


def member_of(kind: Any, name: str) -> Any:
    """A method or a property of a class, and not its value."""
    found = inspect.getattr_static(kind, name, None)
    return found.__func__ if isinstance(found, staticmethod | classmethod) else found


def is_setter(node: ast.FunctionDef) -> bool:
    return any(isinstance(each, ast.Attribute) and each.attr == "setter" for each in node.decorator_list)


def of_function(node: ast.FunctionDef, text: str) -> Iterator[Edit]:
    """Replace the body `...` by a docstring."""
    body = node.body[0]
    if text:
        indent = node.col_offset + 4
        start, end = (body.lineno - 1, body.col_offset), ((body.end_lineno or 0) - 1, body.end_col_offset or 0)
        yield start, end, "\n" + " " * indent + literal(text, indent)


def without(source: str) -> str:
    """A stub without the docstrings of its functions and classes."""
    changes: list[Edit] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and ast.get_docstring(node, clean=False) is not None:
            text = node.body[0]
            only = len(node.body) == 1
            changes.append(((text.lineno - 1, text.col_offset), ((text.end_lineno or 0) - 1, text.end_col_offset or 0), "..." * only))
    return changed(source, changes)


def changed(source: str, changes: list[Edit]) -> str:
    """Apply the changes from the last to the first, so that positions remain valid. Columns of `ast` are those of UTF-8."""
    lines = [line.encode() for line in source.split("\n")]
    for (row, column), (last, end), text in sorted(changes, reverse=True):
        lines[row : last + 1] = [*(lines[row][:column] + text.encode() + lines[last][end:]).split(b"\n")]
    return b"\n".join(lines).decode()


def formatted(source: str, name: str) -> str:
    command = [sys.executable, "-m", "ruff", "format", "--no-cache", "--stdin-filename", name, "-"]
    return subprocess.run(command, input=source, capture_output=True, text=True, check=True, cwd=ROOT).stdout


def documented(source: str, module: ModuleType, name: str) -> str:
    """A stub with the docstrings of the extension in the place of its own."""
    bare = formatted(without(source), name)
    return formatted(changed(bare, list(edits(ast.parse(bare), module))), name)


def stale(module: ModuleType, folder: Path = STUBS) -> dict[Path, str]:
    """The stubs whose docstrings are not those of the extension, and their new texts."""
    new = {path: documented(path.read_text(encoding="utf-8"), module, path.name) for path in sorted(folder.glob("*.pyi"))}
    return {path: text for path, text in new.items() if text != path.read_text(encoding="utf-8")}


def main(arguments: list[str]) -> int:
    import armlet._core

    found = stale(armlet._core)
    if arguments == ["--check"]:
        print("\n".join(f"{path.relative_to(ROOT)}: its docstrings are not those of the extension" for path in found))
        return int(bool(found))
    for path, text in found.items():
        path.write_text(text, encoding="utf-8")
        print(path.relative_to(ROOT))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
