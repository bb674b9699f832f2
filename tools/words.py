"""`python tools/words.py`: find banned words and long sentences in pages, docstrings, Rust documentation and messages, and banned names
in definitions. A sentence is long with more than 25 words, or with more than 30 if a word such as "because" joins a reason.

`tools/words_allowed.toml` has a line `"file" = [long sentences, banned words]` for each file with faults. The check fails if a file has
more or fewer faults than allowed. `python tools/words.py --lower` lowers the numbers. `python tools/words.py FILE..` prints every fault
of these files.

A function, field, module, constant, class or argument has none of the names `NAMES`, because they do not state what it is or does.
`NAMES_ALLOWED` lists the exceptions.
"""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import TypeGuard

ROOT = Path(__file__).resolve().parents[1]
ALLOWED = Path("tools/words_allowed.toml")
LONGEST, LONGEST_WITH_REASON = 25, 30
#: Words that join a reason, a purpose or a contrast to a statement.
REASON = re.compile(r"\b(?:because|so that|while|although|since|which is why)\b", re.IGNORECASE)
#: Banned patterns (letter case is ignored), and the words that replace them.
BANNED = {
    r"all the same": "nevertheless, or the same",
    r"as it is(?= *[,.;])": "unchanged",
    r"ask(s|ed)?(?! for\b)": "require, command, or evaluate",
    r"ben(d|ds|t|ding)(?! over)": "limit, change, or curve",
    r"humps?": "maximum of gravity",
    r"of (its|their|one's) own": "separate, or name the thing",
    r"paces?": "step-size controller, or rate",
    r"rooms?": "memory, workspace, or package",
    r"say(s)? so": "report",
    r"sooner": "earlier, or faster",
    r"st(ands?|ood)(?! for\b)": "is",
    r"swing window": "search interval",
    r"the given": "name the argument",
    r"the house": "the project",
    r"t(ells?|old|elling)": "report, or distinguish",
    r"(two|three|both|other) ways": "methods",
    r"watch(es|ed|ing)?": "monitor",
    r"what is left": "the remainder, or name the thing",
    r"whatever": "for every",
}
#: Banned names of functions, fields, modules, constants, classes and arguments. Longer names may contain these words.
NAMES = "look stands again rest back beside kept fine spare whole keep touch forget".split()
#: Public names: folder or file, and name.
NAMES_ALLOWED = {
    ("python/armlet/run", "keep"),  # the argument of `simulate_batch`
    ("rust/core/src/simulate/batch", "keep"),  # the same argument
}
#: Patterns of a definition in Rust: an item, or a field or parameter. A lifetime, a parameter of a macro and a variable are no such names.
ITEM_OF_RUST = re.compile(rf"\b(?:fn|mod|const|static)\s+({'|'.join(NAMES)})\b", re.IGNORECASE)
FIELD_OF_RUST = re.compile(rf"(?<![$'\w])(?<!let )(?<!let mut )({'|'.join(NAMES)})\s*:(?!:)")
PATTERN = re.compile(r"\b(?:" + "|".join(f"(?:{word})" for word in BANNED) + r")\b", re.IGNORECASE)
# Code and formulas count as one word each.
CODE = re.compile(r"``[^`]+``|`[^`\n]+`|\$[^$\n]+\$|\{[^{}]*\}")
LINK = re.compile(r"!?\[([^]]*)\]\([^)]*\)")
# Starts of a list item, of a row or cell of a table, of an argument `name: ..`, and of the comment of a directive.
ITEM = re.compile(r"^\s*(?:[-*+] |\d+\. |#+ |\||(?:\w+(?:, \w+)*): |:\w+: )|^\s*(?:Args|Other Args|Returns|Raises|Warns|Yields):$|^```.*$")
# A line with columns separated by blanks, such as a formula or a table. Each column is a separate text.
COLUMNS = re.compile(r"\S {3,}\S")
SENTENCE = re.compile(r" {3,}|(?<=[.!?])[)\"*]*\s+(?=\S)(?<!e\.g\. )(?<!i\.e\. )(?<!cf\. )(?<!Eq\. )(?<!no\. )(?<!\.\. )|\|")
LITERAL = re.compile(r"""//[^\n]*|/\*.*?\*/|r(#*)"(?P<raw>.*?)"\1|"(?P<text>(?:\\.|[^"\\])*)"|'(?:\\.|[^'\\])'""", re.DOTALL)
# Pattern of a literal that is code: statements of C or CMake, or elements of XML.
TEMPLATE = re.compile(r"[;)](?:\n|\\n)|</\w+>")


def sentences(prose: str) -> Iterator[str]:
    """The sentences of `prose`, without code blocks, indented formulas and doctests."""
    prose = re.sub(r"^```(?!\{).*?^```$", "", prose, flags=re.MULTILINE | re.DOTALL)
    piece: list[str] = []
    after_blank, item = True, False
    for line in [*prose.splitlines(), ""]:
        formula = line.startswith("    ") and after_blank and not item
        starts = bool(ITEM.match(line) or COLUMNS.search(line))
        if starts or formula or not line.strip() or line.lstrip().startswith((">>>", "...")):
            text = CODE.sub(" x ", LINK.sub(r"\1", " ".join(piece)))
            yield from (sentence.strip() for sentence in SENTENCE.split(text) if sentence.strip())
            piece = []
        if line.strip() and not formula and not line.lstrip().startswith((">>>", "...")):
            piece.append((ITEM.sub("", line) if not line.lstrip().startswith("|") else line).strip())
        item = starts or (item and line.startswith("  "))
        after_blank = not line.strip() or formula


