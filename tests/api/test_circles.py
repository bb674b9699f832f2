"""Dependency cycles between the modules of one folder, in the Rust core and in the extension.

A module depends on the module that defines an item, not on a module that only exports it. The modules of a folder include `mod`, the
folder's own file. In the extension, the top-level modules form a folder too. `test_layering.py` has the rules for the top-level modules of
the core. Code for tests is excluded.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from test_layering import BINDING, CORE, items_of, sources, without_comments

# Known cycles in the core, each with its folder and its modules. The test fails if an entry is not a cycle.
ALLOWED = {
    # The constructor `TaskFunction::axis` is in the file of its kind, and returns the enum of all kinds.
    "kinematics/task: axis -> mod",
    "kinematics/task: centre_of_mass -> mod",
    "kinematics/task: distance -> mod",
    "kinematics/task: frame -> mod -> relative",
    "kinematics/task: interval -> mod",
    "kinematics/task: joint_limits -> mod",
    "kinematics/task: joint_limits -> posture -> mod",
    "kinematics/task: mod -> posture",
    "kinematics/task: mod -> relative",
    # A guarded law contains a law of any kind.
    "law: guarded -> mod",
    # The default method `Real::atan2` calls a function that is generic over `Real`.
    "scalar: atan -> mod",
}

Module = tuple[str, ...]

OWN = "mod"
VISIBLE = r"(?:pub(?:\([^)]*\))?\s+)?"
TEST = r"#\[(?:cfg\((?:all\()?test\b[^\]]*|test)\]"
TEST_MODULE = re.compile(rf"{TEST}\s*(?:#\[[^\]]*\]\s*)*{VISIBLE}mod\s+(\w+)\s*;")
MODULE = re.compile(rf"\b{VISIBLE}mod\s+\w+\s*;")
USE = re.compile(rf"\b{VISIBLE}use\s+([^;]+);")
ITEM = re.compile(r"(?<!')\b(?:fn|struct|enum|union|trait|type|const|static|macro_rules!)\s+([A-Za-z_]\w*)")
TYPE = re.compile(r"\b(?:struct|enum|trait)\s+(\w+)")
PATH = re.compile(r"(?<![\w:.'])[A-Za-z_]\w*(?:\s*::\s*[A-Za-z_]\w*)*")


@dataclass
class Source:
    """One module: its own items, the paths that it imports by local name or with `*`, and the paths in its code."""

    items: set[str]
    names: dict[str, Module]
    globs: list[Module]
    paths: set[Module]


def blanked(text: str, start: int, end: int) -> str:
    return text[:start] + re.sub(r"[^\n]", " ", text[start:end]) + text[end:]


def end_of_item(text: str, start: int) -> int:
    """The end of the item at `start`: after its closing brace or its semicolon."""
    depth = 0
    for mark in re.compile(r"[][(){};]").finditer(text, start):
        depth += (mark.group() in "([{") - (mark.group() in ")]}")
        if depth == 0 and mark.group() in "};":
            return mark.end()
    return len(text)


def leaves(tree: str) -> list[Module]:
    """The paths of `use tree`, each followed by its local name.

    For example, `a::{b, c as d}` contains `a::b` with the name `b`, and `a::c` with the name `d`.
    """
    head, brace, rest = tree.strip().partition("{")
    if not brace:
        path, _, alias = (part.strip() for part in head.partition(" as "))
        parts = tuple(path.split("::"))
        parts = parts[:-1] if parts[-1] == "self" and len(parts) > 1 else parts
        return [(*parts, alias or parts[-1])]
    return [leaf for each in items_of(rest) if each.strip() for leaf in leaves(head + each.strip())]


def outside_braces(text: str) -> str:
    depth, kept = 0, []
    for character in text:
        depth -= character == "}"
        kept.append(character if depth == 0 else " ")
        depth += character == "{"
    return "".join(kept)


def read(source: str) -> Source:
    text = re.sub(r"b?'(?:\\[^']+|[^'\\])'", " ", without_comments(source))
    while found := re.search(TEST, text):
        text = blanked(text, found.start(), end_of_item(text, found.end()))
    names, globs = {}, []
    for match in USE.finditer(text):
        for *path, name in leaves(match.group(1)):
            if name == "*":
                globs.append(tuple(path[:-1]))
            else:
                names[name] = tuple(path)
        text = blanked(text, match.start(), match.end())
    text = MODULE.sub(" ", text)
    items = set(ITEM.findall(outside_braces(text)))
    # Types can also be declared in a macro of this file.
    for match in re.finditer(r"\bmacro_rules!", text):
        items |= set(TYPE.findall(text[match.end() : end_of_item(text, match.end())]))
    return Source(items, names, globs, {tuple(re.split(r"\s*::\s*", path)) for path in PATH.findall(text)})


def modules(top: Path) -> dict[Module, Source]:
    """The modules of the sources in `top`, without the ones for tests."""
    files, for_tests = {}, set()
    for path in sources(top, "*.rs"):
        parts = path.relative_to(top).with_suffix("").parts
        at, text = parts[:-1] if parts[-1] in ("mod", "lib") else parts, path.read_text(encoding="utf-8")
        files[at] = read(text)
        for_tests |= {(*at, name) for name in TEST_MODULE.findall(without_comments(text))}
    return {at: source for at, source in files.items() if not any(at[: len(name)] == name for name in for_tests)}


def definition(
    files: dict[Module, Source], at: Module, path: Module, seen: frozenset[tuple[Module, Module]] = frozenset()
) -> tuple[Module, str | None] | None:
    """The module and the name of the item that `path` means in the code of the module `at`.

    The name is None if `path` is a module. The result is None if these sources do not define the path.
    """
    first, rest = path[0], path[1:]
    for step, target in (("crate", ()), ("self", at), ("super", at[:-1])):
        if first == step:
            return definition(files, target, rest, seen) if rest else (target, None)
    if rest and (*at, first) in files:
        return definition(files, (*at, first), rest, seen)
    if (at, path) in seen:
        return None
    seen |= {(at, path)}
    here = files[at]
    if first in here.items:
        return at, first
    if first in here.names:
        whole = here.names[first]
        # In `use x::x`, the first x is a module or another crate.
        return definition(files, at, (*whole, *rest), seen) if whole[0] != first or (*at, first) in files else None
    for glob in here.globs:
        home = definition(files, at, glob, seen)
        if home is not None and home[1] is None and (inside := definition(files, home[0], path, seen)) is not None:
            return inside
    return ((*at, first), None) if (*at, first) in files else None


def uses(files: dict[Module, Source]) -> dict[Module, dict[str, set[str]]]:
    """For each folder: its modules, and the modules of this folder whose items they use."""
    found: dict[Module, dict[str, set[str]]] = {}
    folders = {at[:-1] for at in files if at}
    for at, source in files.items():
        # Imports of a folder's own file do not count, because it may import an item only to export it.
        for path in source.paths if at in folders else source.paths | {*source.names.values()}:
            home, item = definition(files, at, path) or (at, None)
            if item is None or home == at:
                continue
            common = next((k for k, (one, other) in enumerate(zip(at, home, strict=False)) if one != other), min(len(at), len(home)))
            user, used = ((*module, OWN)[common] for module in (at, home))
            found.setdefault(at[:common], {}).setdefault(user, set()).add(used)
    return found


def shortest_path(needs: Mapping[str, Collection[str]], start: str, end: str) -> tuple[str, ...]:
    """A shortest list of modules from `start` to `end` in which each module uses the next one. Empty if there is none."""
    paths, seen = [(start,)], {start}
    for path in paths:
        if path[-1] == end:
            return path
        fresh = sorted(set(needs.get(path[-1], ())) - seen)
        seen |= set(fresh)
        paths += [(*path, name) for name in fresh]
    return ()


def circles(top: Path, with_top: bool = False) -> set[str]:
    """A shortest cycle through each dependency that is part of a cycle, as a text with the folder and the modules.

    Cycles between the modules of the folder `top` itself are included only if `with_top` is true.
    """
    found = set()
    for folder, needs in uses(modules(top)).items():
        for user, used in [(user, used) for user, all_used in needs.items() for used in all_used]:
            if (folder or with_top) and (circle := shortest_path(needs, used, user)):
                first = circle.index(min(circle))
                found.add(f"{'/'.join(folder) or 'src'}: {' -> '.join(circle[first:] + circle[:first])}")
    return found


def test_no_module_of_a_folder_uses_another_in_a_circle() -> None:
    found = circles(CORE)
    assert found - ALLOWED == set()
    assert ALLOWED - found == set()


def test_no_module_of_the_extension_uses_another_in_a_circle() -> None:
    assert circles(BINDING, with_top=True) == set()


def test_circle_rule_sees_planted_violations(tmp_path: Path) -> None:
    files = {
        "lib.rs": "mod a;\nmod b;\n",
        "b.rs": "use crate::a::own;\npub fn top() {}\n",
        "a/mod.rs": "mod one;\npub use one::First;\nmod three;\npub fn own() {\n    three::third();\n    crate::b::top()\n}\n"
        "macro_rules! kinds { ($kind:ident) => { pub enum Kind { Each($kind) } } }\nuse ten::Ten;\nkinds! { Ten }\n"
        "pub use eleven::*;\npub fn text(_: &str) {}\n",
        # Two files, one of which uses an export of the other; and a file that uses an item of its folder's mod.rs.
        "a/one.rs": "use super::two::second;\npub struct First;\n",
        "a/two.rs": "pub fn second(_: super::First) {}\n",
        "a/three.rs": "use super::{own as whole};\npub fn third() { whole() }\n",
        # A longer cycle. The second `use` imports all names.
        "a/four.rs": "use super::five::{self, fifth};\npub fn fourth() {}\n",
        "a/five.rs": "use super::six::*;\npub fn fifth() { sixth() }\n",
        "a/six.rs": "pub fn sixth() { crate::a::four::fourth() }\n",
        # No cycle: tests, comments, and text.
        "a/seven.rs": '// super::eight::eighth\npub fn seventh() { f("super::eight::eighth") }\n'
        "#[cfg(test)]\nmod tests {\n    use super::super::eight::eighth;\n}\n#[cfg(test)]\nmod more;\n",
        "a/seven/more.rs": "use crate::a::eight::eighth;\n",
        "a/eight.rs": "use super::seven::seventh;\npub fn eighth() {}\n",
        # A file of a folder uses a module beside the folder.
        "a/deep/mod.rs": "mod inner;\npub struct Deep;\n",
        "a/deep/inner.rs": "use super::super::nine::Ninth;\n",
        "a/nine.rs": "pub struct Ninth(super::deep::Deep);\n",
        # A type that a macro declares.
        "a/ten.rs": "use super::Kind;\npub struct Ten;\n",
        # No cycle: `str` after the lifetime is not an item of this module.
        "a/eleven.rs": "pub fn eleventh(_: &'static str) { super::own() }\n",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    inner = {"a: one -> two", "a: mod -> three", "a: five -> six -> four", "a: deep -> nine", "a: mod -> ten"}
    assert circles(tmp_path) == inner
    assert circles(tmp_path, with_top=True) == inner | {"src: a -> b"}
