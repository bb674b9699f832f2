"""Files of robots: `package://name/file` in folders of packages, and xacro files, which the package `xacro` expands.

The package `name` is the first folder with this name among the folders of the search path and the folders one or two levels below. The
search path consists of the caller's folders, then `ROS_PACKAGE_PATH`, then `share` in each folder of `AMENT_PREFIX_PATH`.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

from ._core import example_urdf
from .arguments import file_path, instance, one_line, shown
from .encodings import NotText, decoded
from .errors import InputError, ModelError
from .extras import extra
from .files import open_regular

__all__ = ["robot_file", "robot_text"]

_NAME = "load_urdf"
_SCHEME = "package://"
SearchPath = str | PathLike[str] | Sequence[str | PathLike[str]] | None
# Largest size of a file, the same as for URDF files.
_MOST_BYTES = 16 << 20
# Only one thread may run xacro, because xacro stores its state in variables of its module.
_XACRO = threading.Lock()


def robot_file(source: str, is_xml: bool, search_path: SearchPath, xacro_arguments: Mapping[str, object] | None) -> tuple[str, str | None]:
    """Return the path of the file that `source` names, and its URDF text, after expansion by xacro.

    If `is_xml`, `source` is the XML text of a robot. Then the first result is this text instead of a path, and the second is None.
    """
    folders = _folders(search_path)
    path = source if is_xml else _located(source, folders)
    if is_xml or not path.endswith(".xacro"):
        if xacro_arguments is not None:
            raise InputError(
                f"{_NAME}: xacro_arguments is not used: expected None for what is no .xacro file, got {shown(xacro_arguments)}"
            )
        return path, None if is_xml else _urdf(path)
    return path, _expanded(path, folders, _texts(xacro_arguments))


def robot_text(
    function: str, name: str, source: object, search_path: SearchPath = None, xacro_arguments: Mapping[str, object] | None = None
) -> str:
    """Return the XML of `source`, which is a path, `package://name/file`, or the XML text.

    Raises:
        InputError: `source` is none of these, or the file cannot be read.
    """
    given = file_path(function, source, name)
    if isinstance(source, str) and "<" in source:
        if len(source) > _MOST_BYTES or len(source.encode("utf-8", "replace")) > _MOST_BYTES:
            raise InputError(f"{function}: {name} is too large: expected at most {_MOST_BYTES} bytes")
        return source
    folders = _folders(search_path)
    path = _located(given, folders)
    if path.endswith(".xacro"):
        return _expanded(path, folders, _texts(xacro_arguments))
    try:
        content = _content(path)
        if len(content) > _MOST_BYTES:
            raise InputError(f"{function}: {name} is too large: expected at most {_MOST_BYTES} bytes, got {path}")
        return decoded(content)
    except (OSError, NotText) as error:
        raise InputError(f"{function}: {name} cannot be read: expected a file or its text, got {path} ({one_line(str(error))})") from None


def _urdf(path: str) -> str:
    """The text of a URDF file."""
    try:
        content = _content(path)
    except (OSError, ValueError) as error:  # ValueError: a zero character in the path
        reason = one_line((isinstance(error, OSError) and error.strerror) or str(error))
        hint = f"; al.example_urdf({path!r}) is the text of an example" if _is_example(path) else ""
        problem = f"cannot be read: expected a URDF file or its text, got {path} ({reason}){hint}"
        raise InputError(f"{_NAME}: path_or_xml {problem}") from None
    if len(content) > _MOST_BYTES:
        raise ModelError(f"{_NAME}: {path}:1: is too large: expected at most {_MOST_BYTES} bytes", path, 1)
    try:
        return decoded(content)
    except NotText as error:
        raise ModelError(f"{_NAME}: {path}:{error.line}: {error}", path, error.line) from None


def _content(path: str) -> bytes:
    """The bytes of a regular file. If it is too large, it has more than `_MOST_BYTES`."""
    with open_regular(path) as stream:
        return stream.read(_MOST_BYTES + 1)


def _is_example(name: str) -> bool:
    try:
        example_urdf(name)
    except InputError:
        return False
    return True


def _folders(search_path: SearchPath) -> list[Path]:
    """The folders of the search path: first the caller's folders, then the folders of the environment variables."""
    if search_path is None:
        given: list[Any] = []
    elif isinstance(search_path, str | PathLike):
        given = [search_path]
    else:
        expected = "a folder or a list of folders"
        given = list(instance(_NAME, "search_path", search_path, Sequence, expected))
    folders = [Path(file_path(_NAME, folder, f"search_path[{i}]")) for i, folder in enumerate(given)]
    for i, folder in enumerate(folders):
        if not folder.is_dir():
            raise InputError(f"{_NAME}: search_path[{i}] is no folder: expected one that holds packages, got {folder}")
    listed = os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)
    shares = (os.path.join(prefix, "share") for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix)
    return folders + [Path(folder) for folder in (*listed, *shares) if folder and os.path.isdir(folder)]


