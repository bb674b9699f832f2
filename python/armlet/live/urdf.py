"""The looks of a robot from its URDF: visual geometry where the file has it, capsules between joints where not [URDF].

    X_LS = (R(rpy), xyz) of <origin>, R = Rz(yaw) Ry(pitch) Rx(roll), in the frame of the link

Looks never stop a robot from being shown: what cannot be read is drawn as if it were not there.
"""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

import armlet as al

from .shapes import BLUE, ORANGE, Array, Colour, Shape, between

__all__ = ["find_mesh", "read_shapes"]

ENDINGS = (".stl", ".obj", ".ply", ".glb", ".gltf", ".off", ".dae")


def read_shapes(source: str | Path, arm: al.Arm) -> list[Shape]:
    """What to draw at each frame of an arm that `al.load_urdf(source)` gave."""
    text, folder = _text(source)
    robot = ElementTree.fromstring(text)
    colours = {name: rgb for material in robot.findall("material") if (name := material.get("name")) and (rgb := _rgb(material))}
    frames = set(arm.frame_names)
    skeleton = _skeleton(robot, arm)
    shapes = []
    for link in robot.findall("link"):
        name = link.get("name", "")
        if name not in frames:
            continue
        seen = [shape for visual in link.findall("visual") if (shape := _visual(visual, name, folder, colours))]
        shapes += seen or skeleton.get(name, [])
    return shapes


def _text(source: str | Path) -> tuple[str, Path]:
    if isinstance(source, str) and source.lstrip().startswith("<"):
        return source, Path()
    path = Path(source)
    return path.read_text(encoding="utf-8"), path.resolve().parent


def _skeleton(robot: ElementTree.Element, arm: al.Arm) -> dict[str, list[Shape]]:
    """For every link the capsules from its frame to the joints that hang on it."""
    joints = [(_name(joint, "parent"), _name(joint, "child"), _origin(joint)[:3, 3]) for joint in robot.findall("joint")]
    # A tenth of the mean length, as the links of real arms are.
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


def _visual(visual: ElementTree.Element, frame: str, folder: Path, colours: dict[str, Colour]) -> Shape | None:
    """The shape of a <visual>; None where it is not known or its mesh is not found."""
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
        found = find_mesh(geometry.get("filename", ""), folder)
        path = "" if found is None else str(found)
    else:
        return None
    if not size or (kind == "mesh" and not path) or (kind != "mesh" and min(size) <= 0.0):
        return None
    material = visual.find("material")
    colour = None if material is None else _rgb(material) or colours.get(material.get("name", ""))
    return Shape(frame, kind, size, _origin(visual), colour or (190, 193, 198), path)


def find_mesh(name: str, folder: Path) -> Path | None:
    """The file of a mesh: beside the URDF, or of a package named by one of the folders above it."""
    package = name.startswith(("package://", "model://"))
    path = name.split("://", 1)[1] if "://" in name else name
    candidates = [folder / path]
    if package:
        inside = path.partition("/")[2]
        for above in [folder, *folder.parents]:
            candidates += [above / path] + ([above / inside] if inside else [])
    if name.startswith("file://") and Path(path).is_absolute():
        candidates = [Path(path)]
    return next((file for file in candidates if file.suffix.lower() in ENDINGS and file.is_file()), None)


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
    """`count` finite numbers; () where the text has something else."""
    try:
        numbers = tuple(float(part) for part in (text or "").split())
    except ValueError:
        return ()
    return numbers if len(numbers) == count and all(map(math.isfinite, numbers)) else ()
