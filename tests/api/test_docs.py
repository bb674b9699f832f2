"""Every Python block of README and docs/ and every example runs, and so does the code in sentences between the blocks.

Code in a sentence is an expression in code font with an attribute, a call or an index, such as `axes[0].figure`. If the blocks of the page
define all its names, it is evaluated. This happens at its line, or at the end of the page if its names are defined later. Other expressions
contain objects of the reader, such as `al.time_path(arm, path)`. In them, only the names of armlet must exist.
"""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from program_runner import ProgramRunner
from scripts import imported

import armlet as al

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
# Examples that need a package that `make test` does not install. `make test-peers` installs it and runs them.
NEEDS = {"mujoco_loop.py": "mujoco"}
ACTIONS = "../../actions/"
Run = Callable[[str, str, Path], subprocess.CompletedProcess[str]]
FENCE = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


# Text that is not prose: blocks in any language, and indented lines.
NO_PROSE = re.compile(r"^```.*?^```$|^    .*?$", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"(?<!`)`([^`\n]+)`(?!`)")


def program(page: str) -> str:
    """The code of a page: its blocks and its code in sentences. Each line keeps its line number, so that a traceback names it."""
    prose = NO_PROSE.sub(lambda match: re.sub(r"[^\n]", " ", match.group()), page)
    lines: dict[int, str] = {}
    for span in INLINE.finditer(prose):
        line = page[: span.start()].count("\n")
        lines[line] = lines.get(line, "") + f"inline({span.group(1)!r}); "
    for block in FENCE.finditer(page):
        lines |= dict(enumerate(block.group(1).split("\n"), page[: block.start(1)].count("\n")))
    return "\n".join(lines.get(line, "") for line in range(max(lines, default=-1) + 1)) + "\n"


def inline(code: str, bound: dict[str, Any]) -> str:
    """Evaluate code in a sentence if all its names are in `bound`, otherwise look up the names of armlet.

    Return "run", "looked up", or "" if nothing was done.
    """
    import builtins

    try:
        tree = ast.parse(code, mode="eval")
    except SyntaxError:
        return ""
    nodes = list(ast.walk(tree))
    names = {node.id for node in nodes if isinstance(node, ast.Name)}
    own = names - set(dir(builtins))
    # A list in code font, such as `[plant]`, is the name of a table of a TOML file.
    if not own or isinstance(tree.body, ast.List) or not any(isinstance(node, ast.Attribute | ast.Call | ast.Subscript) for node in nodes):
        return ""
    if own <= set(bound):
        eval(compile(tree, code, "eval"), bound)
        return "run"
    called = [ast.unparse(node) for node in nodes if isinstance(node, ast.Attribute)]
    known = [name for name in called if re.fullmatch(r"al(\.\w+)+", name) and "al" in bound]
    for name in known:
        eval(name, bound)
    return "looked up" if known else ""


@pytest.fixture(scope="module")
def run() -> Iterator[Run]:
    """A function that runs a page's or an example's code in a separate process and in a folder."""
    with ProgramRunner() as runner:

        def run(source: str, name: str, folder: Path) -> subprocess.CompletedProcess[str]:
            code = f"""
import ast, re
from typing import Any
import matplotlib
matplotlib.use("Agg")
{inspect.getsource(inline)}
left = []
bound = {{"__name__": "__main__", "inline": lambda code: inline(code, bound) == "run" or left.append(code)}}
exec(compile({source!r}, {name!r}, "exec"), bound)
for code in left:
    inline(code, bound)
"""
            return runner(code, folder)

        yield run


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if "```python" in page.read_text()], ids=name_of)
def test_page(page: Path, tmp_path: Path, run: Run) -> None:
    source = program(page.read_text())
    assert source.strip()
    result = run(source, name_of(page), tmp_path)
    assert result.returncode == 0, result.stderr


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=name_of)
def test_example(example: Path, tmp_path: Path, run: Run) -> None:
    result = run(example.read_text(), name_of(example), tmp_path)
    needed = NEEDS.get(example.name)
    if needed is not None and find_spec(needed) is None:
        # Without the package, an example prints one line.
        assert result.returncode == 1
        assert result.stderr == f"{example.stem}: {needed} is not installed: pip install '.[{needed}]' in the folder of armlet's sources\n"
        return
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip()


def test_pages_have_code_and_examples_exist() -> None:
    assert [page.name for page in PAGES if "```python" in page.read_text()] and EXAMPLES


