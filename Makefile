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

.PHONY: demo test unit integration acceptance check bench screens guide soak clean

demo: $(SERVER)
	$(BIN)/modalbase demo

# Three at a time on two cores, as many tests wait for processes; an idle one takes from another, so none ends alone.
test: $(READY)
	$(BIN)/python -m pytest -n 3 --dist worksteal

# A tier of the tests alone: unit needs neither database nor process, integration has PostgreSQL and workers,
# acceptance is at the level a user stands.
unit integration acceptance: $(READY)
	$(BIN)/python -m pytest -n 3 --dist worksteal tests/$@

check: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m tools.house

bench: $(READY)
	$(BIN)/python -m benchmarks accuracy speed

# A picture of each page in build/screens; needs the system's Chromium.
screens: $(READY)
	$(BIN)/python -m tools.screens

# The guide as files for a browser, in build/guide; a service has it at /guide.
guide: $(SERVER)
	$(BIN)/python -m tools.guide

# Long runs that print counts; the tests have each in a short form.
soak: $(READY)
	$(BIN)/python -m benchmarks soak
	MODALBASE_TEST_LONG=1 $(BIN)/python -m pytest tests/acceptance/test_main_job.py tests/integration/test_every_operation.py \
		tests/integration/test_few_frfs.py

# What the service needs; and what the tests and checks need beside it.
$(SERVER): pyproject.toml
	$(call install,.[server],$(SIZE_SERVER))
	touch $@

$(READY): pyproject.toml
	$(call install,.[dev],$(SIZE_DEV))
	touch $(SERVER) $@

SIZE_SERVER := 510 MB, of which PostgreSQL, scipy, matplotlib and numpy are most
SIZE_DEV    := 940 MB with the tools of the tests and checks
define install
	@$(PYTHON) -c 'import sys; sys.exit(None if sys.version_info >= (3, 11) else "modalbase needs Python 3.11 or newer: make PYTHON=python3.11 ...")'
	@echo "modalbase: installing into $(VENV), once: $(2)"
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --disable-pip-version-check --editable '$(1)'
endef

clean:
	rm -rf $(VENV)
