#!/bin/sh
# build.sh VENV BUILD: make the sdist, build a wheel from the unpacked sdist, and install the wheel in VENV. The core is compiled once.
set -eu
venv=$1 build=$2
dist=$build/dist
rm -rf "$dist"
mkdir -p "$dist"
if ! cargo fetch --locked >"$build/cargo.log" 2>&1; then
    if grep -qiE 'could not resolve|connect|network|timed out|download|offline' "$build/cargo.log"; then
        echo "armlet needs the network once, to download its Rust crates: cargo could not fetch them (log: $build/cargo.log)" >&2
    else
        echo "armlet: cargo fetch failed: $(grep -m 1 '^error' "$build/cargo.log" || tail -n 1 "$build/cargo.log") (log: $build/cargo.log)" >&2
    fi
    exit 1
fi
"$venv/bin/maturin" sdist --out "$dist" >"$build/sdist.log" 2>&1 || { cat "$build/sdist.log" >&2; exit 1; }
ls "$dist"/armlet-*.tar.gz >"$build/sdist.path"
unpacked=$("$venv/bin/python" tools/unpack_sdist.py "$(cat "$build/sdist.path")" "$build/sdist")
(cd "$unpacked" && "$venv/bin/maturin" build --release --locked --out "$dist" --interpreter "$venv/bin/python")
ls "$dist"/armlet-*.whl >"$build/wheel.path"
"$venv/bin/python" tools/release/neutral.py "$(cat "$build/wheel.path")"
"$venv/bin/python" -m pip install --quiet --force-reinstall --no-deps "$(cat "$build/wheel.path")"
