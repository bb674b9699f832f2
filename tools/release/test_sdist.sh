#!/bin/sh
# test_sdist.sh SDIST: what travels is enough. The sdist is unpacked, built and installed in an environment of its own, and its own tests run.
set -eu
sdist=$(cd "$(dirname "${1:?usage: test_sdist.sh SDIST}")" && pwd)/$(basename "$1")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
python=$work/venv/bin/python
"${PYTHON:-python3}" tools/unpack_sdist.py "$sdist" "$work/source" >"$work/root"
source=$(cat "$work/root")
"$python" -m pip install --quiet -r "$source/requirements/test.txt"
"$python" -m pip install --quiet --no-deps "$sdist"
mkdir "$work/elsewhere"
cd "$work/elsewhere"
ARMLET_SDIST=$sdist "$python" -P -m pytest -c "$source/pyproject.toml" --rootdir "$source" "$source/tests"