def test_a_broken_block_is_detected(tmp_path: Path, run: Run) -> None:
    page = "# Title\n\n```python\nx = 1\n```\n\ntext\n\n```python\nassert x == 2\n```\n"
    result = run(program(page), "page.md", tmp_path)
    assert result.returncode != 0
    assert '"page.md", line 10' in result.stderr


@pytest.mark.parametrize(
    ("code", "line"),
    [
        ("x.shape", 7),  # the name is defined above, the attribute does not exist
        ("later.shape", None),  # the name is defined below, so it is evaluated at the end
        ("al.simulat(plant, law)", 7),  # the name does not exist; its arguments do not matter
        ("x(1).y", 7),
    ],
)
def test_broken_code_in_prose_is_detected(code: str, line: int | None, tmp_path: Path, run: Run) -> None:
    page = f"# Title\n\n```python\nimport armlet as al; x = 1\n```\n\nCall `{code}`.\n\n```python\nlater = 2\n```\n"
    result = run(program(page), "page.md", tmp_path)
    assert result.returncode != 0 and ("AttributeError" in result.stderr or "TypeError" in result.stderr)
    assert line is None or f'"page.md", line {line}' in result.stderr


@pytest.mark.parametrize(
    "code", ["x.real", "sin(q)", "[[law.tasks]]", "a x = b", "al.simulate(plant, law)", "my.toml", "True", "examples/a.py"]
)
def test_sound_code_in_prose_passes(code: str, tmp_path: Path, run: Run) -> None:
    page = f"```python\nimport armlet as al; x = 1; law = 2\n```\n\nText `{code}`.\n"
    result = run(program(page), "page.md", tmp_path)
    assert result.returncode == 0, result.stderr


def test_links_lead_somewhere() -> None:
    """Relative links of the pages point to existing files. GitHub adds its address to a link that starts with `ACTIONS`."""
    broken = []
    for page in [*PAGES, *(ROOT / name for name in ("CONTRIBUTING.md", "CHANGELOG.md", "examples/README.md"))]:
        for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text()):
            path = Path(".github") / target.removeprefix(ACTIONS).removesuffix("/badge.svg") if target.startswith(ACTIONS) else target
            if "://" not in target and not (page.parent / path).exists():
                broken.append(f"{name_of(page)}: {target}")
    assert broken == []


def test_code_paths_exist() -> None:
    """Files of the repository that a page names in code font exist."""
    missing = []
    for page in PAGES:
        for target in re.findall(r"`((?:rust|python|examples|tests|docs|tools)/[\w./-]+)`", page.read_text()):
            if not (ROOT / target).exists():
                missing.append(f"{name_of(page)}: {target}")
    assert missing == []


def test_index_links_to_every_page() -> None:
    """The index links to every page. The order of the links is the order of the built pages."""
    index = (ROOT / "docs/index.md").read_text()
    pages = [*(ROOT / "docs").glob("*.md"), *(ROOT / "docs/methods").glob("*.md")]
    names = [page.relative_to(ROOT / "docs").as_posix() for page in pages if page.name not in ("index.md", "sources.md")]
    assert [name for name in names if f"]({name})" not in index] == [] and "methods/adaptive.md" in names


def test_pages_are_short() -> None:
    """No page has more than 300 lines, except for the exam and the list of all names."""
    long = [name_of(page) for page in PAGES if len(page.read_text().splitlines()) > 300]
    assert set(long) <= {"docs/exam.md", "docs/reference.md"}


@pytest.fixture
def reference() -> Any:
    return imported(ROOT / "tools/reference.py")


def test_reference_lists_every_name(reference: Any) -> None:
    """If the second check fails, a docstring has changed: run `python tools/reference.py`."""
    page = (ROOT / "docs/reference.md").read_text()
    assert sorted(found[1] for found in reference.ENTRY.finditer(page)) == sorted(set(al.__all__) - {"__version__"})
    assert reference.written(page) == page
    # An entry is a link and a sentence.
    assert all(re.search(r"\): \S.*\S$", " ".join(found[0].split())) for found in reference.ENTRY.finditer(page))


def test_reference_of_the_built_pages(reference: Any) -> None:
    page = (ROOT / "docs/reference.md").read_text()
    built = reference.converted(page)
    assert re.findall(r"^   (\w+)$", built, re.MULTILINE) == [found[1] for found in reference.ENTRY.finditer(page)]
    assert built.count(".. autosummary::") == page.count("\n## ") and not reference.ENTRY.search(built)


