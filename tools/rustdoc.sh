#!/bin/sh
# rustdoc.sh ARGUMENTS..: rustdoc for `cargo test --doc`. rustdoc compiles all examples as one program, and if an example does not compile,
# it compiles each example alone, for minutes. The option `--merge-doctests=yes` reports the errors at once. It is unstable, and used only
# if rustdoc has it. The errors have line numbers of the program, so a second call keeps the program, and the examples are named.
set -u
merged() { RUSTC_BOOTSTRAP=1 rustdoc -Z unstable-options --merge-doctests=yes "$@"; }
case " $* " in *" --test "*) ;; *) exec rustdoc "$@" ;; esac
merged --help >/dev/null 2>&1 || exec rustdoc "$@"
merged "$@" && exit
code=$?
kept=$(mktemp -d)
trap 'rm -rf "$kept"' EXIT
TMPDIR=$kept merged -C save-temps "$@" >/dev/null 2>"$kept/errors"
runner=$(find "$kept" -name 'doctest_runner_*.rs' | head -n 1)
sed -n 's/.*\(doctest_bundle_[0-9]*\.rs\):\([0-9]*\):.*/\1 \2/p' "$kept/errors" | while read -r bundle line; do
    example=$(find "$kept" -name "$bundle" -exec sed -n "1,${line}s/^pub mod \(__doctest_[0-9]*\) {/\1/p" {} + | tail -n 1)
    sed -n "/^mod $example {/,/^}/s/^\"\([^\"]* (line [0-9]*)\)\".*/the example does not compile: \1/p" "$runner"
done | sort -u >&2
exit "$code"
