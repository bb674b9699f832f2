"""Functions for Sphinx in addition to its extensions: the tree of pages, citations, code in docstrings, figures of examples."""

import re
import tempfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

from docutils import nodes

KEYS = re.findall(r"^@\w+\{([^,]+),", (Path(__file__).parent / "references.bib").read_text(), re.MULTILINE)
CITATION = re.compile(r"\[((?:" + "|".join(KEYS) + r")(?:,\s+(?:" + "|".join(KEYS) + r"))*)\](?!\()")
# This file exists only among the built pages, so the sources have no link to it.
REPORT = '<a href="demo/report.html">The report of the demonstration</a>: each check with expected and actual value, and the figures.'
COLON = "\ue000"  # a private character of Unicode
FENCE = re.compile(r"(^```.*?^```$|^    .*?$)", re.MULTILINE | re.DOTALL)


def cited(role: str) -> Callable[[re.Match[str]], str]:
    return lambda found: f"{role}`" + re.sub(r",\s+", ",", found[1]) + "`"


def links(app: object, name: str, source: list[str]) -> None:
    """Convert `[Key1, Key2]` in a page to links to the list of sources. Code does not change."""
    if name.startswith(("auto_examples", "api/")):
        return
    pieces = FENCE.split(source[0])
    # tools/docs.sh copies the benchmarks to the pages: docs/ links to them as ../benches, docs/adr as ../../benches.
    pieces[::2] = [re.sub(r"\(((?:\.\./)*)\.\./benches/README\.md", r"(\1benchmarks.md", piece) for piece in pieces[::2]]
    pieces[::2] = [CITATION.sub(cited("{cite}"), piece) for piece in pieces[::2]]
    source[0] = "".join(pieces)
    if name == "index":
        source[0] = source[0].replace("\n## How-to\n", f"\n{REPORT}\n\n## How-to\n") + tree(source[0])


def tree(index: str) -> str:
    """The tree of pages: those that the sections of the first page link, and generated pages. Sphinx warns of a page outside the tree."""
    parts = re.split(r"^## (.+)$", index, flags=re.MULTILINE)
    linked = [dict.fromkeys(re.findall(r"\]\(([\w/]+)\.md\)", text)) for text in parts[2::2]]
    captions = {caption: [*pages] for caption, pages in zip(parts[1::2], linked, strict=True) if pages}
    for caption, made in (("How-to", ["auto_examples/index"]), ("Project", ["benchmarks", "sources", "adr/*"])):
        captions[caption] += made
    return "".join(
        f"\n\n```{{toctree}}\n:hidden:\n:glob:\n:caption: {caption}\n\n" + "\n".join(names) + "\n```\n"
        for caption, names in captions.items()
    )


def equations(tex: str) -> list[str]:
    """The equations of a line, which `\\quad` and `\\qquad` separate; the whole line if it has rows."""
    depth, found = 0, [""]
    for token in re.split(r"(\\\\|\\q?quad\b|\\begin\b|\\end\b|\\left\b|\\right\b|\\[{}]|[{}])", tex):
        if token == "\\\\" and depth == 0:
            return [tex]
        depth += (token in ("{", "\\begin", "\\left")) - (token in ("}", "\\end", "\\right"))
        if token in ("\\quad", "\\qquad") and depth == 0:
            found.append("")
        else:
            found[-1] += token
    return [piece.strip() for piece in found if piece.strip()]


def formulas_in_lines(app: object, doctree: nodes.document, name: str) -> None:
    """Split equations of one line, so that a narrow page shows them below one another. Their number `\\tag{..}` follows the last one."""
    for node in [*doctree.findall(nodes.math_block)]:
        tag = re.search(r"\\tag\{(\w+)\}", node.astext())
        pieces = equations(re.sub(r"\\tag\{\w+\}", "", node.astext()))
        if len(pieces) > 1 and not node.get("number"):
            line = nodes.paragraph(classes=["equations"])
            for piece in pieces:
                line += nodes.inline("", "", nodes.math("", rf"\displaystyle {piece}"), classes=["equation"])
                line += nodes.Text(" ")
            if tag:
                line += nodes.inline("", f"({tag[1]})", classes=["equation"])
            node.replace_self(line)


def drop_compiled(app: object) -> list[object]:
    """Remove compiled modules from the list of module sources. viewcode would link to a page that does not exist."""
    modules = app.env._viewcode_modules
    for name in [name for name, entry in modules.items() if not entry]:
        del modules[name]
    return []


def colons_of_attributes(app: object, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    """Napoleon takes the words before a colon for the type of an attribute. These docstrings have sentences there."""
    if what in ("attribute", "property", "data"):
        lines[:] = [line.replace(":", COLON) for line in lines]


def code_in_docstrings(app: object, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    """Mark text in backticks as code, and escape bars and stars of a docstring, which are arithmetic and not markup."""
    text = "\n".join(lines).replace(COLON, ":")
    # Text in backticks may continue in the next line. It ends at the end of a paragraph or at an example.
    paragraphs = re.split(r"(\n\s*\n|^\s*(?:>>>|\.\.\.).*$)", text, flags=re.MULTILINE)
    for i, paragraph in enumerate(paragraphs[::2]):
        # The last pattern is the name of an argument in a list of napoleon, which is markup.
        pieces = re.split(r"(:[\w ]*:`[^`]+`|``[^`]+``|`[^`]+`|\* \*\*[\w, \\*]+\*\* -- )", paragraph)
        pieces[::2] = [re.sub(r"(?<!\\)([*|])", r"\\\1", piece) for piece in pieces[::2]]
        pieces[::2] = [CITATION.sub(cited(":cite:"), piece) for piece in pieces[::2]]
        pieces[1::2] = [f"`{piece}`" if re.match("`[^`]", piece) else piece for piece in pieces[1::2]]
        paragraphs[2 * i] = "".join(pieces)
    lines[:] = "".join(paragraphs).split("\n")


def executed(examples: Path) -> str:
    """A pattern of the examples that run in the gallery.

    An example whose docstring has "needs NAME (" does not run if NAME is not installed. The gallery then shows only its source.
    """
    needs = {path.stem: re.findall(r"\bneeds (\w+) \(", path.read_text().split('"""')[1]) for path in examples.glob("*.py")}
    shown = [stem for stem, names in needs.items() if any(find_spec(name) is None for name in names)]
    return r"[\\/](?!(?:" + "|".join(shown or ["-"]) + r")\.py$)\w+\.py$"


def with_figure(conf: object, variables: dict[str, str]) -> list[str]:
    """The arguments of an example: the file of its figure, if it draws one. The gallery takes the figure itself, not this file."""
    drawn = "savefig(sys.argv[1]" in Path(variables["src_file"]).read_text()
    return [str(Path(tempfile.gettempdir()) / "armlet_gallery.png")] if drawn else []


def setup(app: object) -> None:
    app.connect("source-read", links)
    app.connect("autodoc-process-docstring", colons_of_attributes, priority=400)  # before napoleon
    app.connect("doctree-resolved", formulas_in_lines)
    app.connect("html-collect-pages", drop_compiled, priority=400)  # before viewcode
    app.connect("autodoc-process-docstring", code_in_docstrings, priority=600)  # after napoleon
