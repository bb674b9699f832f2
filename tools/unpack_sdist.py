"""Unpack an sdist so that cargo rebuilds only changed files.

An archive gives every file the same fixed time. cargo compares times, so it would miss changes after a plain unpacking. This program
writes a file only if its content differs, and removes files that the sdist does not contain.
"""

import sys
import tarfile
from pathlib import Path


def unpack(sdist: Path, into: Path) -> Path:
    """Unpack `sdist` into the folder `into`, and return the folder of the package."""
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
