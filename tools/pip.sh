#!/bin/sh
# pip.sh VENV BUILD ARGUMENTS..: make the environment VENV if it is missing or broken, then run `pip install ARGUMENTS` in it.
set -eu
venv=$1 build=$2
shift 2
mkdir -p "$build"
log=$build/pip.log
if ! "$venv/bin/python" -m pip --version >/dev/null 2>&1; then
    python=$(sh tools/require.sh python)
    "$python" -m venv --clear "$venv" >"$log" 2>&1 || { echo "armlet: $python -m venv failed: $(tail -n 1 "$log") (log: $log)" >&2; exit 1; }
fi
echo "installing Python packages: $*"
if ! "$venv/bin/python" -m pip install --quiet --retries 1 "$@" >"$log" 2>&1; then
    if grep -qiE 'connection|resolve|network|timed out|retry|proxy|ssl' "$log"; then
        echo "armlet needs the network once, to download its Python packages: pip could not reach the package index (log: $log)" >&2
    else
        echo "armlet: pip install failed: $(grep -m 1 '^ERROR' "$log" || tail -n 1 "$log") (log: $log)" >&2
    fi
    exit 1
fi
