#!/bin/sh
# beside.sh FIRST SECOND: two commands at a time, for one core each; the output of the second follows that of the first. Fails if one of them fails.
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
