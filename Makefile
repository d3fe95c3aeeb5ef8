# Everything below sets itself up: a machine with Python >= 3.11 and pip is enough.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

# Every process of a scan or a test reads hundreds of modules: their bytecode is kept, whatever the shell says.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help setup scan test test-all pytest coverage check bench bench-history nightly results figures docs notebooks lock clean

help:
	@echo "make setup   virtual environment in .venv: core, extras photos, reports, logs, cockpit, ros, gamepad and links (LGPL), dask, detector, learning, tools for tests"
	@echo "make scan    fly, photograph, reconstruct and judge a coral; leaves runs/quick/report.html"
	@echo "make check   ruff, spelling, mypy and the import contracts"
	@echo "make test    the same, and the tests but the slow ones; as root on Debian it installs Chromium for them"
	@echo "make test-all  the same with the slow ones"
	@echo "make pytest  the tests of make test alone"
	@echo "make coverage  coverage per package; kernels count, run without a compiler"
	@echo "make bench   speed and quality, side by side with a peer"
	@echo "make bench-history  speed in short, compared with the last time on this processor, kept in docs/benchmarks"
	@echo "make nightly  test-all, docs, notebooks, coverage and bench-history"
	@echo "make results BUDGET=2h   the paper's tables beside ours, from as many trials as fit; writes docs/results"
	@echo "make figures  the README's animation, from two flights; a minute or two"
	@echo "make docs    regenerate pages from the code, and build the site: docs/_build/html/index.html"
	@echo "make notebooks  run the notebooks of examples/notebooks"
	@echo "make lock    resolve requirements.lock anew (needs uv, which setup installs)"
	@echo "make clean   remove the virtual environment and built packages; results in runs stay"

setup: $(STAMP)

PACKAGES := . packages/wakewise-ardusub packages/wakewise-paper packages/wakewise-nerf benchmarks

$(STAMP): requirements.lock pyproject.toml $(wildcard packages/*/pyproject.toml) benchmarks/pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "wakewise needs Python 3.11 or newer; PYTHON=/path/to/python3.11 make $(MAKECMDGOALS)"; exit 2; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV) || \
		{ echo "python3-venv is missing: apt-get install python3-venv"; exit 2; }
	sh tools/install.sh $(BIN)/python requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation $(addprefix --editable ,$(PACKAGES))
	@$(BIN)/python tools/check_libraries.py
	@touch $@

# Kernels run as the Python that they are written in for the second run, so that their lines count: unit tests of kernels
# only, which take seconds. Whole searches and filters take an hour without a compiler.
INTERPRETED := tests/allocation/test_line_search.py tests/allocation/test_coordinate_descent.py \
	tests/estimation/test_eskf_kernels.py tests/estimation/test_filter_corrections.py
PARALLEL := --dist loadfile --no-loadscope-reorder
SELECTED := -m "not slow" --hypothesis-profile=ci
coverage: setup
	$(BIN)/coverage erase
	OPENBLAS_NUM_THREADS=1 $(BIN)/coverage run -m pytest -n 3 $(PARALLEL) $(SELECTED) $(COVERED); \
	NUMBA_DISABLE_JIT=1 $(BIN)/coverage run -m pytest -n 2 $(PARALLEL) $(SELECTED) $(INTERPRETED); \
	$(BIN)/coverage combine --quiet
	$(BIN)/python tools/coverage_by_package.py

scan: setup
	$(BIN)/wakewise scan --preset quick --out runs/quick

check: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/codespell
	$(BIN)/mypy
	$(BIN)/lint-imports

# Types are looked at, a browser is fetched and the tests are read once, so that their bytecode and that of what they
# import is there for all processes, beside the kernels; what was found of types is said last.
# Three processes on two cores: two share the folders out, a file at a time, so that what a folder's tests share is made, and
# its kernels are loaded, by one of them; the third runs what mostly waits (tests/sharing.py). The library of linear
# algebra would have all cores in each.
# `make test` leaves out what is marked slow (pyproject.toml) and draws the same examples each time;
# `make test-all` leaves out nothing and draws new ones.
PYTEST := OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -n 3 $(PARALLEL)
test test-all: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/codespell
	$(BIN)/lint-imports
	@$(BIN)/mypy > $(VENV)/types.txt 2>&1 & types=$$!; \
	{ sh tools/browser.sh; $(BIN)/pytest --collect-only -qq > /dev/null 2>&1; } & beside=$$!; \
	$(BIN)/wakewise compile; kernels=$$?; wait $$beside; \
	test $$kernels -eq 0 && $(PYTEST) $(if $(filter test,$@),$(SELECTED)); \
	tests=$$?; wait $$types; types=$$?; cat $(VENV)/types.txt; test $$tests -eq 0 -a $$types -eq 0

# The tests alone, where lint, types and kernels are steps of their own.
pytest: setup
	$(PYTEST) $(SELECTED)

bench: setup
	$(BIN)/wakewise bench all

bench-history: setup
	$(BIN)/python tools/bench_history.py

# What a change every night should pass beside `make test`: slow tests, site, notebooks, coverage, speed.
nightly: test-all docs notebooks coverage bench-history

BUDGET ?= 2h
NOTE ?=
results: setup
	$(BIN)/python tools/write_results.py --budget "$(BUDGET)" --note "$(NOTE)"

figures: setup
	$(BIN)/python tools/figures.py

# Tools of the site and of the notebooks, installed by the targets that need them, so that `make setup` does not grow.
DOCS_STAMP := $(VENV)/.docs-installed
$(DOCS_STAMP): docs/requirements.lock $(STAMP)
	sh tools/install.sh $(BIN)/python docs/requirements.lock
	@touch $@

# The gallery's scripts fly: a library of linear algebra on all cores would slow them down.
docs: setup $(DOCS_STAMP)
	$(BIN)/python tools/write_docs.py
	$(BIN)/python tools/draw_hardware.py
	$(BIN)/python tools/draw_layers.py
	$(BIN)/python tools/readability.py --strict
	OPENBLAS_NUM_THREADS=1 $(BIN)/sphinx-build -W --keep-going -n -q docs docs/_build/html
	@echo "open docs/_build/html/index.html"

notebooks: setup $(DOCS_STAMP)
	OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -n 0 --nbmake --nbmake-timeout=120 examples/notebooks

lock: setup
	$(BIN)/uv pip compile pyproject.toml packages/wakewise-ardusub/pyproject.toml --extra all --extra gamepad --extra links --extra ros --extra dask --extra detector --extra learning --group dev --universal --python-version 3.11 --generate-hashes --no-header --no-annotate --no-emit-package wakewise -o requirements.lock
	$(BIN)/uv pip compile docs/requirements.in --constraint requirements.lock --universal --python-version 3.11 --generate-hashes --no-header --no-annotate -o docs/requirements.lock

clean:
	rm -rf $(VENV) dist
