# armlet. `make demo` and `make test` need Python >= 3.11 with venv, Rust, a C linker, and the network once.
.DEFAULT_GOAL := help
SHELL := /bin/sh
.SHELLFLAGS := -eu -c
.DELETE_ON_ERROR:
.SUFFIXES:

ROOT := $(CURDIR)
VENV := $(ROOT)/.venv
BUILD := $(ROOT)/build
# -P: the directory a command runs in never shadows the installed package.
PY := $(VENV)/bin/python -P
OUT ?= out
TRIALS ?= 20
# if-installed: go on with a note when rustfmt or clippy is not installed. required: stop.
LINT ?= if-installed

export CARGO_TARGET_DIR ?= $(ROOT)/target
export PIP_DISABLE_PIP_VERSION_CHECK := 1
export PYTHONNOUSERSITE := 1
unexport PYTHONPATH PYTHONHOME

SOURCES := $(shell find rust python tests examples docs requirements -type f -not -name '*.so' -not -path '*/__pycache__/*' 2>/dev/null) \
	$(wildcard Cargo.toml Cargo.lock pyproject.toml Makefile README.md LICENSE)

.PHONY: help demo test quick test-aarch64 test-latency test-peers test-sweep-kill test-stacks test-limits test-paths test-worst test-browser test-mutants test-scipy fuzz check bench docs audit wheels lock clean tools

help: ## this list
	@awk -F ':.*## ' '/^[a-z0-9-]+:.*## / { printf "make %-15s %s\n", $$1, $$2 }' Makefile

demo: $(BUILD)/installed ## build armlet, run the demonstration: a table of checks, figures in out/
	@$(PY) -m armlet demo --out "$(OUT)" && sh tools/left.sh "$(VENV)" "$(BUILD)" "$(OUT)"

test: $(BUILD)/installed $(BUILD)/requirements ## everything: formatting, lints, types, Rust and Python tests on the built wheel
	@# Compilers and type checkers use one core for much of their time.
	+@sh tools/beside.sh "$(MAKE) --no-print-directory rust-tests types" "$(MAKE) --no-print-directory lint"
	@rm -rf $(BUILD)/elsewhere && mkdir -p $(BUILD)/elsewhere
	cd $(BUILD)/elsewhere && ARMLET_MAKE_TEST=1 ARMLET_SDIST="$$(cat $(BUILD)/sdist.path)" ARMLET_WHEEL="$$(cat $(BUILD)/wheel.path)" \
		$(PY) -m pytest --numprocesses auto --maxprocesses 8 --dist worksteal -c $(ROOT)/pyproject.toml --rootdir $(ROOT) $(ROOT)/tests $(PYTEST)

quick: $(BUILD)/requirements ## the tests of the changed files (FILES=), with a build in seconds: one or two minutes
	@$(PY) tools/quick.py $(FILES)

test-peers: $(BUILD)/installed $(BUILD)/requirements ## arms against Pinocchio and MuJoCo on public robots (installs half a gigabyte)
	@sh tools/pip.sh "$(VENV)" "$(BUILD)" -r requirements/peers.txt -c requirements/test.txt
	@mkdir -p $(BUILD)/elsewhere
	cd $(BUILD)/elsewhere && $(PY) -m pytest -c $(ROOT)/pyproject.toml --rootdir $(ROOT) $(ROOT)/tests/peers $(PYTEST)

test-sweep-kill: $(BUILD)/installed $(BUILD)/requirements ## sweeps whose workers and clients are killed, 20 trials each, and whose disks fail; on Dask too (minutes)
	@sh tools/pip.sh "$(VENV)" "$(BUILD)" -r requirements/sweep.txt -c requirements/test.txt
	@mkdir -p $(BUILD)/elsewhere
	cd $(BUILD)/elsewhere && ARMLET_KILL_TRIALS=$(TRIALS) $(PY) -m pytest -rP -c $(ROOT)/pyproject.toml --rootdir $(ROOT) \
		$(ROOT)/tests/api/test_sweep.py $(ROOT)/tests/api/test_sweep_disk.py $(ROOT)/tests/endurance $(PYTEST)

