"""`python tools/doc_examples.py`: find public types of the Rust core without an example in their documentation.

The check reads the pages of `cargo doc --package armlet-core`, and fails if a struct, enum or trait has no example.
"""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGES = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "doc" / "armlet_core"
#: Pattern of a link to the page of a type.
TYPE = re.compile(r'href="((?:\w+/)*(?:struct|enum|trait)\.\w+\.html)"')
EXAMPLE = "rust-example-rendered"


def types(pages: Path) -> list[str]:
    """The pages of all public types. The list of items omits pages of earlier builds, which can still be in the folder."""
    return sorted(set(TYPE.findall((pages / "all.html").read_text(encoding="utf-8"))))


def without_example(pages: Path) -> list[str]:
    """The pages of the public types without an example."""
    return [page for page in types(pages) if EXAMPLE not in (pages / page).read_text(encoding="utf-8")]


def main(pages: Path = PAGES) -> int:
    count, missing = len(types(pages)), without_example(pages)
    print("\n".join(f"{page}: no example" for page in missing) or f"{count} public types, each with an example")
    return int(bool(missing) or not count)


if __name__ == "__main__":
    sys.exit(main())
