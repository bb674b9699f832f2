"""An arm on the page: shapes attached to one node per frame, and handles to drag.

A root node rotates the axes of the arm's base to the axes of the scene. All shapes and handles are attached to it, so their positions are
in the axes of the base.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from itertools import count
from typing import Any

import numpy as np

from .. import rotations
from .server import Server
from .shapes import Array, Shape

__all__ = ["ArmScene"]

GREEN, RED = (0, 158, 115), (213, 94, 0)
# Each arm has nodes with new names. Otherwise a page that has not yet removed an old node would show a new node at the pose of the old one.
ROOTS = count()


def mesh_of(shape: Shape) -> tuple[Any, Any]:
    """Vertices (k, 3), m, and faces (f, 3) of a shape, in the shape's axes."""
    trimesh = importlib.import_module("trimesh")
    made = trimesh.creation
    if shape.kind == "mesh":
        try:
            body = trimesh.load(shape.path, force="mesh")
            vertices, faces = body.vertices * np.array(shape.size), body.faces
        except Exception:  # trimesh may raise any error for a damaged file
            faces = ()
        # A sphere marks a link whose mesh cannot be drawn.
        return (vertices, faces) if len(faces) else mesh_of(Shape(shape.frame, "sphere", (0.02,)))
    if shape.kind == "box":
        body = made.box(extents=shape.size)
    elif shape.kind == "sphere":
        body = made.icosphere(radius=shape.size[0], subdivisions=3)
    else:
        maker = made.cylinder if shape.kind == "cylinder" else made.capsule
        body = maker(radius=shape.size[0], height=shape.size[1])
    # trimesh documents the origin of a capsule at its lower centre, but version 5.2.0 places it in the middle. The next lines place it in
    # the middle in both cases.
    middle = 0.5 * (body.vertices.max(axis=0) + body.vertices.min(axis=0))
    return body.vertices - middle, body.faces


class ArmScene:
    """The drawing of one arm. `bodies` are its shapes that are fixed to frames, with the names of the frames."""

    def __init__(self, server: Server, shapes: list[Shape], rotation: Array, reach: float) -> None:
        self.server, self.rotation, self.reach = server, rotation, reach
        self.frames: dict[str, Any] = {}
        self.bodies: list[tuple[str, Any]] = []
        scene = server.scene
        scene.set_up_direction("+z")
        # Shadows are always off, because a machine may have no graphics card.
        scene.configure_default_lights(cast_shadow=False)
        scene.add_grid("/grid", 6.0 * reach, 6.0 * reach, cell_size=0.25 * reach, section_size=reach)
        self.root = f"/arm{next(ROOTS)}"
        scene.add_frame(self.root, show_axes=False, wxyz=rotations.of_matrix(rotation))
        for k, shape in enumerate(shapes):
            handle = self._body(k, shape)
            if shape.frame is not None:
                self.bodies.append((shape.frame, handle))
        self._goal = scene.add_icosphere(f"{self.root}/desired", radius=0.03 * reach, color=GREEN, opacity=0.6, visible=False)

    def _body(self, k: int, shape: Shape) -> Any:
        scene, parent = self.server.scene, self.root
        if shape.frame is not None:
            if shape.frame not in self.frames:
                sizes = {"axes_length": 0.12 * self.reach, "axes_radius": 0.004 * self.reach}
                # Numbers name the nodes, because a link may be called a/b, which would be a child of the node a.
                self.frames[shape.frame] = scene.add_frame(f"{self.root}/frame{len(self.frames)}", show_axes=False, **sizes)
            parent = self.frames[shape.frame].name
        vertices, faces = mesh_of(shape)
        placed = {"position": shape.pose[:3, 3], "wxyz": rotations.of_matrix(shape.pose[:3, :3])}
        return scene.add_mesh_simple(f"{parent}/shape{k}", vertices, faces, color=shape.colour, **placed)

    def aim_camera(self) -> None:
        """Move the camera of every browser so that the whole arm is visible."""
        camera = self.server.initial_camera
        eye, at = self.reach * np.array([0.3, -2.0, 0.9]), self.reach * np.array([0.0, 0.0, 0.15])
        camera.position, camera.look_at = eye, at
        for client in self.server.get_clients().values():
            client.camera.position, client.camera.look_at = eye, at

    def place(self, poses: Mapping[str, Array]) -> None:
        """Move the arm. `poses` contains the pose of each frame, (4, 4), in the axes of the arm's base."""
        for frame, pose in poses.items():
            self.frames[frame].position = pose[:3, 3]
            self.frames[frame].wxyz = rotations.of_matrix(pose[:3, :3])

    def goal(self, point: Array | None) -> None:
        """Show the desired position of the tip, (3,), m; None hides it."""
        self._goal.visible = point is not None
        if point is not None:
            self._goal.position = point

    def handle(self, name: str, point: Array, planar: bool, moved: Callable[[Array], None]) -> Any:
        """Add a handle that the mouse can drag. `moved` is called with its new position, (3,), m, in the axes of the arm's base."""
        gizmo = self.server.scene.add_transform_controls(
            f"{self.root}/target {name}",
            scale=0.3 * self.reach,
            active_axes=(True, True, not planar),
            disable_rotations=True,
            depth_test=False,
            position=point,
        )
        self.server.scene.add_icosphere(f"{self.root}/target {name}/ball", radius=0.02 * self.reach, color=RED)
        self.server.scene.add_label(f"{self.root}/target {name}/label", name, position=(0.0, 0.05 * self.reach, 0.0))

        # This function is a coroutine, so that the positions of a drag arrive in order.
        @gizmo.on_update  # type: ignore[untyped-decorator]
        async def _(event: Any) -> None:
            moved(np.array(event.target.position))

        return gizmo

    def clear(self) -> None:
        """Remove all objects from the page."""
        self.server.scene.reset()
