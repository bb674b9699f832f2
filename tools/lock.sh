#!/bin/sh
# Rewrite requirements/test.txt. The packages for the build, the dependencies and the extra `test` of pyproject.toml are installed in a new
# environment, and `pip freeze` lists their versions.
set -eu
python=$(sh tools/require.sh python)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
"$python" -m venv "$scratch/venv"
"$scratch/venv/bin/python" - >"$scratch/names" <<'PY'
import tomllib

with open("pyproject.toml", "rb") as file:
    project = tomllib.load(file)
print("\n".join(project["build-system"]["requires"] + project["project"]["dependencies"] + project["project"]["optional-dependencies"]["test"]))
PY
"$scratch/venv/bin/python" -m pip install --quiet -r "$scratch/names"
{
    sed -n '/^#/p' requirements/test.txt
    "$scratch/venv/bin/python" -m pip freeze
} >"$scratch/lock"
cp "$scratch/lock" requirements/test.txt
