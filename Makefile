# `make run` records a simulated run-up with live view and REST; `make test` runs all checks and tests.
# Both set up .venv themselves; they need the Debian packages python3 (3.11 or newer), python3-venv and make.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RUNTIME := $(VENV)/ready-run
READY := $(VENV)/ready
ORACLE := .venv-oracle/ready
RIG ?= rigs/bench.toml
TYPESCRIPT := typescript@5.9.3
TSC := npx --yes --prefer-offline --fetch-retries=0 --package $(TYPESCRIPT) tsc
# Without byte-compilation, which takes pip longer than Python needs for the modules that a command imports.
PIP = $(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check --constraint constraints.txt

.PHONY: run serve test coverage check javascript docs bench campaign oracle numbers proto clean

run: $(RUNTIME)
	$(BIN)/rig record $(RIG)

serve: $(RUNTIME)
	$(BIN)/rig serve $(RIG)

test: $(READY) check
	OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -n 3 --dist loadfile

# The tests with branch coverage; takes a third longer.
coverage: $(READY)
	$(BIN)/coverage erase
	OPENBLAS_NUM_THREADS=1 $(BIN)/coverage run -m pytest -n 3 --dist loadfile
	$(BIN)/coverage combine --quiet
	$(BIN)/coverage report --fail-under 90

check: $(READY) javascript
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports --no-cache
	$(BIN)/mypy

# Checks the types of the page's JavaScript; only CI requires npm.
javascript:
	@if $(TSC) --version >/dev/null 2>&1; then echo "tsc -p daq/console/jsconfig.json" && $(TSC) -p daq/console/jsconfig.json; \
	elif [ -n "$(CI)" ]; then echo "$(TYPESCRIPT) cannot be fetched by npx: apt install npm"; exit 1; \
	else echo "JavaScript is not type-checked: npx is missing or cannot fetch $(TYPESCRIPT)"; fi

# The documentation as a site in build/docs; a warning is an error.
docs: $(VENV)/ready-docs
	$(BIN)/sphinx-build --quiet --fail-on-warning --keep-going --builder html docs build/docs
	@echo "build/docs/index.html"

bench: $(VENV)/ready-bench
	$(BIN)/pytest tests/benchmarks -m benchmark -s

campaign: $(READY)
	$(BIN)/pytest tests -m campaign -s

# Recomputes tests/validation/ross/ross.json with ROSS, another rotor program, in its own environment.
oracle: $(READY) $(ORACLE)
	$(BIN)/pytest tests/validation -m oracle

# The numeric tests only; set OPENBLAS_CORETYPE (Prescott, Haswell, Zen, SkylakeX) to use the kernels of another processor.
numbers: $(READY)
	OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -n 2 --dist loadfile tests/analysis tests/model tests/validation

$(ORACLE): tests/validation/ross/requirements.txt
	test -x .venv-oracle/bin/python || $(PYTHON) -m venv .venv-oracle
	.venv-oracle/bin/python -m pip install --quiet --disable-pip-version-check --requirement $<
	@touch $(ORACLE)

# The protobuf code is committed; run this after changing recordings/mcap/rig.proto.
proto: $(READY)
	$(BIN)/python -m grpc_tools.protoc --proto_path=recordings/mcap --python_out=recordings/mcap --pyi_out=recordings/mcap rig.proto

# Installs what `make run` needs; `make test` installs the test tools as well.
$(RUNTIME): pyproject.toml constraints.txt
	@command -v $(PYTHON) >/dev/null || { echo "$(PYTHON) is missing: apt install python3 python3-venv"; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "Python 3.11 or newer is needed, found $$($(PYTHON) --version); set PYTHON=python3.11 or newer"; exit 1; }
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || { echo "python3-venv is missing: apt install python3-venv"; exit 1; }
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(PIP) --editable ".[card,view,formats]"
	@touch $@

$(READY): $(RUNTIME)
	$(PIP) --editable ".[card,view,formats,dev]"
	@touch $@

$(VENV)/ready-docs: $(RUNTIME)
	$(PIP) --editable ".[card,view,formats,docs]"
	@touch $@

$(VENV)/ready-bench: $(READY)
	$(PIP) --editable ".[bench]"
	@touch $@

clean:
	rm -rf $(VENV) .venv-oracle build docs/generated *.egg-info .mypy_cache .ruff_cache .pytest_cache .coverage .coverage.*
