# Two commands on a fresh machine with Python 3.11+ and make: `make demo` and `make test`.

UV := UV_PYTHON_DOWNLOADS=never .venv/bin/uv
BIN := .venv/bin
READY := .venv/.ready

.PHONY: demo test test-all test-pythons test-wheel lint types imports bench clean

demo: $(READY) ## fly the corridor over processes
	$(BIN)/affinet run corridor

test: lint types imports ## everything that must hold, in minutes
	$(BIN)/pytest -n 2 --dist loadgroup

test-all: lint types imports ## and the slow proofs
	$(BIN)/pytest -n 2 --dist loadgroup -m "slow or not slow" --timeout 1800

test-pythons: $(READY) ## set-up, demo and the tests that depend on it, on every Python from 3.11 on that is found
	$(BIN)/python tests/programs/pythons.py

test-wheel: $(READY) ## the wheel beside openai-agents, from a project whose modules are called like the rooms
	$(BIN)/python tests/programs/wheel.py

lint: $(READY)
	$(BIN)/ruff check
	$(BIN)/ruff format --check

types: $(READY)
	$(BIN)/mypy

imports: $(READY)
	$(BIN)/lint-imports

bench: $(READY) ## the tick against the floor
	$(BIN)/python bench/lockstep.py

$(READY): pyproject.toml uv.lock
	test -x $(BIN)/python || python3 -m venv .venv
	test -x $(BIN)/uv || $(BIN)/python -m pip install --quiet uv
	$(UV) sync --locked --quiet --compile-bytecode
	touch $@

clean:
	rm -rf .venv .venv-3.* runs
