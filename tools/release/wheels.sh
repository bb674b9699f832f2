#!/bin/sh
# wheels.sh OUT [TARGET..]: write the sdist into OUT, and wheels for the targets; by default the targets that this system can build.
#   Linux     x86_64-unknown-linux-gnu aarch64-unknown-linux-gnu    linked by zig against glibc 2.17 (manylinux2014): needs `pip install ziglang`
#   macOS     universal2-apple-darwin                              needs Xcode's command line tools
#   Windows   x86_64-pc-windows-msvc                               in Git Bash, with the Visual Studio build tools
# Needs maturin and Rust; the standard libraries of the targets come by rustup.
set -eu
out=${1:?usage: wheels.sh OUT [TARGET..]}
shift
mkdir -p "$out"
out=$(cd "$out" && pwd)
python=${PYTHON:-python3}
case $(uname -s) in
    Linux) linked=--zig; tag='--compatibility manylinux2014'; default='x86_64-unknown-linux-gnu aarch64-unknown-linux-gnu' ;;
    Darwin) linked=; tag=; default=universal2-apple-darwin ;;
    *) linked=; tag=; default=x86_64-pc-windows-msvc ;;
esac
if test -n "$linked" && ! "$python" -c 'import ziglang' 2>/dev/null; then
    echo "wheels.sh: ziglang is not installed: $python -m pip install ziglang" >&2
    exit 1
fi
"$python" -m maturin sdist --out "$out"
source=$("$python" tools/unpack_sdist.py "$(ls "$out"/armlet-*.tar.gz)" "$out/source")
for target in ${*:-$default}; do
    case $target in
        universal2-apple-darwin) rustup target add x86_64-apple-darwin aarch64-apple-darwin ;;
        *) rustup target add "$target" ;;
    esac
    # shellcheck disable=SC2086 # two words, or none
    (cd "$source" && "$python" -m maturin build --release --locked $linked $tag --target "$target" --out "$out")
done
rm -rf "$out/source"
"$python" tools/release/neutral.py "$out"/armlet-*.whl
"$python" tools/release/check_wheel.py "$out"/armlet-*.whl
