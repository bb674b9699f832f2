"""Unpack an sdist so that cargo sees what changed and nothing else.

A plain unpacking gives every file the archive's fixed time: cargo, which compares times, would rebuild nothing after a
change. So a file is written only where its content differs, and files the sdist does not have are removed.
"""

import sys
import tarfile
from pathlib import Path


def unpack(sdist: Path, into: Path) -> Path:
    """Unpack and return the directory of the package."""
    root = into / sdist.name.removesuffix(".tar.gz")
    wanted = set()
    with tarfile.open(sdist) as archive:
        for member in archive.getmembers():
            path = (into / member.name).resolve()
            if not path.is_relative_to(root.resolve()):
                raise SystemExit(f"{sdist}: {member.name} lies outside {root.name}/")
            stream = archive.extractfile(member)
            if stream is None:
                continue
            wanted.add(path)
            content = stream.read()
            if not path.is_file() or path.read_bytes() != content:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(content)
    for path in root.resolve().rglob("*"):
        if path.is_file() and path not in wanted:
            path.unlink()
    return root


if __name__ == "__main__":
    print(unpack(Path(sys.argv[1]), Path(sys.argv[2])))
