#!/bin/sh
# aarch64.sh FOLDER: check the files that the tests of `trace` wrote into FOLDER. encoded.s is assembled and compared with the bytes of
# armlet's encoder. The other .s files are linked to rust/core/tests/aarch64/harness.c and run in an emulator.
set -eu
here=$(cd "$(dirname "$0")/.." && pwd)
for tool in aarch64-linux-gnu-gcc qemu-aarch64; do
    command -v "$tool" >/dev/null || {
        echo "$tool is missing: install Debian's packages gcc-aarch64-linux-gnu and qemu-user" >&2
        exit 1
    }
done
cd "$1"
aarch64-linux-gnu-as -o encoded.o encoded.s
aarch64-linux-gnu-objcopy -O binary -j .text encoded.o assembled.bin
cmp encoded.bin assembled.bin
echo "encoded.s: $(wc -l <encoded.s) instructions, the assembler's bytes"
for cases in operations programs loops; do
    test -e "$cases.s" || continue
    aarch64-linux-gnu-gcc -O2 -Wall -Wextra -Werror -static -o "$cases" "$here/rust/core/tests/aarch64/harness.c" "$cases.s"
    qemu-aarch64 "./$cases" >"$cases.txt" || { cat "$cases.txt"; exit 1; }
    echo "$cases.s: $(cat "$cases.txt")"
done
