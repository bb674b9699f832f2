"""The pictures of `docs/images` are drawn from their sources, are readable without a network, and have no texts that overlap."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from boxes import faults

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools/pictures"))
import pages  # noqa: E402, F401  # registers the pictures
import registry  # noqa: E402

PICTURES = registry.PICTURES
DRAWN = [name for name, picture in PICTURES.items() if picture.draw is not None]
#: Pages of theory, which have a page of details.
LESSONS = sorted(path.name for path in (ROOT / "docs/methods").glob("*.md") if path.name in {picture.page for picture in PICTURES.values()})
IMAGE = re.compile(r"^!\[([^\]]+)\]\(([^)]+)\)$", re.MULTILINE)


def test_pictures_are_up_to_date() -> None:
    """If this fails, `python tools/pictures` draws the pictures whose sources have changed. Look at them, and commit them."""
    assert registry.stale() == []


def test_a_changed_source_is_detected(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    stored = registry.hashes()
    name = "adaptive_run.svg"
    monkeypatch.setattr(registry.Picture, "code", lambda picture: ["x = 1\n"])
    changed = registry.stale(stored)
    assert f"{name}: its sources have changed" in changed and "adaptive.svg: its sources have changed" not in changed
    monkeypatch.undo()
    assert registry.stale({**stored, name: {**stored[name], "file": "0"}}) == [f"{name}: the file was not drawn from its sources"]
    assert registry.stale({key: row for key, row in stored.items() if key != name}) == [f"{name}: not drawn"]
    assert registry.stale({**stored, "gone.svg": stored[name]}) == ["gone.svg: no picture has this name"]


@pytest.mark.parametrize("name", DRAWN)
def test_texts_of_a_picture_do_not_overlap(name: str) -> None:
    assert faults(PICTURES[name].figure()) == []


@pytest.mark.parametrize("name", DRAWN)
def test_a_picture_needs_no_network(name: str) -> None:
    """An SVG has a title, no text that needs a font, and no reference to another file. It is less than 150 kB."""
    text = PICTURES[name].file.read_text(encoding="utf-8")
    tree = ElementTree.fromstring(text)
    tags = {element.tag.split("}")[1] for element in tree.iter()}
    assert tree[0].text == PICTURES[name].title and not tags & {"text", "image", "script"}
    assert [value for element in tree.iter() for key, value in element.attrib.items() if key.endswith("href") and value[0] != "#"] == []
    assert len(text) < 150_000


def test_pages_show_files_of_the_repository() -> None:
    """Every image of a page is a file with a description, so that a code host shows it too. Pictures that no page shows are not stored."""
    shown = set()
    for page in [ROOT / "README.md", ROOT / "examples/README.md", ROOT / "benches/README.md", *(ROOT / "docs").rglob("*.md")]:
        text = page.read_text(encoding="utf-8") if page.exists() else ""
        for description, target in IMAGE.findall(text):
            assert len(description) > 20, (page.name, target)
            shown.add((page.parent / target).resolve())
    drawn = {picture.file for picture in PICTURES.values()}
    assert [path.name for path in shown if not path.exists()] == []
    assert sorted(picture.name for picture in PICTURES.values() if picture.page and picture.file not in shown) == []
    stored = {path for path in (ROOT / "docs/images").rglob("*") if path.suffix in (".svg", ".png")}
    assert sorted(path.name for path in stored - shown - drawn) == []


def test_the_list_of_examples() -> None:
    """`examples/README.md` has each example once, with its figure and the title of its docstring."""
    text = (ROOT / "examples/README.md").read_text(encoding="utf-8")
    scripts = {path.stem: path.read_text(encoding="utf-8") for path in (ROOT / "examples").glob("*.py")}
    assert sorted(re.findall(r"\]\((\w+)\.py\)", text)) == sorted(scripts)
    for name, picture in PICTURES.items():
        if picture.draw is None:
            script = Path(picture.inputs[0])
            own = text[text.index(f"**[{picture.title}]({script.name})** ") :].split("\n**[")[0]
            assert f'<img src="../docs/images/{name}" width="600" alt="{picture.title}">' in own


@pytest.mark.parametrize("page", LESSONS)
def test_the_order_of_a_lesson(page: str) -> None:
    """Drawing, question, code with its picture, equations, reason, one limit with its picture, exercises with answers, links."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    pictures = [target.split("/")[-1] for _, target in IMAGE.findall(text)]
    parts = [pictures[0], "?\n", "```python", pictures[1], "```math", "\n## A limit", pictures[-1], "\n## Exercises", "\n## More"]
    places = [text.index(part) for part in parts]
    assert places == sorted(places)
    assert PICTURES[pictures[0]].of_numbers is False and all(PICTURES[name].of_numbers for name in pictures[1:])
    exercises, answers = text[places[-2] : places[-1]].split("<details><summary>Answers</summary>")
    count = len(re.findall(r"^\d\. ", exercises, re.MULTILINE))
    assert count >= 3 and re.findall(r"^\*\*(\d)\.\*\*", answers, re.MULTILINE) == [str(i + 1) for i in range(count)]
    assert answers.count("```python") >= 2 and answers.count("assert") >= 2
    assert f"](methods/{page})" in text[places[-1] :]
    assert len(text.splitlines()) <= 300


@pytest.mark.parametrize("page", LESSONS)
def test_a_lesson_sets_mathematics_as_mathematics(page: str) -> None:
    """Code in a sentence is a name of the package, of the page's code or of a file; a symbol is not in code font."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    prose = re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
    symbols = re.compile(r"[A-Za-z]$|\w+_(?:dot|ddot|hat)\b|[A-Za-z](?:_\w{1,3})?( [-+*/=<>]|')|Gamma|Lambda|tau\b|theta\b")
    assert [span for span in re.findall(r"`([^`\n]+)`", prose) if symbols.match(span)] == []
    tags = [int(tag) for tag in re.findall(r"\\tag\{(\d+)\}", text)]
    assert tags == list(range(1, len(tags) + 1)) and len(tags) >= 3
    # A code host reads a backslash before a sign, such as `\\,`, as an escaped sign of Markdown.
    inline = re.findall(r"\$[^$\n]+\$", re.sub(r"`[^`\n]*`", "", prose))
    assert len(inline) > 10 and [formula for formula in inline if re.search(r"\\[^A-Za-z ]", formula)] == []


def test_the_picture_of_the_readme_moves() -> None:
    """Two arms and a line of the time move. All frames of a line have its number of points, and the last frame is the line at rest."""
    tree = ElementTree.parse(PICTURES["readme.svg"].file)
    moving = [(path, child) for path in tree.iter() for child in path if child.tag.endswith("}animate")]
    assert len(moving) == 3
    for path, motion in moving:
        frames = [re.findall(r"-?\d+\.\d", frame) for frame in motion.attrib["values"].split(";")]
        still = [float(number) for number in re.findall(r"-?[\d.]+", path.attrib["d"])]
        assert len(frames) == 61 and {len(frame) for frame in frames} == {len(still)}
        assert max(abs(float(a) - b) for a, b in zip(frames[-1], still, strict=True)) < 0.06  # points of 1/72 inch
        assert frames[0] != frames[-1] and int(motion.attrib["repeatCount"]) < 10
