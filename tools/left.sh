#!/bin/sh
# left.sh VENV BUILD OUT: print what `make demo` leaves in the folder of the sources, and how to use it and to remove it.
set -eu
venv=$1 build=$2 out=$3
wheel=$(cat "$build/wheel.path")
here() { echo "${1#"$PWD"/}"; }
cat <<TEXT

left here: armlet in $(here "$venv"), for example $(here "$venv")/bin/armlet info and $(here "$venv")/bin/python;
the wheel, for other environments: pip install '$(here "$wheel")[plot]';
pages and figures in $(here "$out"); compiled code in $(here "$build") and target. make clean removes all of them but $(here "$out").
TEXT
