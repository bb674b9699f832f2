"""The figures of the examples, in `docs/images/examples`, and the picture of the README."""

from __future__ import annotations

from registry import ROOT, example

for script in sorted((ROOT / "examples").glob("*.py")):
    if "savefig(sys.argv[1]" in script.read_text(encoding="utf-8"):
        example("four_systems.png" if script.stem == "readme_picture" else f"examples/{script.stem}.png", script)
