"""check_wheel.py WHEEL..: check that the content of each wheel agrees with its tags and metadata. The exit code is 1 if it does not.

A wheel must contain one extension for the stable ABI, of the processor and system in its tag. The extension must not use symbols of a
newer glibc than the tag allows. The wheel must contain the licence, the types, and a bill of materials (CycloneDX, written by maturin)
that names no folder of the build. It must contain nothing else except the package.
"""

import re
import struct
import sys
import zipfile
from pathlib import Path

# Codes of the processor in ELF (offset 18), Mach-O (cputype, offset 4) and PE (after the PE signature).
ELF = {62: "x86_64", 183: "aarch64"}
MACHO = {0x01000007: "x86_64", 0x0100000C: "arm64"}
PE = {0x8664: "amd64", 0xAA64: "arm64"}


def machine(binary: bytes) -> str:
    """System and processor of a shared library, read from its header."""
    if binary[:4] == b"\x7fELF":
        return f"linux_{ELF.get(struct.unpack_from('<H', binary, 18)[0], 'unknown')}"
    if binary[:4] == b"\xcf\xfa\xed\xfe":
        return f"macosx_{MACHO.get(struct.unpack_from('<I', binary, 4)[0], 'unknown')}"
    if binary[:4] == b"\xca\xfe\xba\xbe":
        return "macosx_universal2"
    if binary[:2] == b"MZ":
        at = struct.unpack_from("<I", binary, 0x3C)[0]
        return f"win_{PE.get(struct.unpack_from('<H', binary, at + 4)[0], 'unknown')}"
    return "unknown"


def faults(wheel: Path) -> list[str]:
    """The faults of a wheel, one line each."""
    name, version, _, abi, platform = wheel.name.removesuffix(".whl").split("-")
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        binaries = [n for n in names if n.endswith((".so", ".pyd", ".dylib", ".dll"))]
        found = [] if len(binaries) == 1 else [f"expected one extension, got {binaries}"]
        binary = archive.read(binaries[0]) if binaries else b""
        bills = {n: archive.read(n) for n in names if ".dist-info/sboms/" in n}
    system, _, processor = machine(binary).partition("_")
    if not (platform.startswith((system, f"many{system}")) and platform.endswith(processor)):
        found.append(f"the tag says {platform}, the extension is of {system} {processor}")
    if abi != "abi3":
        found.append(f"expected the stable ABI, got {abi}")
    if allowed := re.search(r"manylinux_(\d+)_(\d+)_", platform):
        used = {tuple(map(int, number)) for number in re.findall(rb"GLIBC_(\d+)\.(\d+)", binary)}
        newest = max(used, default=(0, 0))
        if newest > tuple(map(int, allowed.groups())):
            found.append(f"the tag allows glibc {allowed[1]}.{allowed[2]}, the extension asks for {newest[0]}.{newest[1]}")
    info = f"{name}-{version}.dist-info/"
    wanted = (f"{name}/__init__.py", f"{name}/py.typed", f"{info}METADATA", f"{info}licenses/LICENSE")
    found += [f"{part} is missing" for part in wanted if part not in names]
    if not bills:
        found.append("the bill of materials is missing")
    places = {place.decode() for bill in bills.values() for place in re.findall(rb'path\+file://(?!/armlet/rust/)[^"#]*', bill)}
    found += [f"the bill of materials names a folder of the build: {place}" for place in sorted(places)]
    found += [f"{n} does not belong" for n in names if not n.startswith((f"{name}/", info)) or n.endswith(".pyc")]
    return found


def main(wheels: list[str]) -> int:
    if not wheels:
        print("usage: check_wheel.py WHEEL..", file=sys.stderr)
        return 2
    wrong = {wheel: faults(Path(wheel)) for wheel in wheels}
    for wheel, lines in wrong.items():
        print(f"{Path(wheel).name}: {'; '.join(lines) or 'ok'} ({Path(wheel).stat().st_size / 1e6:.1f} MB)")
    return 1 if any(wrong.values()) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
