#!/bin/sh
# pytest.sh ROOT PYTHON OPTIONS..: the Python tests in two processes, those of the interface and the reference beside all others; each half keeps one core busy.
# The output of the interface tests follows that of the others.
set -eu
root=$1 python=$2
shift 2
log=$(mktemp)
half() { "$python" -P -m pytest -c "$root/pyproject.toml" --rootdir "$root" "$@"; }
half "$root/tests/api" "$root/tests/live" "$root/tests/reference" "$@" >"$log" 2>&1 &
other=$!
trap 'kill "$other" 2>/dev/null || true; rm -f "$log"' EXIT
trap 'exit 130' INT TERM
first=0 second=0
half "$root/tests/identities" "$root/tests/oracles" "$root/tests/parity" "$@" || first=$?
wait "$other" || second=$?
cat "$log"
# 5: no test of this half was asked for.
if [ "$first" = 5 ] && [ "$second" = 5 ]; then exit 5; fi
for code in "$first" "$second"; do if [ "$code" != 0 ] && [ "$code" != 5 ]; then exit "$code"; fi; done
