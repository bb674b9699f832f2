#!/bin/sh
# Print in one line the first program that this machine lacks to build armlet, and exit with 1. Print nothing if nothing is missing.
# With the argument `python`, print the command of a suitable Python instead.
set -eu
missing() { echo "armlet needs $1" >&2; exit 1; }

python=""
for candidate in ${PYTHON:-} python3 python3.14 python3.13 python3.12 python3.11 python; do
    if "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; then python=$candidate; break; fi
done
[ -n "$python" ] || missing "Python >= 3.11, not found on PATH ($(python3 --version 2>&1 | head -n 1)): https://www.python.org/downloads"
"$python" -c 'import venv, ensurepip' >/dev/null 2>&1 || missing "Python's venv and ensurepip modules, missing from $python (on Debian and Ubuntu: apt install python3-venv)"
if [ "${1:-}" = python ]; then echo "$python"; exit 0; fi

cargo --version >/dev/null 2>&1 || missing "Rust (cargo), not found on PATH: https://rustup.rs"
wanted=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
found=$(rustc --version 2>/dev/null | cut -d ' ' -f 2)
[ -n "$found" ] || missing "Rust (rustc), not found on PATH: https://rustup.rs"
oldest=$(printf '%s\n%s\n' "$wanted" "$found" | sort -t . -k 1,1n -k 2,2n | head -n 1)
[ "$oldest" = "$wanted" ] || [ "${found%.*}" = "$wanted" ] || missing "Rust >= $wanted, found $found: rustup update stable"
command -v "${CC:-cc}" >/dev/null 2>&1 || missing "a C linker (${CC:-cc}), not found on PATH (on Debian and Ubuntu: apt install gcc)"
