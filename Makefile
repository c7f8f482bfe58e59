# Two commands: `make run` records a simulated run-up with live view and REST; `make test` checks everything.
# Both do all their set-up in .venv, from bare Debian packages: python3 (3.11 or newer), python3-venv, make.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/ready
RIG ?= rigs/bench.toml

.PHONY: run serve test check bench campaign proto clean

run: $(READY)
	$(BIN)/rig predict $(RIG) --quiet
	$(BIN)/rig record $(RIG)

serve: $(READY)
	$(BIN)/rig serve $(RIG)

test: $(READY) check
	$(BIN)/coverage erase
	$(BIN)/coverage run -m pytest
	$(BIN)/coverage combine --quiet
	$(BIN)/coverage report

check: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports --no-cache
	$(BIN)/mypy

bench: $(READY)
	$(BIN)/pytest tests/benchmarks -m benchmark -s

campaign: $(READY)
	$(BIN)/pytest tests -m campaign -s

# The protobuf code is committed; run this after changing recordings/rig.proto.
proto: $(READY)
	$(BIN)/python -m grpc_tools.protoc --proto_path=. --python_out=. --pyi_out=. recordings/rig.proto

$(READY): pyproject.toml constraints.txt
	@command -v $(PYTHON) >/dev/null || { echo "$(PYTHON) is missing: apt install python3 python3-venv"; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "Python 3.11 or newer is needed, found $$($(PYTHON) --version); set PYTHON=python3.11 or newer"; exit 1; }
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || { echo "python3-venv is missing: apt install python3-venv"; exit 1; }
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable ".[card,view,formats,dev]"
	@touch $(READY)

clean:
	rm -rf $(VENV) build *.egg-info .mypy_cache .ruff_cache .pytest_cache .coverage .coverage.*
