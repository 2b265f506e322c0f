# One command for each thing people do here; `make help` lists them.
PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready
PORT   ?= 8000
JOBS   ?= auto
OFFSET ?= 1000
# JupyterLab asks to be told when it is root that starts it, as in a container.
AS_ROOT := $(if $(filter 0,$(shell id -u)),--allow-root)

# The matrices here are small: a second BLAS thread costs more than it brings, and the tests run side by side.
export OPENBLAS_NUM_THREADS ?= 1

.DEFAULT_GOAL := help
.PHONY: help setup lab desk solved test fresh test-slow test-portable test-wheel test-lock test-browser test-answers book pdf serve lint format student dist bench lock clean

help:  ## List the commands
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-13s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: $(READY)  ## Make .venv and install everything, each file checked against its hash

$(READY): requirements.lock pyproject.toml
	@$(PYTHON) -c '' 2>/dev/null || { echo "There is no $(PYTHON) here that works. Install Python 3.11 or newer, or name another: make PYTHON=python3.12 setup"; exit 1; }
	@$(PYTHON) tools/set_up.py $(VENV)
	@touch $@

lab: desk  ## Open your copies of the labs in JupyterLab (ARGS="--no-browser" and the like are passed on)
	@$(BIN)/jupyter lab $(AS_ROOT) --config=tools/jupyter_lab_config.py $(ARGS)

desk: setup  ## Write your copies of the labs, solutions emptied, into my_labs; what you wrote stays
	@$(BIN)/python tools/desk.py

solved: setup  ## Write the solved labs into my_labs/solved
	@$(BIN)/python tools/desk.py solved

# With COVERAGE=1 the run of the package's tests is the one that is measured.
.PHONY: test-package test-labs coverage
test: test-package test-labs  ## Run every test: package, sliders, exercises, notebooks

test-package: setup
	$(BIN)/python -m pytest -q -n $(JOBS) --dist loadgroup -m "not browser and not slow" $(if $(COVERAGE),--cov --cov-report= --durations=20)
ifdef COVERAGE
	$(BIN)/coverage report > coverage.txt; cat coverage.txt
endif

# The labs in their kernels, each slider swept and each check strict: tests/rehearsal.py.
REHEARSE = $(BIN)/python -m pytest -q -n $(JOBS) -p tests.rehearsal --nbmake --nbmake-timeout=300 notebooks
test-labs: setup
	$(REHEARSE)

coverage:  ## Show what the tests of the package do not reach, branch by branch; the labs' kernels are left out
	$(MAKE) test-package COVERAGE=1

fresh: setup  ## Run every lab with other seeds: make fresh OFFSET=1000
	COURSEKIT_SEED_OFFSET=$(OFFSET) $(REHEARSE)

test-slow: setup  ## Run the full-size evidence: fifty and a hundred seeds
	$(BIN)/python -m pytest -q -n $(JOBS) --dist loadgroup -m "slow and not browser" tests

test-lock: setup  ## Ask the oldest pip whether it would install what is locked, and nothing published later
	$(BIN)/python tools/oldest_pip.py

test-wheel: setup  ## Build the wheel and try it in a bare environment, with NumPy and SciPy alone
	$(BIN)/python tools/try_wheel.py $(ARGS)

test-portable: setup  ## Run the numerical tests on every kind of arithmetic this processor can do
	$(BIN)/python tools/portable.py $(ARGS)

test-browser: setup  ## Open every page of the built book, and a live lab, in Chromium, and in Firefox if there is one (SLOW=1: axe on every page too)
	$(BIN)/python -m pytest -q -m "$(if $(SLOW),browser,browser and not slow)" tests/browser $(ARGS)

test-answers: setup  ## Give every right and wrong answer to the check that runs in a browser
	$(BIN)/python -m pytest -q -m "browser and slow" tests/browser/test_answers.py

book: setup  ## Build the static book into book/_build/html
	$(BIN)/python book/build.py

pdf: book  ## Build the book, and with it one PDF and one ZIP to take along (needs Chromium)
	$(BIN)/python book/along.py

serve: book  ## Build the book and show it on http://localhost:8000
	$(BIN)/python -m http.server --bind 127.0.0.1 --directory book/_build/html $(PORT)

lint: setup  ## Check style, types and spelling
	$(BIN)/python tools/clean_notebooks.py --check
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	git ls-files '*.py' '*.md' '*.ipynb' '*.toml' '*.js' '*.css' '*.html' '*.yml' | xargs $(BIN)/codespell

format: setup  ## Put style right where that can be done by a program
	$(BIN)/python tools/clean_notebooks.py
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

student: setup  ## Write the student edition, solutions emptied, into dist/student, to hand out
	$(BIN)/python tools/desk.py --to dist/student

.PHONY: handout instructor
handout: book  ## Write one archive for a class without answers into dist: labs, package with data, lock, book
	$(BIN)/python tools/handout.py

instructor: setup  ## Write solved labs, teaching guides, slides, syllabus and question bank into instructor
	$(BIN)/python tools/instructor.py

.PHONY: grade nbgrader otter
grade: setup  ## Grade a folder of notebooks: make grade SUBMISSIONS=dir (ARGS="--labs lab04" and the like are passed on)
	@$(BIN)/python tools/grade.py "$(SUBMISSIONS)" $(ARGS)

nbgrader: setup  ## Write the labs for nbgrader, solutions included, into dist/nbgrader
	@$(BIN)/python tools/classroom.py nbgrader $(ARGS)

otter: setup  ## Write the labs for otter assign, solutions included, into dist/otter
	@$(BIN)/python tools/classroom.py otter $(ARGS)

dist: setup  ## Build the package's wheel and source archive into dist
	$(BIN)/python -c "from setuptools.build_meta import build_sdist, build_wheel; build_sdist('dist'); build_wheel('dist')"

.PHONY: mutate
mutate: setup  ## Break a room's code in small ways, see if its tests notice: make mutate ROOM=geometry ARGS="--sample 50"
	$(BIN)/python -m pip install --quiet "mutmut>=3.8"
	$(BIN)/python tools/mutate.py $(ROOM) $(ARGS)

# BENCH: a Python that has the peers (extra "benchmarks").  SCRIPTS: some of them.  ROUNDS: another number for all.
BENCH   ?= $(BIN)/python
SCRIPTS ?= ekf icp slam graph particles visual camera world imports explorers
bench: setup  ## Measure speed, beside the peers that BENCH=python has, into benchmarks/results (SCRIPTS="ekf icp": only these)
	@failed=""; for script in $(SCRIPTS); do echo "== benchmarks/$$script.py"; \
	  $(BENCH) benchmarks/$$script.py --json benchmarks/results/$$script.json $(if $(ROUNDS),--rounds $(ROUNDS)) || failed="$$failed $$script"; \
	done; [ -z "$$failed" ] || { echo "Missed a target of their own:$$failed"; exit 1; }

lock:  ## Work out requirements.lock anew from pyproject.toml (needs uv; ARGS=--upgrade takes the newest of all)
	uv pip compile --universal --python-version 3.11 --extra labs --extra book --extra test --extra browser --extra pdf --generate-hashes \
	  --no-strip-extras --no-emit-index-url --no-header --quiet $(ARGS) pyproject.toml -o requirements.lock

clean:  ## Remove what was built; .venv stays
	rm -rf book/_build dist instructor .pytest_cache .mypy_cache .ruff_cache .hypothesis .coverage coverage.txt
