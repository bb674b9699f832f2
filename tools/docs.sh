#!/bin/sh
# docs.sh PYTHON BUILD: the pages, the executed gallery and the reference as HTML in BUILD/docs/html, from a copy of the sources.
set -eu
python=$1 build=$2/docs
rm -rf "$build/source"
mkdir -p "$build/source"
cp -R docs examples README.md CHANGELOG.md CONTRIBUTING.md CITATION.cff LICENSE "$build/source/"
cp benches/README.md "$build/source/docs/benchmarks.md"
MPLCONFIGDIR=$build/matplotlib $python -P -m sphinx -b html -W --keep-going -q -d "$build/doctrees" "$build/source/docs" "$build/html"
echo "docs: $build/html/index.html"
