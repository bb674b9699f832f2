#!/bin/sh
# pytest.sh ROOT PYTHON OPTIONS..: run the Python tests in two processes at the same time, for one core each. One runs api and live. The
# other runs identities, oracles, parity and reference, and the tests of api that compile C. So both take similar time. The output of the
# first is printed after that of the second.
set -eu
root=$1 python=$2
shift 2
log=$(mktemp)
api=$root/tests/api
half() { "$python" -P -m pytest -c "$root/pyproject.toml" --rootdir "$root" "$@"; }
half "$api" --ignore-glob="$api/test_export_c_*.py" "$root/tests/live" "$@" >"$log" 2>&1 &
other=$!
trap 'kill "$other" 2>/dev/null || true; rm -f "$log"' EXIT
trap 'exit 130' INT TERM
first=0 second=0
half "$root/tests/identities" "$root/tests/oracles" "$root/tests/parity" "$root/tests/reference" "$api"/test_export_c_*.py "$@" || first=$?
wait "$other" || second=$?
cat "$log"
# Exit code 5 of pytest: OPTIONS select no test of this half.
if [ "$first" = 5 ] && [ "$second" = 5 ]; then exit 5; fi
for code in "$first" "$second"; do if [ "$code" != 0 ] && [ "$code" != 5 ]; then exit "$code"; fi; done
