#!/bin/sh
# beside.sh FIRST SECOND: run two commands at the same time, for one core each. The output of SECOND is printed after that of FIRST. The
# exit code is not 0 if one of them fails.
set -u
log=$(mktemp)
sh -c "$2" >"$log" 2>&1 &
other=$!
trap 'kill "$other" 2>/dev/null; rm -f "$log"' EXIT
trap 'exit 130' INT TERM
first=0 second=0
sh -c "$1" || first=$?
wait "$other" || second=$?
cat "$log"
if [ "$first" != 0 ]; then exit "$first"; fi
exit "$second"
