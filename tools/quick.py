"""`make quick`: build the extension with little optimisation, and run the tests of the changed files: one file of tests of each kind.

    python tools/quick.py                 files that differ from the branch `main` of the remote
    python tools/quick.py FILE..          these files
    python tools/quick.py --list FILE..   print the chosen files of tests

A kind of test is a folder of `tests`. For each changed file and each kind, that file of tests is chosen which uses the words of the changed
file most. These words are its public names, and the names of the file and its two folders. A word that `n` of the `N` files of tests use
has the weight `log(N / n)`. Changed files of tests run too. Tests with the markers `slow`, `compile` and `browser` do not run.

After a change of `rust/core`, the unit tests of the core run at the same time as the Python tests.
"""

from __future__ import annotations

import ast
import math
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "build" / "quick"
KINDS = ("api", "identities", "live", "oracles", "parity", "reference")
MARKERS = "not slow and not compile and not browser"
#: Names of files that have no meaning without their folder.
HEADS = ("__init__", "mod", "lib", "main")
#: Weight of a name of the changed file that is in the name of the file of tests.
NAMED = 20.0
WORD = re.compile(r"[A-Za-z]\w{2,}")
PUBLIC_OF_RUST = re.compile(r"^\s*pub(?:\([^)]*\))? (?:fn|struct|enum|trait|const|type|mod) (\w{3,})", re.MULTILINE)


@cache
def tests() -> list[Path]:
    """All files of tests of the kinds `KINDS`."""
    return [path for kind in KINDS for path in sorted((ROOT / "tests" / kind).glob("test_*.py"))]


@cache
def words_of_test(path: Path) -> Counter[str]:
    return Counter(WORD.findall(path.read_text(encoding="utf-8")))


@cache
def numbers_of_files() -> Counter[str]:
    """For each word, the number of files of tests that use it."""
    return Counter(word for path in tests() for word in words_of_test(path))


def stem(path: Path) -> str:
    """The name of a source file, or of its folder if the file has a general name."""
    return path.parent.name if path.stem in HEADS else path.stem


@cache
def words(path: Path) -> set[str]:
    """The public names of a source file, and the names of the file and of its two folders, as a module and as a class."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        found = {node.name for node in ast.parse(text).body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    elif path.suffix == ".rs":
        found = {name.removesuffix("Spec") for name in PUBLIC_OF_RUST.findall(text)}
    else:
        found = set()
    found = {name for name in found if not name.startswith("_")}
    for name in (stem(path), path.parent.name, path.parents[1].name):
        found |= {name, "".join(part.capitalize() for part in name.split("_"))}
    return found


def score(path: Path, test: Path) -> float:
    """How much a file of tests uses the words of a source file."""
    counts, numbers, total = words_of_test(test), numbers_of_files(), len(tests())
    used = sum((1 + math.log(counts[word])) * math.log(total / numbers[word]) for word in words(path) if counts[word])
    parts = set(stem(path).split("_"))
    return used + NAMED * len(parts & set(test.stem.split("_"))) / len(parts)


def chosen(paths: Iterable[Path]) -> list[Path]:
    """The files of tests for the changed files `paths`, the most related ones first."""
    scores: dict[Path, float] = {}
    for path in paths:
        if path in tests():
            scores[path] = math.inf
            continue
        if path.suffix not in (".py", ".rs") or path.is_relative_to(ROOT / "tests"):
            continue
        for kind in KINDS:
            best = max((test for test in tests() if test.parent.name == kind), key=lambda test: score(path, test))
            scores[best] = max(scores.get(best, 0.0), score(path, best))
    return sorted((test for test in scores if scores[test] > 0.0), key=lambda test: -scores[test])


def git(*arguments: str) -> list[str]:
    if shutil.which("git") is None:
        return []
    return subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False).stdout.splitlines()


def changed() -> list[Path]:
    """Files that differ from the branch `main` of the remote, or from the last commit if there is no remote."""
    base = next(iter(git("merge-base", "HEAD", "origin/main")), "HEAD")
    names = [*git("diff", "--name-only", base), *git("ls-files", "--others", "--exclude-standard")]
    return [path for path in (ROOT / name for name in dict.fromkeys(names)) if path.is_file()]


def cargo(*arguments: str) -> list[str]:
    return ["cargo", *arguments, "--profile", "quick", "--locked", "--quiet"]


def build() -> None:
    """Build the extension, and copy the package with it to build/quick."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    subprocess.run([*cargo("build"), "--package", "armlet-py", "--features", "pyo3/extension-module"], cwd=ROOT, check=True)
    shutil.rmtree(BUILD, ignore_errors=True)
    shutil.copytree(ROOT / "python" / "armlet", BUILD / "armlet", ignore=shutil.ignore_patterns("*.so", "__pycache__"))
    (library,) = (target / "quick" / name for name in ("lib_core.so", "lib_core.dylib") if (target / "quick" / name).exists())
    shutil.copy2(library, BUILD / "armlet" / "_core.abi3.so")


def main(arguments: list[str]) -> int:
    files = [Path(name).resolve() for name in arguments if name != "--list"] or changed()
    found = chosen(files)
    names = [path.relative_to(ROOT).as_posix() for path in found]
    print(*(names or ["quick: no changed source"]), sep="\n", flush=True)
    if "--list" in arguments or not names:
        return 0
    build()
    units = None
    if any(path.is_relative_to(ROOT / "rust" / "core") for path in files):
        command = [*cargo("test"), "--package", "armlet-core", "--lib"]
        units = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    environment = os.environ | {"PYTHONPATH": str(BUILD)}
    command = [sys.executable, "-P", "-m", "pytest", "-c", str(ROOT / "pyproject.toml"), "--rootdir", str(ROOT), "-m", MARKERS]
    code = subprocess.run([*command, *map(str, found)], cwd=BUILD, env=environment, check=False).returncode
    code = 0 if code == 5 else code  # all tests of these files have a marker
    if units is not None:
        print(units.communicate()[0], end="")
        code = code or units.returncode
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
