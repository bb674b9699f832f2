#!/bin/sh
# test_sdist.sh SDIST: check that the sdist is complete. It is unpacked, built and installed in a separate environment. pytest collects all
# of its tests, which imports the modules that they need. Then the tests in TESTS run. `make test` runs the others on the same sdist.
#
# To save time, the packages are installed while the wheel is built. The wheel is built with little optimisation.
set -eu
sdist=$(cd "$(dirname "${1:?usage: test_sdist.sh SDIST}")" && pwd)/$(basename "$1")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
python=$work/venv/bin/python
"${PYTHON:-python3}" tools/unpack_sdist.py "$sdist" "$work/source" >"$work/root"
source=$(cat "$work/root")
CARGO_PROFILE_RELEASE_LTO=off CARGO_PROFILE_RELEASE_CODEGEN_UNITS=16 CARGO_PROFILE_RELEASE_OPT_LEVEL=1 \
    "$python" -m pip wheel --quiet --no-deps --wheel-dir "$work/wheel" "$sdist" &
wheel=$!
"$python" -m pip install --quiet -r "$source/requirements/test.txt"
wait "$wheel"
"$python" -m pip install --quiet --no-deps "$work"/wheel/armlet-*.whl
mkdir "$work/elsewhere"
cd "$work/elsewhere"
tests() { ARMLET_SDIST=$sdist "$python" -P -m pytest -c "$source/pyproject.toml" --rootdir "$source" "$@"; }
tests --quiet --collect-only "$source/tests" >collected || { cat collected; exit 1; }
TESTS=${TESTS:-oracles api/test_packaging.py api/test_import.py api/test_run.py api/test_results.py api/test_pickle.py api/test_batches.py}
paths=$(for test in $TESTS; do echo "$source/tests/$test"; done)
# shellcheck disable=SC2086
tests $paths
