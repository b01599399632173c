# Each target makes its own virtual environment when there is none.
PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
SERVER := $(VENV)/.server
READY  := $(VENV)/.ready

# Small matrices on shared cores: threads of the linear algebra would wait for one another.
export OPENBLAS_NUM_THREADS ?= 1
# Each process that starts would compile all of it anew, 0.7 s at a time: `__pycache__` is what that is for.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test unit integration acceptance check bench screens guide long test-long branches newest oldest lock clean

demo: $(SERVER)
	$(BIN)/modalbase demo

# Three at a time on two cores, as many tests wait for processes; an idle one takes from another, so none ends alone.
test: $(READY)
	$(BIN)/python -m pytest -n 3 --dist worksteal

# A tier of the tests alone: unit needs neither database nor process, integration has PostgreSQL and workers,
# acceptance is at the level a user stands.
unit integration acceptance: $(READY)
	$(BIN)/python -m pytest -n $(or $(WORKERS_$@),3) --dist worksteal tests/$@

# These wait for nothing.
WORKERS_unit := 2

check: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m tools.house
	$(BIN)/python -m tools.words

bench: $(READY)
	$(BIN)/python -m benchmarks accuracy speed

# A picture of each page in build/screens; needs the system's Chromium.
screens: $(READY)
	$(BIN)/python -m tools.screens

# The guide as files for a browser, in build/guide; a service has it at /guide.
guide: $(SERVER)
	$(BIN)/python -m tools.guide

# The long tests, each of which the tests have in a short form, as `branches` shows; with `test-long` the soaks too.
long: $(READY)
	$(BIN)/python -m pytest -n 3 --dist worksteal -m long

test-long: long
	$(BIN)/python -m benchmarks soak

branches: $(READY)
	$(BIN)/python -m tools.branches

# The tests with the newest and with the lowest versions that pyproject.toml allows, in environments of their own.
newest oldest:
	$(PYTHON) -m venv .venv-$@
	.venv-$@/bin/python -m pip install --disable-pip-version-check --upgrade uv
	.venv-$@/bin/uv pip install --python .venv-$@/bin/python --upgrade --resolution $(RESOLUTION_$@) --editable '.[dev]'
	.venv-$@/bin/python -m pytest -n 3 --dist worksteal $(WARNINGS_$@)

RESOLUTION_newest := highest
RESOLUTION_oldest := lowest-direct
# Of libraries of other years about one another.
WARNINGS_oldest   := -W default::DeprecationWarning -W default::FutureWarning

# One resolution for Python 3.11 to 3.14 and every platform: what the service needs, and with it what the tests need.
lock:
	$(PYTHON) -m venv build/uv
	build/uv/bin/python -m pip install --disable-pip-version-check --upgrade uv
	$(COMPILE) --upgrade --extra dev --output-file requirements-dev.lock pyproject.toml
	echo setuptools | $(COMPILE) --constraint requirements-dev.lock --extra server --output-file requirements.lock pyproject.toml -

COMPILE := build/uv/bin/uv pip compile --quiet --universal --fork-strategy fewest --python-version 3.11 --generate-hashes --no-header --no-annotate

# What the service needs; and what the tests and checks need beside it. Each is installed as it was tested, by its SHA-256.
$(SERVER): pyproject.toml requirements.lock
	$(call install,requirements.lock,$(SIZE_SERVER))
	touch $@

$(READY): pyproject.toml requirements-dev.lock
	$(call install,requirements-dev.lock,$(SIZE_DEV))
	touch $(SERVER) $@

SIZE_SERVER := 630 MB, of which PostgreSQL, scipy, matplotlib and numpy are most
SIZE_DEV    := 1070 MB with the tools of the tests and checks
define install
	@$(PYTHON) -c 'import sys; sys.exit(None if sys.version_info >= (3, 11) else "modalbase needs Python 3.11 or newer: make PYTHON=python3.11 ...")'
	@echo "modalbase: installing into $(VENV), once: $(2)"
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --disable-pip-version-check --require-hashes --requirement $(1)
	$(BIN)/python -m pip install --disable-pip-version-check --no-deps --no-build-isolation --editable .
endef

clean:
	rm -rf $(VENV) .venv-newest .venv-oldest
