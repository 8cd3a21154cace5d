# The commands of the project. `make help` lists them; pre-commit and .ci/run call the same ones.

SHELL := /bin/sh
PYTHON ?= python3
CARGO ?= cargo
VENV ?= .venv
BIN := $(VENV)/$(if $(filter Windows_NT,$(OS)),Scripts,bin)
PY := $(BIN)/python

# Stamp files: an up-to-date environment and extension are not built again.
STAMPS := $(VENV)/stamps
ENV_STAMP := $(STAMPS)/env
BENCH_STAMP := $(STAMPS)/bench
DOCS_STAMP := $(STAMPS)/docs
BUILD_STAMP := $(STAMPS)/build

RUST_SOURCES := $(shell find crates -name '*.rs' -o -name Cargo.toml) Cargo.toml Cargo.lock
# maturin installs into the environment named here; a Conda environment around must not interfere. With `--zig` it
# takes the compiler that the package `ziglang` of this environment has.
MATURIN := env -u CONDA_PREFIX VIRTUAL_ENV="$(abspath $(VENV))" CARGO_ZIGBUILD_PYTHON_PATH="$(abspath $(PY))" $(BIN)/maturin
# What `make test-fast` runs in Python: files of a second or two that together reach every stage, namely tracing,
# arguments, itineraries against references, order, what wins at equal times, events, resets, sliding on
# intersections, discrete states, the record, and runs that fail.
FAST := $(patsubst %,tests/test_%.py,trace_branching trace_numpy wrong_input itinerary itinerary_exact order \
	order_of_outcomes events resets sliding_rules classify laws structure adversarial failures)
# The files of the tests are shared among as many processes as there are cores.
PARALLEL ?= -n auto --dist loadfile
# The binding has no Rust tests of its own: tests/ exercises it from Python.
RUST_TESTED := --workspace --exclude filippov-py

export MPLBACKEND ?= Agg

.DEFAULT_GOAL := help
N ?= 6000
SEED ?= 0

# Options of maturin for `make build-release`, such as the target and the compatibility of the wheel.
WHEEL ?=

.PHONY: help tools setup build build-release sdist check-wheel check-sdist check-crates fmt lint types test test-rs test-py \
	test-fast test-slow fuzz decisions bench demo pictures figures app docs docs-text check all clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  %-14s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

tools: ## check that Python and Rust are there; says how to install what is missing
	@PYTHON="$(PYTHON)" CARGO="$(CARGO)" sh scripts/check_tools.sh

setup: $(ENV_STAMP) ## create the environment in .venv

build: $(BUILD_STAMP) ## compile the extension, optimised, into the environment

build-release: $(ENV_STAMP) ## build a wheel into dist/; WHEEL has options of maturin
	$(MATURIN) build --release --locked --out dist $(WHEEL)

sdist: $(ENV_STAMP) ## pack the sources into dist/
	$(MATURIN) sdist --out dist

check-wheel: ## install the wheel of dist/ into a fresh environment without Rust, and run the README there
	sh scripts/check_package.sh "$(PYTHON)" dist/filippov-*.whl

check-sdist: ## build the sources of dist/ in a fresh environment, and run the README there
	sh scripts/check_package.sh "$(PYTHON)" dist/filippov-*.tar.gz

check-crates: tools ## pack the Rust crates as for crates.io, and build what was packed
	$(CARGO) publish --dry-run --locked -p filippov-expr -p filippov

fmt: $(ENV_STAMP) ## format the Rust and the Python sources
	$(CARGO) fmt --all
	$(BIN)/ruff check --fix --quiet .
	$(BIN)/ruff format .

lint: $(ENV_STAMP) ## formatting, clippy, ruff, structure, map; changes nothing
	@sh scripts/check_tools.sh lint
	$(CARGO) fmt --all --check
	$(CARGO) clippy --release --workspace --all-targets -- -D warnings
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(PY) scripts/check_structure.py

types: $(BUILD_STAMP) ## type check (strict) and comparison of the stub with the extension
	$(BIN)/mypy
	$(BIN)/stubtest filippov._core

test: test-rs test-py ## all tests but the slow ones

test-rs: tools ## Rust tests
	$(CARGO) test --release $(RUST_TESTED)

