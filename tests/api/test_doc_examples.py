"""tools/doc_examples.py detects a public type of the Rust core without an example."""

from __future__ import annotations

from pathlib import Path

import pytest
from scripts import imported

TOOL = Path(__file__).resolve().parents[2] / "tools" / "doc_examples.py"


def test_a_type_without_an_example_is_found(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tool = imported(TOOL)
    (tmp_path / "arm").mkdir()
    (tmp_path / "all.html").write_text(
        '<a href="arm/struct.Arm.html">Arm</a><a href="arm/enum.Kind.html">Kind</a><a href="arm/fn.example.html">example</a>'
    )
    (tmp_path / "arm" / "struct.Arm.html").write_text('<pre class="rust rust-example-rendered"></pre>')
    kind = tmp_path / "arm" / "enum.Kind.html"
    kind.write_text("<pre></pre>")
    # This page is not in the list of items.
    (tmp_path / "arm" / "struct.Old.html").write_text("<pre></pre>")
    assert tool.main(tmp_path) == 1
    assert capsys.readouterr().out == "arm/enum.Kind.html: no example\n"
    kind.write_text('<pre class="rust rust-example-rendered"></pre>')
    assert tool.main(tmp_path) == 0
    assert capsys.readouterr().out == "2 public types, each with an example\n"
    (tmp_path / "all.html").write_text("")
    assert tool.main(tmp_path) == 1