test-aarch64: tools ## machine code for aarch64 in an emulator (Debian's gcc-aarch64-linux-gnu and qemu-user)
	@rm -rf $(BUILD)/aarch64 && mkdir -p $(BUILD)/aarch64
	ARMLET_HARNESS="$(BUILD)/aarch64" cargo test --locked --package armlet-core --lib trace::
	ARMLET_HARNESS="$(BUILD)/aarch64" cargo test --locked --package armlet-core --test suite emulated
	@sh tools/aarch64.sh "$(BUILD)/aarch64"

STACKS ?= 1000000
test-stacks: $(BUILD)/installed $(BUILD)/requirements ## the disturbance laws and the certificates of task priority on 1,000,000 random stacks (STACKS=): minutes
	@mkdir -p $(BUILD)/elsewhere
	cd $(BUILD)/elsewhere && ARMLET_RANDOM_STACKS=$(STACKS) $(PY) -m pytest -c $(ROOT)/pyproject.toml --rootdir $(ROOT) \
		$(ROOT)/tests/identities/test_priority_stacks.py $(ROOT)/tests/identities/test_inequality_stacks.py $(PYTEST)

MOTIONS ?= 10000
test-limits: $(BUILD)/installed $(BUILD)/requirements ## limits of joints and torques along 10,000 random motions of an arm (MOTIONS=): an hour
	@mkdir -p $(BUILD)/elsewhere
	cd $(BUILD)/elsewhere && ARMLET_LIMIT_MOTIONS=$(MOTIONS) $(PY) -m pytest -c $(ROOT)/pyproject.toml --rootdir $(ROOT) \
		$(ROOT)/tests/identities/test_acceleration_limits.py $(PYTEST)

CASES ?= 10000000
test-paths: $(BUILD)/installed $(BUILD)/requirements ## the planners on 10,000,000 random problems (CASES=), an independent checker decides: hours
	@mkdir -p $(BUILD)/elsewhere
	cd $(BUILD)/elsewhere && ARMLET_RANDOM_PATHS=$(CASES) ARMLET_RANDOM_LINKS=$(CASES) ARMLET_RANDOM_JOBS="$${JOBS:-$$(nproc)}" \
		$(PY) -m pytest -c $(ROOT)/pyproject.toml --rootdir $(ROOT) $(ROOT)/tests/identities/test_random_plans.py $(PYTEST)

DRAWS ?= 1000000
test-worst: $(BUILD)/installed $(BUILD)/requirements ## worst cases against 1,000,000 random draws (DRAWS=) in a hundredth of the runs: an hour
	@mkdir -p $(BUILD)/elsewhere
	cd $(BUILD)/elsewhere && ARMLET_RANDOM_DRAWS=$(DRAWS) $(PY) -m pytest -c $(ROOT)/pyproject.toml --rootdir $(ROOT) \
		$(ROOT)/tests/api/test_worst_case.py $(PYTEST)

SIGNALS ?= 100
test-latency: $(BUILD)/installed ## Ctrl-C within 100 ms and the interpreter lock within 50 ms, in a table by call (SIGNALS=): 40 minutes
	$(PY) benches/latency.py --trials $(SIGNALS) $(LATENCY)

test-browser: docs ## the lab, the view and the pages of `make docs` in a browser without a window; pictures in build/browser
	@sh tools/pip.sh "$(VENV)" "$(BUILD)" -r requirements/browser.txt -c requirements/test.txt
	@sh tools/browser.sh $(PY)
	@mkdir -p $(BUILD)/elsewhere
	cd $(BUILD)/elsewhere && $(PY) -m pytest -c $(ROOT)/pyproject.toml --rootdir $(ROOT) $(ROOT)/tests/browser $(PYTEST)

test-mutants: $(BUILD)/requirements ## bugs on purpose in a copy of the sources: how many the fast tests notice (an hour)
	@$(PY) tools/mutants

SECONDS ?= 60
SEED ?= 1
fuzz: $(BUILD)/installed $(BUILD)/requirements ## random calls of the whole public API in child processes (SECONDS=, SEED=): none may panic, hang or end them
	@mkdir -p $(BUILD)/elsewhere
	cd $(BUILD)/elsewhere && $(VENV)/bin/python $(ROOT)/tools/fuzz --seconds "$(SECONDS)" --seed "$(SEED)"

