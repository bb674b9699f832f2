"""Rules about imports between modules, checked in the sources.

CONTRIBUTING.md has the table of allowed imports. Each rule is also tested with a deliberate violation, so that a rule cannot become
ineffective unnoticed.
"""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CORE = ROOT / "rust" / "core" / "src"
BINDING = ROOT / "rust" / "py" / "src"
PACKAGE = ROOT / "python" / "armlet"

LINES = 400

# Modules that each module of the core may use directly. `allowed` adds indirect ones.
BELOW = {
    "error": {"status", "interrupt"},
    "interrupt": set(),
    "memory": {"error"},
    "parallel": {"error"},
    "status": set(),
    "scalar": {"memory", "status"},
    "trace": {"scalar"},
    "linalg": {"scalar"},
    "spatial": {"linalg"},
    "arm": {"spatial"},
    "kinematics": {"arm"},
    "dynamics": {"kinematics", "trace"},
    "plant": {"dynamics"},
    "priority": {"linalg", "trace"},
    "motion": {"scalar"},
    "law": {"plant", "priority", "motion"},
    "plan": {"motion", "dynamics"},
    "integrate": {"linalg"},
    "analysis": {"law", "integrate", "parallel"},
    "simulate": {"law", "integrate", "parallel"},
}


def allowed() -> dict[str, set[str]]:
    """The transitive closure of BELOW: a module may use everything that its allowed modules may use."""

    def under(module: str) -> set[str]:
        return BELOW[module].union(*(under(below) for below in BELOW[module]))

    return {module: under(module) for module in BELOW}


def without_comments(source: str) -> str:
    """Rust source without comments and string literals. Line breaks are kept."""

    def blank(match: re.Match[str]) -> str:
        return re.sub(r"[^\n]", " ", match.group())

    return re.sub(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\])*"', blank, source, flags=re.DOTALL)


def items_of(text: str) -> list[str]:
    """The items of a list in braces. `text` starts after the opening brace."""
    depth, item, items = 1, "", []
    for character in text:
        depth += (character == "{") - (character == "}")
        if depth == 0:
            break
        if character == "," and depth == 1:
            items.append(item)
            item = ""
        else:
            item += character
    return [*items, item]


def uses(source: str) -> set[str]:
    """The top-level modules that a Rust source names, as `crate::x` or `use crate::{x, y::z}`."""
    text = without_comments(source)
    found = set(re.findall(r"\bcrate::([a-z_]\w*)", text))
    for start in re.finditer(r"\bcrate::\{", text):
        found |= {name.group(1) for item in items_of(text[start.end() :]) if (name := re.match(r"\s*([a-z_]\w*)", item))}
    return found


def module_of(path: Path) -> str:
    """The top-level module of the core to which a file belongs."""
    return path.relative_to(CORE).parts[0].removesuffix(".rs")


def strays(module: str, source: str) -> set[str]:
    """Modules that `source`, a file of `module`, uses although they are not allowed."""
    return uses(source) - allowed()[module] - {module}


