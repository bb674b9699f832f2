#!/bin/sh
# docs.sh PYTHON BUILD: write the pages, the executed gallery, the reference and the report of the demonstration as HTML in
# BUILD/docs/html, from a copy of the sources.
set -eu
python=$1 build=$2/docs
rm -rf "$build/source"
mkdir -p "$build/source"
cp -R docs examples README.md CHANGELOG.md CONTRIBUTING.md CITATION.cff LICENSE "$build/source/"
cp benches/README.md "$build/source/docs/benchmarks.md"
$python -P tools/reference.py --pages "$build/source/docs/reference.md"
export MPLCONFIGDIR="$build/matplotlib"
# The report has its figures inside; the pages link to it.
$python -P -m armlet demo --out "$build/demo" >/dev/null
mkdir -p "$build/source/extra/demo"
cp "$build/demo/report.html" "$build/source/extra/demo/"
# Some loops of the pages run in the browser.
$python -P "$build/source/docs/live_loops.py" "$build/source/extra/loops"
$python -P -m sphinx -b html -W --keep-going -q -d "$build/doctrees" "$build/source/docs" "$build/html"
echo "docs: $build/html/index.html"