def test_an_old_entry_of_the_reference_is_detected(reference: Any) -> None:
    page = "# Reference\n\n## Runs\n\n- [simulate]()\n- [`load`](../old.py): An old sentence\n  on two lines.\n"
    made = reference.written(page)
    assert made.startswith("# Reference\n\n## Runs\n\n- [`simulate`](../python/armlet/run/simulation.py): Simulate the closed loop")
    assert made.endswith("- [`load`](../python/armlet/run/records.py): Read a run from a file that `run.save` wrote.\n")
    assert reference.written(made) == made


def test_citations_have_a_source() -> None:
    """`[Key]` and `[Key1, Key2]` in a page are keys of references.bib, which the build converts to links."""
    keys = set(re.findall(r"^@\w+\{([^,]+),", (ROOT / "docs/references.bib").read_text(), re.MULTILINE))
    cited = {}
    for page in PAGES:
        text = re.sub(r"^```.*?^```$|^    .*?$|`[^`\n]*`", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
        for group in re.findall(r"\[([A-Za-z]\w*\d{4}\w*(?:, [A-Za-z]\w*\d{4}\w*)*)\](?!\()", text):
            cited |= dict.fromkeys(group.split(", "), name_of(page))
    assert "SlotineLi1987" in cited
    assert {key: page for key, page in cited.items() if key not in keys} == {}


def formula_faults(page: str) -> list[str]:
    """Rendered formulas with unclosed braces, environments or delimiters. MathJax shows them in red, and the build does not fail."""
    faults = []
    for formula in re.findall(r"^```math$\n(.*?)^```$", page, re.MULTILINE | re.DOTALL):
        opened, closed = re.findall(r"\\begin\{(\w+)\}", formula), re.findall(r"\\end\{(\w+)\}", formula)
        braces = re.findall(r"(?<!\\)[{}]", formula)
        if sorted(opened) != sorted(closed) or braces.count("{") != braces.count("}"):
            faults.append(formula)
        elif len(re.findall(r"\\left\b", formula)) != len(re.findall(r"\\right\b", formula)) or not formula.strip():
            faults.append(formula)
    return faults


def test_formulas_are_closed() -> None:
    assert {name_of(page): found for page in PAGES if (found := formula_faults(page.read_text()))} == {}
    assert sum(page.read_text().count("```math\n") for page in PAGES) > 40


@pytest.mark.parametrize("formula", ["\\frac{1}{2", r"\begin{bmatrix} 1", r"\left( x", "", r"\begin{aligned} \end{bmatrix}"])
def test_unclosed_formulas_are_detected(formula: str) -> None:
    assert formula_faults(f"# Page\n\n```math\nx = {{1}}\n```\n\n```math\n{formula}\n```\n") == [f"{formula}\n"]


def test_examples_have_a_title() -> None:
    """The gallery uses the docstring of an example: an underlined title, and a description."""
    assert [name_of(path) for path in EXAMPLES if not re.match(r'"""(\S.*)\n=+\n\n\S', path.read_text())] == []


CONCEPTS = "adaptive arms batches elastic identification impedance integration minimum_time plants_and_laws priority time_path".split()


@pytest.mark.parametrize("concept", CONCEPTS)
def test_concept_pages_are_complete(concept: str) -> None:
    """A concept page has an equation, code that runs, a figure, limits, and the paths of source and example.

    If it has a page of its method, both pages together have these parts.
    """
    text = (ROOT / f"docs/{concept}.md").read_text()
    method = ROOT / f"docs/methods/{concept}.md"
    text += method.read_text() if method.exists() else ""
    wanted = {
        "equation": r"^    .*[=<]|^```math$",
        "code that runs": r"^```python$",
        "figure": r"^```\{figure\} auto_examples/images/sphx_glr_\w+_001\.png$|^!\[.+\]\((?:\.\./)?images/[\w/]+\.(?:svg|png)\)$",
        "limits": r"^## Limits$",
        "code": r"`rust/core/src/[\w/.]+`",
        "example": r"`examples/\w+\.py`",
    }
    assert [what for what, pattern in wanted.items() if not re.search(pattern, text, re.MULTILINE)] == []
    for example in re.findall(r"(?:sphx_glr_|images/examples/)(\w+?)(?:_001)?\.png", text):
        assert "savefig(sys.argv[1]" in (ROOT / f"examples/{example}.py").read_text()
