# Each target makes its own virtual environment when there is none.
PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready

# Small matrices on shared cores: threads of the linear algebra would wait for one another.
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: demo test unit integration acceptance check bench soak clean

demo: $(READY)
	$(BIN)/modalbase demo

test: $(READY)
	$(BIN)/python -m pytest -n 2

# A tier of the tests alone: unit needs neither database nor process, integration has PostgreSQL and workers,
# acceptance is at the level a user stands.
unit integration acceptance: $(READY)
	$(BIN)/python -m pytest -n 2 tests/$@

check: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(READY)
	$(BIN)/python -m benchmarks

# Long runs that print counts; the tests have each in a short form.
soak: $(READY)
	$(BIN)/python -m benchmarks.soak_kills

$(READY): pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(None if sys.version_info >= (3, 11) else "modalbase needs Python 3.11 or newer: make PYTHON=python3.11 ...")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $@

clean:
	rm -rf $(VENV)
