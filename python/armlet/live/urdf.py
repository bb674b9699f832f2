"""The shapes of a robot from its URDF [URDF].

    X_LS = (R(rpy), xyz) of <origin>, R = Rz(yaw) Ry(pitch) Rx(roll), in the frame of the link

A link is drawn with its geometry, if it has any: boxes, cylinders, spheres, and meshes whose files are found. Another link is a set of
capsules from its frame to its child joints. Without such capsules it is a sphere, drawn only if no link has geometry.

A shape with invalid numbers is not drawn. The file names its meshes, and may come from an untrusted source. So a mesh must be inside the
folder of the URDF or of a package of the user, after symbolic links are resolved.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

import armlet as al

from ..robot_files import robot_text
from .shapes import BLUE, ORANGE, Array, Colour, Shape, between

__all__ = ["Looks", "find_mesh", "missing_line", "read_shapes"]

# File types that trimesh can read. Collada (.dae) requires the package `collada`.
ENDINGS = (".stl", ".obj", ".ply", ".glb", ".gltf", ".off", *([".dae"] if find_spec("collada") else []))


# Largest size of a mesh file, bytes.
MOST_BYTES = 1 << 28
DECLARATION = re.compile(r"<\?xml\s.*?\?>", re.DOTALL)


class Looks(NamedTuple):
    """The shapes of a robot, and the names of the missing meshes."""

    shapes: list[Shape]
    missing: tuple[str, ...]


def missing_line(missing: Sequence[str]) -> str:
    """The note of a page about missing meshes; empty if none is missing."""
    if not missing:
        return ""
    first = missing[0] if len(missing[0]) <= 80 else f"{missing[0][:77]}..."
    return f"{len(missing)} meshes are not drawn, {first} first: they are not in the folder of the file, nor in one given by --package"


def read_shapes(source: str | Path, arm: al.Arm, packages: Sequence[Path] = ()) -> Looks:
    """Return the shapes at each frame of an arm from `al.load_urdf(source)`, with meshes of its folder and of `packages`."""
    text, folders = _text(source, packages)
    try:
        # The XML declaration is removed: text needs none, and this parser refuses a declaration after a comment.
        robot = ElementTree.fromstring(DECLARATION.sub("", text, count=1))
    except ElementTree.ParseError:  # `al.load_urdf` uses another parser
        return Looks([], ())
    missing: dict[str, None] = {}
    colours = {name: rgb for material in robot.findall("material") if (name := material.get("name")) and (rgb := _rgb(material))}
    frames = set(arm.frame_names)
    skeleton = _skeleton(robot, arm)
    shapes: list[Shape] = []
    plain: list[Shape] = []
    for link in robot.findall("link"):
        name = link.get("name", "")
        if name not in frames:
            continue
        # If no visual can be drawn, the collision shapes are drawn.
        for tag in ("visual", "collision"):
            seen = [shape for looks in link.findall(tag) if (shape := _visual(looks, name, folders, colours, missing))]
            if seen:
                break
        shapes += seen
        plain += [] if seen else skeleton[name]
    # Spheres mark the ends of a robot without geometry. With geometry, a sphere would look like a part of the robot.
    return Looks(shapes + [shape for shape in plain if not shapes or shape.kind == "capsule"], tuple(missing))


def _text(source: str | Path, packages: Sequence[Path]) -> tuple[str, list[Path]]:
    """The text of the URDF, and the folders in which its meshes may be."""
    if isinstance(source, str) and "<" in source:  # the rule of `al.load_urdf` for texts
        return source, [*packages]
    path = Path(source)
    return robot_text("read_shapes", "source", path), [path.resolve().parent, *packages]


def _skeleton(robot: ElementTree.Element, arm: al.Arm) -> dict[str, list[Shape]]:
    """For every link: capsules from its frame to its child joints, or a sphere if it has none."""
    joints = [(_name(joint, "parent"), _name(joint, "child"), _origin(joint)[:3, 3]) for joint in robot.findall("joint")]
    # The radius is about a tenth of the mean length, as for links of real arms.
    lengths = [float(np.linalg.norm(offset)) for _, _, offset in joints]
    long = [length for length in lengths if length > 0.0]
    radius = min(max(0.12 * sum(long) / len(long), 1e-3), 0.1) if long else 0.02
    shapes: dict[str, list[Shape]] = {}
    for k, frame in enumerate(arm.frame_names):
        colour = BLUE if k % 2 == 0 else ORANGE
        arms = [between(frame, (0.0, 0.0, 0.0), offset, radius, colour) for parent, _, offset in joints if parent == frame]
        arms = [shape for shape in arms if shape.size[1] > 0.0]
        shapes[frame] = arms or [Shape(frame, "sphere", (1.2 * radius,), colour=colour)]
    return shapes


def _name(joint: ElementTree.Element, tag: str) -> str:
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")


def _visual(
    visual: ElementTree.Element, frame: str, folders: Sequence[Path], colours: dict[str, Colour], missing: dict[str, None]
) -> Shape | None:
    """The shape of a <visual> or <collision> element; None if its kind is unknown or its mesh is missing."""
    geometry = visual.find("geometry/*")
    if geometry is None:
        return None
    kind, path = geometry.tag, ""
    if kind == "box":
        size = _numbers(geometry.get("size"), 3)
    elif kind == "cylinder":
        size = _numbers(f"{geometry.get('radius')} {geometry.get('length')}", 2)
    elif kind == "sphere":
        size = _numbers(geometry.get("radius"), 1)
    elif kind == "mesh":
        size = _numbers(geometry.get("scale", "1 1 1"), 3)
        name = geometry.get("filename", "")
        found = find_mesh(name, folders)
        path = "" if found is None else str(found)
        if found is None and name:
            missing[name] = None
    else:
        return None
    if not size or (kind == "mesh" and not path) or (kind != "mesh" and min(size) <= 0.0):
        return None
    material = visual.find("material")
    colour = None if material is None else _rgb(material) or colours.get(material.get("name", ""))
    return Shape(frame, kind, size, _origin(visual), colour or (190, 193, 198), path)


def find_mesh(name: str, folders: Sequence[Path]) -> Path | None:
    """Return the file of a mesh, or None if it is not found. It must be inside one of `folders`; the first is the folder of the URDF.

    `package://name/rest` means `name/rest` in any of the folders, or `rest` in the first folder or in a folder called `name`.
    """
    scheme, separator, path = name.partition("://")
    if separator and scheme not in ("package", "model", "file"):
        return None
    wanted: list[tuple[Path, str]] = []
    if scheme in ("package", "model") and separator:
        package, _, rest = path.partition("/")
        for k, folder in enumerate(folders):
            wanted += [(folder, path)] + ([(folder, rest)] if k == 0 or folder.resolve().name == package else [])
    else:
        wanted = [(folder, path if separator else name) for folder in folders[:1]]
    roots = [folder.resolve() for folder in folders]
    return next((file for folder, rest in wanted if (file := _inside(folder / rest, roots)) is not None), None)


def _inside(path: Path, roots: Sequence[Path]) -> Path | None:
    """Return `path` with symbolic links resolved, if it is a mesh file of at most MOST_BYTES inside one of `roots`; else None."""
    try:
        file = path.resolve(strict=True)
        known = file.suffix.lower() in ENDINGS and file.is_file() and file.stat().st_size <= MOST_BYTES
    except (OSError, ValueError, RuntimeError):  # file missing, NUL in its name, circular links
        return None
    return file if known and any(file.is_relative_to(root) for root in roots) else None


def _origin(element: ElementTree.Element) -> Array:
    origin = element.find("origin")
    pose = np.eye(4)
    if origin is None:
        return pose
    roll, pitch, yaw = _numbers(origin.get("rpy"), 3) or (0.0, 0.0, 0.0)
    (cr, cp, cy), (sr, sp, sy) = (map(f, (roll, pitch, yaw)) for f in (math.cos, math.sin))
    pose[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    pose[:3, 3] = _numbers(origin.get("xyz"), 3) or (0.0, 0.0, 0.0)
    return pose


def _rgb(material: ElementTree.Element) -> Colour | None:
    colour = material.find("color")
    rgba = () if colour is None else _numbers(colour.get("rgba"), 4)
    if not rgba:
        return None
    red, green, blue = (round(255 * min(max(part, 0.0), 1.0)) for part in rgba[:3])
    return red, green, blue


def _numbers(text: str | None, count: int) -> tuple[float, ...]:
    """Return `count` finite numbers of a text; () if the text has other content."""
    try:
        numbers = tuple(float(part) for part in (text or "").split())
    except ValueError:
        return ()
    return numbers if len(numbers) == count and all(map(math.isfinite, numbers)) else ()
