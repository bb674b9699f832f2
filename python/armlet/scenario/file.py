"""Read the tables of a scenario file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..errors import InputError
from ..files import open_regular

__all__ = ["read"]

# Largest size of a file, bytes. A scenario that contains the text of its robot file is smaller.
MOST_BYTES = 32 << 20


def read(file: Path) -> dict[str, Any]:
    """Return the tables of a TOML file. The InputError of a fault names its line, and the InputError of a robot file names its commands."""
    import tomllib

    text = _text(file)
    try:
        return tomllib.loads(text)
    # An integer of thousands of digits raises ValueError, thousands of nested brackets raise RecursionError.
    except (ValueError, RecursionError) as error:
        raise InputError(f"{file}: {_robot(file, text) or f'is not TOML: {error}'}") from None


def _text(file: Path) -> str:
    """Return the text of a file. Refuse a file that is too large, such as an endless device."""
    with open_regular(file) as stream:
        content = stream.read(MOST_BYTES + 1)
    if len(content) > MOST_BYTES:
        raise InputError(f"{file}: is too large: expected at most {MOST_BYTES} bytes")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{file}: is not TOML, which is UTF-8 text: {error}") from None


def _robot(file: Path, text: str) -> str:
    """The problem of a robot file in place of a scenario. The result is empty for any other text."""
    if not text.lstrip("\N{BOM} \n\r\t").startswith("<"):
        return ""
    wanted = "expected a TOML file such as `armlet new adaptive` prints"
    if "<mujoco" in text:
        return f"is a model of MuJoCo, not a scenario: {wanted}"
    if "<robot" not in text:
        return ""
    arm = f'arm = {{ kind = "urdf", path = "{file.name}" }}'
    return f"is a robot file, not a scenario: {wanted}, with {arm}; `armlet check {file}` lists the joints, `armlet view {file}` shows them"
