"""What these pages ask of Sphinx beyond its extensions: the tree of pages, citations, code in docstrings, figures of examples."""

import re
import tempfile
from importlib.util import find_spec
from pathlib import Path

KEYS = re.findall(r"^@\w+\{([^,]+),", (Path(__file__).parent / "references.bib").read_text(), re.MULTILINE)
CITATION = re.compile(r"\[((?:" + "|".join(KEYS) + r")(?:, (?:" + "|".join(KEYS) + r"))*)\](?!\()")
# A file of the built pages alone, so no link of the sources.
REPORT = '<a href="demo/report.html">The report of the demonstration</a>: each check with expected and actual value, and the figures.'
FENCE = re.compile(r"(^```.*?^```$|^    .*?$)", re.MULTILINE | re.DOTALL)


def links(app: object, name: str, source: list[str]) -> None:
    """`[Key1, Key2]` of a page, readable as it stands, becomes a link to the sources. Code is left alone."""
    if name.startswith(("auto_examples", "api/")):
        return
    pieces = FENCE.split(source[0])
    pieces[::2] = [piece.replace("(../benches/README.md", "(benchmarks.md") for piece in pieces[::2]]  # copied in by tools/docs.sh
    pieces[::2] = [CITATION.sub(lambda m: "{cite}`" + m[1].replace(", ", ",") + "`", piece) for piece in pieces[::2]]
    source[0] = "".join(pieces)
    if name == "index":
        source[0] = source[0].replace("\n## How-to\n", f"\n{REPORT}\n\n## How-to\n") + tree(source[0])


def tree(index: str) -> str:
    """The pages in the sections of the first page, then those that are made: a page without a link there is a warning."""
    parts = re.split(r"^## (.+)$", index, flags=re.MULTILINE)
    linked = [dict.fromkeys(re.findall(r"\]\(([\w/]+)\.md\)", text)) for text in parts[2::2]]
    captions = {caption: [*pages] for caption, pages in zip(parts[1::2], linked, strict=True) if pages}
    for caption, made in (("How-to", ["auto_examples/index"]), ("Project", ["benchmarks", "sources", "adr/*"])):
        captions[caption] += made
    return "".join(
        f"\n\n```{{toctree}}\n:hidden:\n:glob:\n:caption: {caption}\n\n" + "\n".join(names) + "\n```\n"
        for caption, names in captions.items()
    )


def code_in_docstrings(app: object, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    """Backticks of a docstring hold code; bars and stars are arithmetic, never markup."""
    for i, line in enumerate(lines):
        if not line.lstrip().startswith((">>>", "...")):
            pieces = re.split(r"(:[\w ]*:`[^`]+`|``[^`]+``|`[^`]+`)", line)
            pieces[::2] = [re.sub(r"(?<!\\)([*|])", r"\\\1", piece) for piece in pieces[::2]]
            pieces[1::2] = [f"`{piece}`" if re.match("`[^`]", piece) else piece for piece in pieces[1::2]]
            lines[i] = "".join(pieces)


def executed(examples: Path) -> str:
    """A pattern of the examples that can run here; one whose docstring says "needs NAME (" is only shown where NAME is not installed."""
    needs = {path.stem: re.findall(r"\bneeds (\w+) \(", path.read_text().split('"""')[1]) for path in examples.glob("*.py")}
    shown = [stem for stem, names in needs.items() if any(find_spec(name) is None for name in names)]
    return r"[\\/](?!(?:" + "|".join(shown or ["-"]) + r")\.py$)\w+\.py$"


def with_figure(conf: object, variables: dict[str, str]) -> list[str]:
    """An example that draws takes a file for its figure. The gallery keeps the figure, and the file is not used."""
    drawn = "savefig(sys.argv[1]" in Path(variables["src_file"]).read_text()
    return [str(Path(tempfile.gettempdir()) / "armlet_gallery.png")] if drawn else []


def setup(app: object) -> None:
    app.connect("source-read", links)
    app.connect("autodoc-process-docstring", code_in_docstrings, priority=600)  # after napoleon