def _located(source: str, folders: Sequence[Path]) -> str:
    """Return the path of `package://name/rest`. Other paths are returned unchanged."""
    if not source.startswith(_SCHEME):
        if "://" in source and not os.path.exists(source):
            raise InputError(f"{_NAME}: path_or_xml has an unknown scheme: expected a path or package://name/file, got {shown(source)}")
        return source
    name, _, rest = source.removeprefix(_SCHEME).partition("/")
    if not name or not rest or name in (".", "..") or "\0" in source:
        raise InputError(f"{_NAME}: path_or_xml names no file: expected package://name/file, got {shown(source)}")
    package = _package(name, folders)
    roots = [package.resolve(), *(folder.resolve() for folder in folders)]
    try:
        file = (package / rest).resolve(strict=True)
    except (OSError, RuntimeError):  # RuntimeError: circular links
        raise InputError(f"{_NAME}: path_or_xml is not in its package: expected a file in {package}, got {shown(source)}") from None
    if not any(file.is_relative_to(root) for root in roots):
        problem = "leads out of its package: expected a file inside, or inside a folder of search_path"
        raise InputError(f"{_NAME}: path_or_xml {problem}, got {shown(source)}")
    return str(file)


def _package(name: str, folders: Sequence[Path]) -> Path:
    """The folder of the package `name`."""
    for folder in folders:
        if folder.resolve().name == name:
            return folder
        if (folder / name).is_dir():
            return folder / name
        nested = sorted(path for path in folder.glob(f"*/{_literal(name)}") if path.is_dir())
        if nested:
            return nested[0]
    where = ", ".join(map(str, folders)) or "no folders: give search_path, or set ROS_PACKAGE_PATH or AMENT_PREFIX_PATH"
    raise InputError(f"{_NAME}: package {shown(name)} is not found: expected a folder of that name in {where}")


def _literal(name: str) -> str:
    """Return `name` with the wildcards of `glob` escaped."""
    return "".join(f"[{letter}]" if letter in "*?[" else letter for letter in name)


def _texts(arguments: Mapping[str, object] | None) -> dict[str, str]:
    """Check the arguments of xacro and convert their values to strings."""
    if arguments is None:
        return {}
    instance(_NAME, "xacro_arguments", arguments, Mapping, "values by name")
    texts = {}
    for name, value in arguments.items():
        if not isinstance(name, str) or not isinstance(value, str | bool | int | float):
            problem = "holds what is no argument: expected names with texts, numbers or flags"
            raise InputError(f"{_NAME}: xacro_arguments {problem}, got {shown(name)}: {shown(value)}")
        texts[name] = str(value).lower() if isinstance(value, bool) else str(value)
    return texts


def _expanded(path: str, folders: Sequence[Path], arguments: dict[str, str]) -> str:
    """Expand a xacro file and return the URDF text."""
    xacro = extra(_NAME, "xacro", "xacro")
    if not os.path.isfile(path):
        raise InputError(f"{_NAME}: path_or_xml cannot be read: expected a URDF file or its text, got {path} (no such file)")
    with _XACRO, _packages_of(folders):
        try:
            text = xacro.process_file(path, mappings=arguments).toxml()
        except (MemoryError, ImportError):
            raise
        except Exception as error:  # a macro may raise any error
            raise InputError(f"{_NAME}: path_or_xml is refused by xacro: {path}: {type(error).__name__}: {one_line(str(error))}") from None
    return str(text)


@contextmanager
def _packages_of(folders: Sequence[Path]) -> Iterator[None]:
    """Inside this context, `$(find name)` of xacro searches `folders` first, then xacro's own search path."""
    substitution = extra(_NAME, "xacro.substitution_args", "xacro")
    own = substitution._eval_find

    def find(name: str) -> str:
        try:
            return str(_package(name, folders).resolve())
        except InputError as missing:
            try:
                return str(own(name))
            except ImportError:  # ROS is not installed
                raise InputError(one_line(str(missing)).removeprefix(f"{_NAME}: ")) from None

    substitution._eval_find = find
    try:
        yield
    finally:
        substitution._eval_find = own
