# Two commands on a fresh machine with Python 3.11+ and make: `make demo` and `make test`.

UV := UV_PYTHON_DOWNLOADS=never .venv/bin/uv
BIN := .venv/bin
PYTEST := $(BIN)/pytest --timeout 400 # a busy machine is no failure; what hangs is found all the same
FLIES := .venv/.flies
READY := .venv/.ready

.PHONY: demo help test test-room test-all test-pythons test-wheel test-browser docs docs-serve coverage lint types imports picture bench accuracy accuracy-weekly clean

demo: $(FLIES) ## bursts of losses with GA-RKF, which holds the formation, beside a filter alone; then over processes
	@echo "The first flight on a machine compiles its kernels, which takes half a minute; later ones begin at once."
	$(BIN)/affinet run bursts --duration 20 --sweep agents.estimator=ga-rkf,rkf --check 'bounded(5)' || test $$? = 1
	$(BIN)/affinet run bursts --duration 10

help: ## this list
	@sed -n 's/^\([a-z-]*\):.*## /\1  /p' $(MAKEFILE_LIST) | awk -F '  ' '{ printf "  make %-13s %s\n", $$1, $$2 }'

test: lint types imports ## everything that must hold, in minutes
	$(PYTEST) -n 2 --dist loadgroup

test-room: $(READY) ## a room's own tests, without flights over processes: make test-room ROOM=netem/medium
	$(PYTEST) -n 2 -m "not slow and not xdist_group" tests/$(ROOM)

test-all: lint types imports test-browser ## and the slow proofs
	$(BIN)/pytest -n 2 --dist loadgroup -m "slow or not slow" --timeout 1800

test-pythons: $(READY) ## set-up, demo and the tests that depend on it, on every Python from 3.11 on that is found
	$(BIN)/python tests/programs/pythons.py

test-wheel: $(READY) ## the wheel beside openai-agents, from a project whose modules are called like the rooms
	$(BIN)/python tests/programs/wheel.py

test-browser: $(READY) ## the web viewer in headless Chromium, in an environment of its own
	UV_PROJECT_ENVIRONMENT=.venv-browser $(UV) sync --locked --quiet --no-dev --group browser
	.venv-browser/bin/pytest -n0 tests/affinet/cli/test_in_a_browser.py

docs: $(READY) ## the site of docs/, into site/: open site/index.html
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet
	@echo "the site: file://$(CURDIR)/site/index.html"

docs-serve: $(READY) ## the site in a browser, built again whenever a page is written
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs serve

coverage: $(READY) ## which lines the tests in this process run, by room, into docs/coverage.md
	$(BIN)/coverage erase
	$(BIN)/coverage run -m pytest -n 2 --timeout 600 -m "not slow and not xdist_group"
	$(BIN)/coverage combine -q
	$(BIN)/coverage json -q -o .coverage.json
	$(BIN)/python docs/covered.py .coverage.json

lint: $(READY) ## ruff: errors, and the one format
	$(BIN)/ruff check
	$(BIN)/ruff format --check

types: $(READY) ## mypy, strict
	$(BIN)/mypy

imports: $(READY) ## import-linter: who may know whom
	$(BIN)/lint-imports

picture: $(READY) ## docs/pictures/house.svg and the contracts in docs/architecture.md, from imports and pyproject.toml
	$(BIN)/python docs/draw_house.py

bench: $(READY) ## speed against peers, and against the run kept last; fails where a ratio is 20 % worse
	$(UV) sync --locked --quiet --inexact --group bench --compile-bytecode
	$(BIN)/python bench/all.py

accuracy: $(READY) ## what is asked of the air against what it does, 100,000 verdicts of each model, in about a minute
	$(BIN)/python bench/accuracy.py --verdicts 100000

accuracy-weekly: $(READY) ## the same of a million, in eight minutes, into docs/accuracy.json and the tables of docs/accuracy.md
	$(BIN)/python bench/accuracy.py --keep docs/accuracy.json

# What somebody installed beside it, a project of their own, stays: --inexact.
$(READY): pyproject.toml uv.lock
	test -x $(BIN)/python || python3 -m venv .venv
	test -x $(BIN)/uv || $(BIN)/python -m pip install --quiet uv
	$(UV) sync --locked --quiet --inexact --compile-bytecode
	$(BIN)/python -m compileall -q affinet agents analysis netem world
	$(BIN)/python packaging/compiled.py
	touch $@ $(FLIES)

# All that flights and the pages need, and no more: it is there in seconds, and kernels are compiled as they are called.
$(FLIES): pyproject.toml uv.lock
	test -x $(BIN)/python || python3 -m venv .venv
	test -x $(BIN)/uv || $(BIN)/python -m pip install --quiet uv
	$(UV) sync --locked --quiet --no-dev --group pages --inexact
	touch $@

clean: ## without environments and runs
	rm -rf .venv .venv-3.* runs site
