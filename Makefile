# One command for each thing people do here; `make help` lists them.
PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready
PORT   ?= 8000
JOBS   ?= auto
# JupyterLab asks to be told when it is root that starts it, as in a container.
AS_ROOT := $(if $(filter 0,$(shell id -u)),--allow-root)

# The matrices here are small: a second BLAS thread costs more than it brings, and the tests run side by side.
export OPENBLAS_NUM_THREADS ?= 1

.DEFAULT_GOAL := help
.PHONY: help setup lab test test-slow test-browser book serve lint format student bench lock clean

help:  ## List the commands
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-13s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: $(READY)  ## Make .venv and install everything, each file checked against its hash

$(READY): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed, this is " + sys.version.split()[0] + "; try make PYTHON=python3.12 ...")'
	@echo "Setting up $(VENV): a minute or two, once."
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --disable-pip-version-check --quiet --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --disable-pip-version-check --quiet --no-deps --no-build-isolation --editable .
	@touch $@

lab: setup  ## Open the labs in JupyterLab (ARGS="--no-browser" and the like are passed on)
	$(BIN)/jupyter lab $(AS_ROOT) $(ARGS) notebooks

test: setup  ## Run every test: package, sliders, exercises, notebooks
	$(BIN)/python -m pytest -q -n $(JOBS) --dist loadgroup -m "not browser and not slow" tests
	$(BIN)/python -m pytest -q -n $(JOBS) --nbmake --nbmake-timeout=300 notebooks

test-slow: setup  ## Run the full-size evidence: fifty and a hundred seeds
	$(BIN)/python -m pytest -q -n $(JOBS) --dist loadgroup -m slow tests

test-browser: setup  ## Open every page of the built book, and a live lab, in Chromium
	$(BIN)/python -m pytest -q -m browser tests/browser

book: setup  ## Build the static book into book/_build/html
	$(BIN)/python book/build.py

serve: book  ## Build the book and show it on http://localhost:8000
	$(BIN)/python -m http.server --bind 127.0.0.1 --directory book/_build/html $(PORT)

lint: setup  ## Check style and types
	$(BIN)/python tools/clean_notebooks.py --check
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: setup  ## Put style right where that can be done by a program
	$(BIN)/python tools/clean_notebooks.py
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

student: setup  ## Write the student edition, solutions emptied, into dist/student
	$(BIN)/python tools/student_edition.py

bench: setup  ## Run the benchmarks (peers are compared where they are installed)
	@for script in benchmarks/*.py; do echo "== $$script"; $(BIN)/python $$script || exit 1; done

lock:  ## Work out requirements.lock anew from pyproject.toml (needs uv)
	uv pip compile --universal --python-version 3.11 --extra book --extra test --extra browser --generate-hashes \
	  --no-emit-index-url --no-header --upgrade --quiet pyproject.toml -o requirements.lock

clean:  ## Remove what was built; .venv stays
	rm -rf book/_build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