test-scipy: $(BUILD)/installed $(BUILD)/requirements ## scipy's own tests of solve_ivp on armlet's methods: the count, and each exception
	@mkdir -p $(BUILD)/elsewhere
	cd $(BUILD)/elsewhere && $(PY) $(ROOT)/tools/scipy_suite.py

check: $(BUILD)/installed $(BUILD)/requirements ## formatting, lints and types alone
	@$(MAKE) --no-print-directory lint types LINT=required

bench: $(BUILD)/installed $(BUILD)/requirements ## benchmarks against the peers (installs them)
	@sh tools/pip.sh "$(VENV)" "$(BUILD)" -r requirements/bench.txt -r requirements/peers.txt -c requirements/test.txt
	@sh tools/pip.sh "$(VENV)" "$(BUILD)" dynibo==0.5.2 || echo "make bench: goes on without dynibo, which has no wheel for this Python"
	@set -- benches/bench_*.py; test -e "$$1" || { echo "make bench: no benches/bench_*.py yet"; exit 1; }; \
	for file in "$$@"; do echo "== $$file"; $(PY) "$$file"; done

docs: $(BUILD)/installed $(BUILD)/requirements ## the pages, the executed examples and the reference as HTML, in build/docs/html
	@sh tools/pip.sh "$(VENV)" "$(BUILD)" -r requirements/docs.txt -c requirements/test.txt
	@sh tools/docs.sh "$(VENV)/bin/python" "$(BUILD)"

audit: $(VENV)/built ## licences, sources, duplicates and pins of what is shipped; advisories where the tools for it are installed
	@$(PY) tools/audit.py

wheels: $(VENV)/built ## sdist and wheels of a release for this system, in dist/ (see RELEASING.md)
	@sh tools/pip.sh "$(VENV)" "$(BUILD)" ziglang
	@PYTHON="$(VENV)/bin/python" sh tools/release/wheels.sh dist

lock: tools ## rewrite requirements/test.txt from what resolves today
	@sh tools/lock.sh

clean: ## remove what make built (the downloaded packages too)
	rm -rf $(BUILD) $(VENV) target

# The suite and the examples of the documentation on the core that the wheel was made of; units unoptimised, with their assertions and checks
# of overflow. With the package armlet-py, cargo selects the features of the wheel's build, and does not compile the core again.
.PHONY: rust-tests lint types
rust-tests:
	cd $(BUILD)/sdist/armlet-* && cargo test --release --locked --package armlet-core --package armlet-py --test suite
	cd $(BUILD)/sdist/armlet-* && cargo test --locked --package armlet-core --lib
	@cp tools/rustdoc.sh $(BUILD)/rustdoc && chmod +x $(BUILD)/rustdoc
	cd $(BUILD)/sdist/armlet-* && RUSTDOC=$(BUILD)/rustdoc cargo test --release --locked --package armlet-core --package armlet-py --doc

lint:
	@sh tools/lint.sh "$(LINT)" $(PY)

types:
	$(PY) -m mypy
	$(PY) -m mypy.stubtest armlet._core --allowlist tools/stubtest_allowlist.txt

# What the machine must have: one line that names what is missing.
tools:
	@sh tools/require.sh

# The environment with the packages that building and the demonstration need, at the locked versions.
$(VENV)/built: requirements/test.txt tools/pip.sh tools/require.sh | tools
	@sh tools/pip.sh "$(VENV)" "$(BUILD)" maturin numpy matplotlib -c requirements/test.txt
	@touch $@

$(BUILD)/requirements: requirements/test.txt $(VENV)/built
	@sh tools/pip.sh "$(VENV)" "$(BUILD)" -r requirements/test.txt
	@touch $@

# One compile: the wheel is built from the unpacked sdist, and what is installed and tested is that wheel.
$(BUILD)/installed: $(VENV)/built $(SOURCES) tools/build.sh tools/unpack_sdist.py
	@sh tools/build.sh "$(VENV)" "$(BUILD)"
	@touch $@