def imports(source: str) -> set[str]:
    """Top-level packages that a Python file imports. A relative import has the form `.` plus the module."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {f"{'.' * node.level}{node.module or ''}"} if node.level else {(node.module or "").split(".")[0]}
    return found


def sources(top: Path, pattern: str) -> list[Path]:
    found = sorted(top.rglob(pattern))
    assert found, f"nothing to check: no {pattern} in {top}"
    return found


def test_core_modules_are_in_the_table() -> None:
    """Every top-level module is in the table."""
    assert {module_of(p) for p in sources(CORE, "*.rs")} - {"lib"} <= set(BELOW)


def test_core_layers() -> None:
    wrong = {str(p.relative_to(ROOT)): strays(module_of(p), p.read_text()) for p in sources(CORE, "*.rs") if p.name != "lib.rs"}
    assert {path: names for path, names in wrong.items() if names} == {}


@pytest.mark.parametrize(
    ("module", "source", "expected"),
    [
        ("linalg", "use crate::arm::Tree;", {"arm"}),
        ("integrate", "use crate::{error::Result, law::{Law, adaptive}, scalar};", {"law"}),
        ("priority", "fn f() { crate::dynamics::rnea::go() }", {"dynamics"}),
        ("plan", "use crate::{\n    motion::Motion,\n    simulate,\n};", {"simulate"}),
        ("dynamics", "pub(crate) use crate::plant;", {"plant"}),
        ("law", "// crate::simulate\nuse crate::motion::Motion;", set()),
        ("analysis", "use crate::simulate::run;", {"simulate"}),
    ],
)
def test_layer_rule_sees_planted_violations(module: str, source: str, expected: set[str]) -> None:
    assert strays(module, source) == expected


def test_core_knows_no_python() -> None:
    named = [p for p in sources(CORE, "*.rs") if re.search(r"\b(pyo3|numpy)\b", without_comments(p.read_text()))]
    manifest = (ROOT / "rust" / "core" / "Cargo.toml").read_text()
    assert named == []
    assert re.search(r"^\s*(pyo3|numpy|armlet-py)\b", manifest, re.MULTILINE) is None


def imported(package: Path) -> dict[str, set[str]]:
    """For each module of a package, the modules that it imports: at the top, inside functions, or only for types.

    Imports of the extension `_core` do not count.
    """
    files = {path.relative_to(package.parent).with_suffix("").parts: path for path in sources(package, "*.py")}
    names = {".".join(parts[:-1] if parts[-1] == "__init__" else parts): path for parts, path in files.items()}
    found: dict[str, set[str]] = {name: set() for name in names}
    for name, path in names.items():
        home = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found[name] |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                start = home[: len(home) + 1 - node.level] if node.level else []
                module = ".".join([*start, *([node.module] if node.module else [])])
                whole = {alias.name: f"{module}.{alias.name}" for alias in node.names}
                # `from . import x` imports the module x if it exists, otherwise a name of the package.
                found[name] |= {full if full in names else module for alias, full in whole.items() if alias != "_core"}
    return {name: (modules & set(names)) - {name} for name, modules in found.items()}


def circles(package: Path) -> list[tuple[str, ...]]:
    """Groups of modules that import each other in a cycle."""
    needs = imported(package)

    def under(name: str) -> set[str]:
        seen, left = set(), [name]
        while left:
            fresh = needs[left.pop()] - seen
            seen |= fresh
            left += fresh
        return seen

    below = {name: under(name) for name in needs}
    return sorted({tuple(sorted(other for other in below[name] if name in below[other])) for name in needs if name in below[name]})


def test_no_module_of_python_imports_in_a_circle() -> None:
    assert circles(PACKAGE) == []


def test_circle_rule_sees_planted_violations(tmp_path: Path) -> None:
    files = {
        "__init__.py": "from .a import x",
        "a.py": "from .b import y",
        "b.py": "def f():\n    from . import a",
        "c.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from .d.e import z",
        "d/__init__.py": "from .e import z",
        "d/e.py": "from ..c import w\nfrom .. import _core",
        "f.py": "from . import b, c",
    }
    for name, text in files.items():
        (tmp_path / "house" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "house" / name).write_text(text)
    assert circles(tmp_path / "house") == [("house.a", "house.b"), ("house.c", "house.d.e")]


def unsafe_files(top: Path) -> list[Path]:
    """Files with `unsafe` code. The lint name unsafe_op_in_unsafe_fn and comments do not count."""
    return [p for p in sources(top, "*.rs") if re.search(r"\bunsafe\b", without_comments(p.read_text()))]


def test_unsafe_code_is_only_in_two_modules() -> None:
    outside = [p for p in unsafe_files(CORE) if module_of(p) not in ("scalar", "trace")]
    assert outside == []
    assert len(unsafe_files(BINDING)) <= 1, unsafe_files(BINDING)


def test_unsafe_rule_sees_planted_violation(tmp_path: Path) -> None:
    (tmp_path / "a.rs").write_text('// unsafe\nlet s = "unsafe";\n')
    (tmp_path / "b.rs").write_text("fn f(p: *const f64) -> f64 { unsafe { *p } }\n")
    assert unsafe_files(tmp_path) == [tmp_path / "b.rs"]


def never_tested(top: Path) -> list[str]:
    """Files with unit tests that are never built, because their module is under `#[cfg(not(test))]`."""
    left_out = r"#\[cfg\(not\(test\)\)\]\s*(?:#\[[^\]]*\]\s*)*(?:pub(?:\([^)]*\))?\s+)?mod\s+(\w+)\s*;"
    found = set()
    for path in sources(top, "*.rs"):
        text = without_comments(path.read_text())
        folder = path.parent if path.name in ("lib.rs", "mod.rs", "main.rs") else path.with_suffix("")
        names = re.findall(left_out, text)
        below = [file for name in names for file in [folder / f"{name}.rs", *(folder / name).rglob("*.rs")] if file.exists()]
        if re.search(r"#!\[cfg\(not\(test\)\)\]", text):
            below += [path, *folder.rglob("*.rs")] if path.name != "lib.rs" else sources(top, "*.rs")
        found |= {str(file.relative_to(top)) for file in below if re.search(r"#\[(cfg\(test\)|test)\]", without_comments(file.read_text()))}
    return sorted(found)


def test_every_unit_test_is_built() -> None:
    assert [p.name for p in sources(CORE, "*.rs") if re.search(r"cfg\(not\(test\)\)", without_comments(p.read_text()))] == []
    assert never_tested(CORE) == []
    # The extension is built with `test = false`, so it must not contain tests.
    assert [p.name for p in sources(BINDING, "*.rs") if re.search(r"#\[(cfg\(test\)|test)\]", without_comments(p.read_text()))] == []


def test_unit_test_rule_sees_planted_violations(tmp_path: Path) -> None:
    tests = "#[cfg(test)]\nmod tests {}\n"
    files = {
        "lib.rs": "#[cfg(not(test))]\npub mod a;\nmod b;\n// #[cfg(not(test))]\nmod c;\n",
        "a/mod.rs": "mod inner;\n",
        "a/inner.rs": tests,
        "b.rs": "#[cfg(not(test))]\n#[allow(dead_code)]\npub(crate) mod inner;\n" + tests,
        "b/inner.rs": "#[test]\nfn f() {}\n",
        "c.rs": tests,
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    assert never_tested(tmp_path) == ["a/inner.rs", "b/inner.rs"]


def long_files(tops: list[Path]) -> dict[str, int]:
    """Source files with more than 400 lines. `test_source_rules` counts those of stubs, which have copies of docstrings."""
    paths = [p for top in tops for pattern in ("*.rs", "*.py", "*.c", "*.js") for p in top.rglob(pattern) if "target" not in p.parts]
    assert paths
    lengths = {str(p): p.read_text().count("\n") for p in paths}
    return {path: lines for path, lines in lengths.items() if lines > LINES}


def test_files_fit_in_a_head() -> None:
    tops = [ROOT / top for top in ("rust", "python", "tests", "examples", "benches", "tools") if (ROOT / top).exists()]
    assert long_files(tops) == {}


def test_length_rule_sees_planted_violation(tmp_path: Path) -> None:
    (tmp_path / "long.rs").write_text("\n" * (LINES + 1))
    (tmp_path / "short.rs").write_text("\n" * LINES)
    assert list(long_files([tmp_path])) == [str(tmp_path / "long.rs")]


def reference_strays(source: str) -> set[str]:
    """Imports of a file of `reference` other than numpy, the standard library and its own package."""
    own = {name for name in imports(source) if name.startswith(".") and not name.startswith("..")}
    return imports(source) - own - sys.stdlib_module_names - {"numpy"}


def test_reference_imports_only_numpy() -> None:
    folder = PACKAGE / "reference"
    wrong = {str(p.relative_to(ROOT)): reference_strays(p.read_text()) for p in sources(folder, "*.py")}
    assert {path: names for path, names in wrong.items() if names} == {}


@pytest.mark.parametrize(
    "line",
    ["import scipy.linalg", "from armlet import _core", "from .. import _core", "from .._core import Arm", "from ..law import x"],
)
def test_reference_rule_sees_planted_violations(line: str) -> None:
    assert reference_strays(f"import numpy as np\nfrom .arms import chain\n{line}\n") != set()


def test_nothing_falls_back_to_the_reference() -> None:
    """The package does not import `reference`, which is only for tests and readers."""
    outside = [p for p in sources(PACKAGE, "*.py") if "reference" not in p.relative_to(PACKAGE).parts[:-1]]
    assert outside
    naming = [p.name for p in outside if re.search(r"^\s*(from|import)\b.*\breference\b", p.read_text(), re.MULTILINE)]
    assert naming in ([], ["__init__.py"])  # `al.reference` may be named as a submodule, so that `al.reference.x` works


# These functions may pass a parameter to numpy, because it is not an array of float64 from the caller. It is a flag, a status, a value from
# another library, a law's target, or axes of a figure.
READ_BY_NUMPY = {
    ("gym/vector.py", "_mask"),
    ("interop/scipy_solver.py", "_call_impl"),
    ("figures/time_path.py", "margin"),
    ("run/named_numbers.py", "_as_numbers"),
    ("run/records.py", "_set_status"),
    ("run/task_errors.py", "at"),
    ("interop/verification.py", "_array"),
}
CALLERS = ("ArrayLike", "Any", "object")


def raw_reads(source: str) -> set[tuple[str, str]]:
    """For each function that passes an array-like parameter or field to numpy: its name, and the name of the parameter or field.

    numpy would ignore the mask of a masked array.
    """
    found: set[tuple[str, str]] = set()

    def annotated(node: ast.expr | None) -> bool:
        return node is not None and any(isinstance(part, ast.Name) and part.id in CALLERS for part in ast.walk(node))

    def visit(node: ast.AST, names: set[str], function: str) -> None:
        if isinstance(node, ast.ClassDef):
            fields = {
                f"self.{n.target.id}"
                for n in node.body
                if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name) and annotated(n.annotation)
            }
            names = names | fields
        if isinstance(node, ast.FunctionDef | ast.Lambda):
            arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            names = (names - {a.arg for a in arguments}) | {a.arg for a in arguments if annotated(a.annotation)}
            function = getattr(node, "name", function)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and isinstance(node.func.value, ast.Name):
            given = [ast.unparse(part) for part in node.args[:1]]
            if node.func.value.id == "np" and node.func.attr in CONVERTERS and given and given[0] in names:
                found.add((function, given[0]))
        for child in ast.iter_child_nodes(node):
            visit(child, names, function)

    visit(ast.parse(source), set(), "")
    return found


CONVERTERS = {
    "array",
    "asarray",
    "asanyarray",
    "ascontiguousarray",
    "atleast_1d",
    "atleast_2d",
    "stack",
    "ndim",
    "size",
    "shape",
    "broadcast_to",
}


def test_arrays_of_the_caller_are_read_in_one_place() -> None:
    """`_core.numbers` converts the caller's arrays and refuses masked arrays. `armlet.reference` and `armlet.demo` are exempt."""
    own = [path for path in sources(PACKAGE, "*.py") if path.relative_to(PACKAGE).parts[0] not in ("reference", "demo")]
    strays = {(str(p.relative_to(PACKAGE)), function, name) for p in own for function, name in raw_reads(p.read_text(encoding="utf-8"))}
    assert {stray for stray in strays if stray[:2] not in READ_BY_NUMPY} == set()


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("def f(x: ArrayLike | None, n: int):\n    return np.asarray(x), np.array(n)", {("f", "x")}),
        (
            "class A:\n    x: ArrayLike\n    def g(self, y: Any):\n        return np.asarray(self.x) + np.ndim(y)",
            {("g", "self.x"), ("g", "y")},
        ),
        ("def f(x: ArrayLike):\n    y = numbers(x)\n    return np.asarray(y)", set()),
        ("def f(x: Array):\n    return np.asarray(x)", set()),
    ],
)
def test_raw_reads_are_detected(source: str, expected: set[tuple[str, str]]) -> None:
    assert raw_reads(source) == expected
