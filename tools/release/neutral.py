"""neutral.py WHEEL..: remove the build folder from a wheel's bill of materials, and update RECORD. A wheel is never rewritten in part.

maturin names each crate of this repository by its path: path+file:///home/me/armlet/rust/core#armlet-core@0.1.0.
"""

import base64
import hashlib
import os
import re
import sys
import zipfile
from pathlib import Path

# The pattern matches the last `rust` of the path, because a parent folder may have this name too.
PLACE = re.compile(rb'path\+file://[^"#]*/rust/(?=(?:core|py)[#"])')
NEUTRAL = b"path+file:///armlet/rust/"


def neutral(wheel: Path) -> None:
    """Rewrite `wheel` so that its bill of materials names no folder of this machine."""
    with zipfile.ZipFile(wheel) as archive:
        parts = [(info, archive.read(info)) for info in archive.infolist()]
    lines: dict[bytes, bytes] = {}
    for k, (info, data) in enumerate(parts):
        if ".dist-info/sboms/" in info.filename:
            data = PLACE.sub(NEUTRAL, data)
            parts[k] = info, data
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=")
            lines[info.filename.encode()] = b"%s,sha256=%s,%d" % (info.filename.encode(), digest, len(data))
    scratch = wheel.with_name(wheel.name + ".part")
    try:
        with zipfile.ZipFile(scratch, "w", zipfile.ZIP_DEFLATED) as archive:
            for info, data in parts:
                if info.filename.endswith(".dist-info/RECORD"):
                    data = b"".join(lines.get(line.partition(b",")[0], line.rstrip(b"\r\n")) + b"\n" for line in data.splitlines())
                archive.writestr(info, data)
        os.replace(scratch, wheel)
    finally:
        scratch.unlink(missing_ok=True)


if __name__ == "__main__":
    for name in sys.argv[1:]:
        neutral(Path(name))