test-py: $(BUILD_STAMP) ## Python tests and the examples in the docstrings, but for PyTorch's: it is not installed
	$(BIN)/pytest $(PARALLEL) -m "not slow"
	$(BIN)/pytest --doctest-modules python/filippov --ignore=python/filippov/autodiff/with_torch.py

test-fast: $(BUILD_STAMP) ## Rust unit tests, and Python tests of every stage: half a minute once all is built
	$(CARGO) test --release $(RUST_TESTED) --lib
	$(BIN)/pytest -m "not slow" $(FAST)

test-slow: $(BUILD_STAMP) ## the slow tests
	$(CARGO) test --release $(RUST_TESTED) -- --ignored
	$(BIN)/pytest -m slow

fuzz: $(BUILD_STAMP) ## random graphs in native code and interpreter; damaged bytes of systems; N random systems from SEED on, in two processes, and 400 degenerate starts; their derivatives against differences
	EXPR_TEST_SEED=$(SEED) $(CARGO) test --release -p filippov-expr --test fuzz -- --ignored
	$(CARGO) test --release -p filippov --test saved_systems -- --ignored
	PYTHONPATH=tests OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(PY) -m fuzz --n $(N) --seed $(SEED)
	PYTHONPATH=tests OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(PY) -m fuzz.derivatives --n $(N) --seed $(SEED)

decisions: $(BUILD_STAMP) ## record the corpus of decisions again, see CONTRIBUTING
	$(PY) scripts/record_decisions.py

bench: $(BENCH_STAMP) ## run the benchmarks
	$(PY) benchmarks/disode_tables.py
	$(PY) benchmarks/speed.py
	$(PY) benchmarks/friction_chain.py
	$(PY) benchmarks/large.py
	$(PY) benchmarks/work_precision.py
	$(PY) benchmarks/accuracy.py
	$(PY) benchmarks/stiff.py
	$(PY) benchmarks/counts.py
	$(PY) benchmarks/diagram.py
	$(PY) benchmarks/tables.py
	$(PY) benchmarks/derivatives.py
	$(PY) benchmarks/events.py

demo: $(BUILD_STAMP) ## simulate and plot a stick-slip oscillator
	$(PY) examples/01_stick_slip/stick_slip.py

pictures: $(BUILD_STAMP) ## draw the pictures of the README again
	$(PY) scripts/readme_blocks.py README.md docs/images

figures: $(BUILD_STAMP) ## draw the figures of the theory pages and of the first page again
	$(PY) scripts/theory_figures.py

app: ## the interactive page, into python/filippov/app/static; skips by name what cannot be built here
	@CARGO="$(CARGO)" sh scripts/build_app.sh

docs-text: $(DOCS_STAMP) ## the documentation without running its code or compiling anything: for work on the text
	FILIPPOV_DOCS=text NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet

docs: $(BUILD_STAMP) $(DOCS_STAMP) ## the documentation, into target/site, and the pages of the Rust crates, into target/doc
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet
	RUSTDOCFLAGS="-D warnings -A rustdoc::private_intra_doc_links" $(CARGO) doc --release --no-deps $(RUST_TESTED)

check: lint types test ## what must hold before a change is complete; changes nothing

all: fmt check ## format, then check

clean: ## remove the environment and everything built
	rm -rf $(VENV) target dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
	rm -f python/filippov/_core*.so

$(ENV_STAMP): pyproject.toml
	@PYTHON="$(PYTHON)" CARGO="$(CARGO)" sh scripts/check_tools.sh
	test -x $(PY) || $(PYTHON) -m venv $(VENV)
	$(PY) -m pip install --quiet --disable-pip-version-check --upgrade "pip>=25.1"
	$(PY) -m pip install --quiet --group dev
	@mkdir -p $(STAMPS) && touch $@

$(BENCH_STAMP): $(BUILD_STAMP)
	$(MATURIN) develop --release --extras bench
	@touch $@

$(DOCS_STAMP): $(ENV_STAMP)
	$(PY) -m pip install --quiet --group docs
	@touch $@

$(BUILD_STAMP): $(ENV_STAMP) $(RUST_SOURCES)
	$(MATURIN) develop --release
	@touch $@
