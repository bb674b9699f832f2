#!/bin/sh
# lint.sh if-installed|required PYTHON..: check formatting and lints of both languages. With `required` the script stops if rustfmt or
# clippy is not installed.
set -eu
mode=$1
shift
component() { # command, component: whether cargo has the command; otherwise print how to install the component
    if cargo "$1" --version >/dev/null 2>&1; then return 0; fi
    echo "cargo $1 is not installed: rustup component add $2" >&2
    if [ "$mode" = required ]; then exit 1; fi
    return 1
}
run() { echo "+ $*"; "$@"; }
if component fmt rustfmt; then run cargo fmt --check; fi
# The features of the core can be turned off, also for its unit tests. `ci.yml` turns off each one alone.
run cargo check --locked --package armlet-core --quiet --no-default-features --lib --tests
run env RUSTDOCFLAGS='-D warnings' cargo doc --locked --package armlet-core --no-deps --quiet
run "$@" tools/doc_examples.py
if component clippy clippy; then run cargo clippy --locked --workspace --all-targets --quiet -- -D warnings; fi
run "$@" -m ruff format --check --quiet python tests tools examples benches docs
run "$@" -m ruff check python tests tools examples benches docs
run "$@" tools/words.py
run sh tools/workflows.sh "$@"
