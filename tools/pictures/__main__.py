"""`python tools/pictures [NAME..]`: draw the pictures of `docs/images` whose sources have changed, or the named ones.

`python tools/pictures --check` lists pictures that are not up to date. `tests/api/test_pictures.py` fails if there are any.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

sys.path.insert(0, str(Path(__file__).parent))
import pages  # noqa: F401  # registers the pictures
from registry import HASHES, IMAGES, PICTURES, ROOT, Picture, file_hash, hashes, stale

#: Run an example, and store its figure with 90 dots per inch. Arguments: the script and the file.
EXAMPLE = """
import runpy, sys
from matplotlib.figure import Figure
save = Figure.savefig
Figure.savefig = lambda figure, file, **options: save(figure, file, **options | {"dpi": 90})
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""
#: Text is drawn as outlines, and the file has neither date nor random names.
SVG = {"svg.fonttype": "path", "svg.hashsalt": "armlet", "path.simplify_threshold": 0.3}

#: The duration of one pass of a moving picture, and the number of passes.
SECONDS, REPEATS = 4, 8


def moving(text: str, figure: Figure, gid: str, ax: Axes, frames: NDArray[np.float64]) -> str:
    """Let the line `gid` of an SVG move through `frames`, (K, points, 2), in the coordinates of `ax`. It stops after a few repetitions."""
    points = ax.transData.transform(frames.reshape(-1, 2)) * 72.0 / figure.dpi
    points[:, 1] = 72.0 * figure.get_size_inches()[1] - points[:, 1]
    paths = ["M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in path) for path in points.reshape(frames.shape)]
    motion = f'<animate attributeName="d" dur="{SECONDS}s" repeatCount="{REPEATS}" fill="freeze" values="{";".join(paths)}"/>'
    found = re.search(rf'<g id="{gid}">\s*<path [^>]*/>', text)
    assert found is not None, gid
    return text[: found.end() - 2] + f">{motion}</path>" + text[found.end() :]


def draw(picture: Picture) -> bool:
    """Write the file of a picture. Return False if an example did not draw it, for example because a package is missing."""
    picture.file.parent.mkdir(parents=True, exist_ok=True)
    if picture.draw is None:
        command = [sys.executable, "-P", "-c", EXAMPLE, str(ROOT / picture.inputs[0]), str(picture.file)]
        if subprocess.run(command, check=False, stdout=subprocess.DEVNULL, env={**os.environ, "MPLBACKEND": "agg"}).returncode:
            return False
        with Image.open(picture.file) as drawn:
            few = drawn.convert("RGB").quantize(64)
        few.save(picture.file, optimize=True)
        return True
    figure = picture.figure()
    with matplotlib.rc_context(SVG):
        figure.savefig(picture.file, metadata={"Date": None, "Creator": None}, facecolor="white")
    text = picture.file.read_text(encoding="utf-8")
    # The title is for readers who hear the page. Points of a curve need no more digits than a screen has.
    text = re.sub(r"(<svg [^>]*>)", rf"\1\n <title>{picture.title}</title>", text, count=1)
    for motion in getattr(figure, "motions", []):
        text = moving(text, figure, *motion)
    text = re.sub(r'(?<= d=")[^"]+', lambda path: re.sub(r"-?\d+\.\d{3,}", lambda n: f"{float(n.group()):.2f}", path.group()), text)
    picture.file.write_text(re.sub(r"[ \t]+\n", "\n", text), encoding="utf-8")
    return True


def main(arguments: list[str]) -> int:
    if arguments == ["--check"]:
        found = stale()
        print("\n".join(found) or f"{len(PICTURES)} pictures, all drawn from their sources")
        return int(bool(found))
    unknown = [name for name in arguments if name not in PICTURES]
    if unknown:
        print(f"no picture has the name {unknown[0]}: {', '.join(PICTURES)}")
        return 1
    stored = hashes()
    chosen = arguments or [name for name in PICTURES if any(fault.startswith(f"{name}: ") for fault in stale(stored))]
    for name in chosen:
        if not draw(PICTURES[name]):
            continue
        stored[name] = {"sources": PICTURES[name].hash(), "file": file_hash(PICTURES[name].file)}
        print((IMAGES / name).relative_to(ROOT))
    row = '"{0}" = {{ sources = "{1[sources]}", file = "{1[file]}" }}\n'
    HASHES.write_text("".join(row.format(*item) for item in sorted(stored.items()) if item[0] in PICTURES), encoding="utf-8")
    return int(any(fault.split(": ")[0] in chosen for fault in stale(stored)))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
