"""A run as a film: lines between the joints of the arm, and the path of its tip. Planar arms are drawn in their plane."""

from __future__ import annotations

import base64
import errno
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from .._core import Arm
from ..arguments import file_path, finite, instance, integer, positive, shown
from ..errors import InputError
from ..files import write_whole
from .skeleton import Picture, Skeleton
from .style import literal, require

if TYPE_CHECKING:
    from ..run.recorded import Recorded

__all__ = ["Film", "animate"]

# The largest number of pictures of a film. At 50 pictures per second, the film then lasts 400 s.
PICTURES = 20_000


class Film:
    """A film in a file, which `Run.animate` returns. A notebook shows it below the cell."""

    def __init__(self, path: str) -> None:
        #: The path of the file.
        self.path = path

    def __fspath__(self) -> str:
        return self.path

    def __repr__(self) -> str:
        return f"<Film: {self.path}>"

    def _repr_html_(self) -> str | None:
        """The film as HTML with its data, so that the notebook does not depend on the file. None if the file is missing."""
        try:
            data = base64.b64encode(Path(self.path).read_bytes()).decode()
        except OSError:
            return None
        if self.path.lower().endswith(".mp4"):
            return f'<video controls loop src="data:video/mp4;base64,{data}"></video>'
        return f'<img alt="The arm in motion" src="data:image/gif;base64,{data}">'


def animate(
    run: Recorded,
    path: str | PathLike[str],
    arm: Any = None,
    *,
    fps: float = 25.0,
    speed: float = 1.0,
    size: int = 400,
    view: ArrayLike | None = None,
) -> Film:
    """Write a run as a film. The arm must have frames, and may have branches and prismatic joints.

    Blue lines are the links, grey lines the displacements of prismatic joints, and the orange line is the path of `arm.tip_frame`. An arm
    whose joints and tips stay in a plane of two world axes is drawn in that plane. Another arm, or any arm with `view`, is drawn in space,
    with its shadow on the floor of the picture. If an error occurs, no incomplete file remains.

    Args:
        run: the run.
        path: the file. If its name ends in .mp4, the film is MP4, which requires the program ffmpeg. Otherwise it is GIF.
        arm: the arm, for a run without an arm, such as a run that was loaded from a file.
        fps: pictures per second of the film, at most 50.
        speed: seconds of the run per second of the film.
        size: width and height, pixels; for MP4 they are rounded up to an even number.
        view: elevation and azimuth of the eye, degrees, for a picture in space; None: (22, -56), or the plane of the arm if it has one.

    Returns:
        The film, which is a path of the file.

    Raises:
        InputError: no frame of the arm moves, the arm is missing or has another number of joints, or the run has fewer than two records. It
            is also raised if an argument is out of range, or the name ends in .mp4 and ffmpeg is not installed.
        ImportError: matplotlib is not installed.
        OSError: the file cannot be written, or ffmpeg failed.
    """
    path = file_path("Run.animate", path)
    fps, speed = positive("Run.animate", "fps", fps, 50.0), positive("Run.animate", "speed", speed, 1e9)
    size = int(positive("Run.animate", "size", integer("Run.animate", "size", size), 4096))
    eye = None if view is None else finite("Run.animate", "view", _core.numbers("Run.animate", "view", view, (2,)))
    arm = run.arm if arm is None else arm
    if arm is None:
        raise InputError("Run.animate: arm is missing: expected the arm of a run that was read from a file")
    instance("Run.animate", "arm", arm, Arm, "an Arm")
    if arm.n != run.q.shape[-1]:
        raise InputError(f"Run.animate: arm is not that of the run: expected {run.q.shape[-1]} joints, got {arm.n}")
    if len(run.t) < 2:
        raise InputError("Run.animate: there is nothing to draw: expected a run of two records or more")
    if not (run.t[-1] - run.t[0]) * fps / speed <= PICTURES:
        raise InputError(f"Run.animate: speed is too small: expected at most {PICTURES} pictures, got {shown(speed)}")
    skeleton = Skeleton("Run.animate", arm)
    coder = _coder(path)
    require("Run.animate")
    times = np.arange(run.t[0], run.t[-1], speed / fps)
    q = np.stack([np.interp(times, run.t, run.q[:, i]) for i in range(run.q.shape[1])], axis=1)
    lines = skeleton.lines(q)
    picture = Picture("Run.animate", lines.cloud(), size + size % 2 if coder else size, None if eye is None else (eye[0], eye[1]))
    path_of = f"orange: path of {literal(arm.tip_frame)}"

    def pictures() -> Iterator[NDArray[np.uint8]]:
        for k, time in enumerate(times):
            picture.show(lines, k, f"t = {time:.2f} s; {path_of}")
            yield picture.pixels()

    write_whole(path, lambda file: _mp4(file, pictures(), fps, coder) if coder else _gif(file, pictures(), fps))
    return Film(path)


def _coder(path: str) -> str | None:
    """The path of the program ffmpeg for an MP4 file; None for a GIF file."""
    if not path.lower().endswith(".mp4"):
        return None
    found = shutil.which("ffmpeg")
    if found is None:
        raise InputError(f"Run.animate: path requires ffmpeg, which is not installed: expected a name that ends in .gif, got {shown(path)}")
    return found


def _gif(file: IO[bytes], pictures: Iterator[NDArray[np.uint8]], fps: float) -> None:
    from PIL import Image

    first = Image.fromarray(next(pictures))
    rest = (Image.fromarray(each) for each in pictures)
    first.save(file, format="GIF", save_all=True, append_images=rest, duration=round(1000 / fps), loop=0)


def _mp4(file: IO[bytes], pictures: Iterator[NDArray[np.uint8]], fps: float, coder: str) -> None:
    """Write a film with ffmpeg. ffmpeg writes to a temporary file, because it returns to the start of an MP4 file to complete it."""
    first = next(pictures)
    height, width, _ = first.shape
    with tempfile.TemporaryDirectory(prefix="armlet-") as folder:
        film, said = Path(folder, "film.mp4"), Path(folder, "said")
        source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{fps:.6g}", "-i", "-"]
        command = [coder, "-loglevel", "error", *source, "-pix_fmt", "yuv420p", "-movflags", "+faststart", str(film)]
        with said.open("wb") as log, subprocess.Popen(command, stdin=subprocess.PIPE, stdout=log, stderr=log) as process:
            try:
                assert process.stdin is not None
                process.stdin.write(first.tobytes())
                for picture in pictures:
                    process.stdin.write(picture.tobytes())
                process.stdin.close()
            except BrokenPipeError:
                pass  # ffmpeg has ended early, and its message is in the log
            except BaseException:
                process.kill()
                raise
        if process.returncode != 0:
            words = said.read_text(errors="replace").strip().splitlines() or ["no message"]
            raise OSError(errno.EIO, f"ffmpeg failed: {words[-1]}")
        with film.open("rb") as made:
            shutil.copyfileobj(made, file)
