# Everything below sets itself up: a machine with Python >= 3.11 and pip is enough.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

# Every process of a scan or a test reads hundreds of modules: their bytecode is kept, whatever the shell says.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help setup scan test test-all check bench results docs lock clean

help:
	@echo "make setup   virtual environment in .venv: core, extras photos, reports, logs, cockpit, ros, gamepad and links (LGPL), piv (GPL), dask, tools for tests"
	@echo "make scan    fly, photograph, reconstruct and judge a coral; leaves runs/quick/report.html"
	@echo "make test    ruff, mypy, the import contract and the tests but the slow ones"
	@echo "make test-all  the same with the slow ones"
	@echo "make check   the same without the tests"
	@echo "make bench   speed and quality, side by side with a peer"
	@echo "make results BUDGET=2h   the paper's tables beside ours, from as many trials as fit; writes docs/results"
	@echo "make docs    regenerate docs/commands.md from the commands' own help"
	@echo "make lock    resolve requirements.lock anew (needs uv, which setup installs)"

setup: $(STAMP)

$(STAMP): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "wakewise needs Python 3.11 or newer; PYTHON=/path/to/python3.11 make $(MAKECMDGOALS)"; exit 2; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV) || \
		{ echo "python3-venv is missing: apt-get install python3-venv"; exit 2; }
	@# Not compiled to bytecode: a third of the time, most of it for modules that nobody imports.
	$(BIN)/python -m pip install --no-compile --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@$(BIN)/python tools/check_libraries.py
	@touch $@

scan: setup
	$(BIN)/wakewise scan --preset quick --out runs/quick

check: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# Types are looked at beside the kernels and the tests, which leave a core idle now and then; what was found is said last.
# A file at a time: what its tests share is made once, and its kernels are loaded by one of the two workers. Each has a
# core, and the library of linear algebra would have all of them.
# `make test` leaves out what is marked slow (ten seconds and more each) and draws the same examples each time;
# `make test-all` leaves out nothing and draws new ones.
test test-all: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	@sh tools/browser.sh
	@$(BIN)/mypy > $(VENV)/types.txt 2>&1 & types=$$!; \
	$(BIN)/wakewise warm && OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -n 2 --dist loadfile --no-loadscope-reorder $(if $(filter test,$@),-m "not slow" --hypothesis-profile=ci); \
	tests=$$?; wait $$types; types=$$?; cat $(VENV)/types.txt; test $$tests -eq 0 -a $$types -eq 0

bench: setup
	$(BIN)/wakewise bench

BUDGET ?= 2h
NOTE ?=
results: setup
	$(BIN)/python tools/write_results.py --budget "$(BUDGET)" --note "$(NOTE)"

docs: setup
	$(BIN)/python tools/write_docs.py
	$(BIN)/python tools/draw_hardware.py

lock:
	$(BIN)/python -m pip install --quiet uv
	$(BIN)/uv pip compile pyproject.toml --extra all --extra piv --extra gamepad --extra links --extra ros --extra dask --group dev --universal --python-version 3.11 --generate-hashes --no-header --no-annotate -o requirements.lock

clean:
	rm -rf $(VENV) runs dist