def texts(path: Path) -> Iterator[str]:
    """The texts of a file for its readers: the whole page, or the documentation and messages in code."""
    source = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        yield source
    elif path.suffix == ".rs":
        yield from (
            re.sub(r"^\s*//[/!] ?", "", block, flags=re.MULTILINE) for block in re.findall(r"(?:^\s*//[/!].*\n)+", source, re.MULTILINE)
        )
        for match in LITERAL.finditer(source):
            text = re.sub(r"\\\n\s*", "", match["text"] or match["raw"] or "")
            yield "" if TEMPLATE.search(text) else text
    else:
        tree = ast.parse(source)
        formatted = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
        documents = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and ast.get_docstring(node):
                documents.add(id(node.body[0].value))
                yield ast.get_docstring(node) or ""
        for node in ast.walk(tree):
            if isinstance(node, ast.JoinedStr):
                yield "".join(str(part.value) if isinstance(part, ast.Constant) else " x " for part in node.values)
            elif isinstance(node, ast.Constant) and isinstance(node.value, str) and not {id(node)} & (formatted | documents):
                yield node.value


def faults(path: Path) -> tuple[list[str], list[str]]:
    """The sentences of a file that are too long, and its banned words with their sentences."""
    found = [sentence for text in texts(path) for sentence in sentences(text)]
    long = [s for s in found if sum(bool(re.search(r"[^\W_]", word)) for word in s.split()) > _longest(s)]
    return long, [f"{match.group()}: {s}" for s in found for match in PATTERN.finditer(s)]


def _longest(sentence: str) -> int:
    return LONGEST_WITH_REASON if REASON.search(sentence) else LONGEST


def names(path: Path) -> list[str]:
    """The banned names that a file defines."""
    source = path.read_text(encoding="utf-8")
    found = [path.stem]
    if path.suffix == ".rs":
        code = LITERAL.sub(" ", source)
        found += [match[1] for pattern in (ITEM_OF_RUST, FIELD_OF_RUST) for match in pattern.finditer(code)]
    else:
        tree = ast.parse(source)
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                found.append(node.name)
            elif isinstance(node, ast.arg):
                found.append(node.arg)
            elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
                found.append(node.attr)
            if isinstance(node, ast.Module | ast.ClassDef):
                found += [each.id for part in node.body for each in ast.walk(part) if _is_target(part, each)]
    return [name for name in found if name.lower() in NAMES]


def _is_target(statement: ast.stmt, node: ast.AST) -> TypeGuard[ast.Name]:
    """Whether `node` is a name to which an assignment, `statement`, assigns."""
    return isinstance(statement, ast.Assign | ast.AnnAssign) and isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)


def banned_names(root: Path) -> list[str]:
    """The banned names in the sources of both languages, with their files."""
    paths = [*(root / "rust").rglob("*.rs"), *(root / "python/armlet").rglob("*.py"), *(root / "tools").rglob("*.py")]
    found = {path.relative_to(root).as_posix(): names(path) for path in sorted(paths) if "target" not in path.parts}

    def allowed(file: str, name: str) -> bool:
        return any(file.startswith(place) and name == each for place, each in NAMES_ALLOWED)

    return [f"{file}: {name} is a banned name" for file, given in found.items() for name in given if not allowed(file, name)]


def read(root: Path) -> dict[str, tuple[int, int]]:
    """The number of long sentences and of banned words in each file that has any."""
    names = ("README", "CONTRIBUTING", "CHANGELOG", "RELEASING", "SECURITY", "benches/README", "examples/README")
    paths = [*(root / f"{name}.md" for name in names), *(root / "docs").rglob("*.md")]
    paths += [
        *(root / "python/armlet").rglob("*.py"),
        *(path for top in ("core", "py", "macros") for path in (root / "rust" / top / "src").rglob("*.rs")),
    ]
    counts = {path.relative_to(root).as_posix(): faults(path) for path in sorted(paths) if path.exists()}
    return {name: (len(long), len(banned)) for name, (long, banned) in counts.items() if long or banned}


def main(arguments: list[str], root: Path = ROOT) -> int:
    if arguments and arguments != ["--lower"]:
        for name in arguments:
            long, banned = faults(Path(name))
            print("\n".join([*(f"{name}: long: {each}" for each in long), *(f"{name}: banned: {each}" for each in banned)]))
        return 0
    allowed = {name: tuple(numbers) for name, numbers in tomllib.loads((root / ALLOWED).read_text(encoding="utf-8")).items()}
    found = read(root)
    wrong = banned_names(root)
    print(*wrong, sep="\n", end="\n" if wrong else "")
    over = {name: found[name] for name in found if any(a > b for a, b in zip(found[name], allowed.get(name, (0, 0)), strict=True))}
    under = [name for name in allowed if any(a < b for a, b in zip(found.get(name, (0, 0)), allowed[name], strict=True))]
    for name, numbers in over.items():
        print(f"{name}: {numbers} long sentences and banned words, {allowed.get(name, (0, 0))} allowed, see `python tools/words.py {name}`")
    if arguments:
        kept = {name: [min(a, b) for a, b in zip(found.get(name, (0, 0)), allowed[name], strict=True)] for name in allowed}
        (root / ALLOWED).write_text("".join(f'"{name}" = {kept[name]}\n' for name in sorted(kept) if any(kept[name])), encoding="utf-8")
    elif under:
        print(f"{ALLOWED} allows more than is found: `python tools/words.py --lower` lowers it for {', '.join(under)}")
    return int(bool(over) or bool(wrong) or (bool(under) and not arguments))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
