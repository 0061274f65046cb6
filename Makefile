PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready

.DEFAULT_GOAL := help
.PHONY: help demo serve test check compiled unit coverage proof bench format openapi lock clean

help: ## list the commands
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 12

$(READY): requirements.lock requirements-boot.lock pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "homsense needs Python 3.11 or later")'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --require-hashes -r requirements-boot.lock
	$(BIN)/uv pip sync --quiet --compile-bytecode --python $(BIN)/python --require-hashes requirements.lock
	$(BIN)/uv pip install --quiet --python $(BIN)/python --no-deps --no-build-isolation --editable .
	@touch $@

demo: $(READY) ## map a simulated downtown, localize a robot in it, write demo/
	$(BIN)/homsense demo --out demo

serve: $(READY) ## serve on 127.0.0.1:8080 with the data in ./data
	$(BIN)/homsense serve --data data

test: $(READY) ## everything that CI runs
	@$(MAKE) --no-print-directory --jobs=2 --output-sync check compiled
	@$(MAKE) --no-print-directory unit

check: $(READY) ## format, lint, types, layers, docstrings
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m numpydoc.hooks.validate_docstrings $$(git ls-files --cached --others --exclude-standard 'homsense/*.py')

compiled: $(READY) ## let numba compile, so that no test waits for it
	$(BIN)/python -c 'from homsense import backend, engine; backend.warmed(); engine.warmed()'

unit: $(READY) ## unit, property, contract and integration tests
	$(BIN)/python -m pytest

coverage: $(READY) ## the same tests, and the branches that none of them takes
	$(BIN)/coverage erase
	$(BIN)/coverage run -m pytest
	@$(BIN)/coverage combine --quiet
	@$(BIN)/coverage report --skip-covered

proof: $(READY) ## slow proof: coverage, exactness, calibration, recovery, demos, 240 kills, 10^6 malformed inputs, soak, accuracy; DATA=recorded data
	$(MAKE) coverage
	$(BIN)/python benchmarks/exactness.py
	$(BIN)/python benchmarks/same_bits.py
	$(BIN)/python benchmarks/calibration.py
	$(BIN)/python benchmarks/demo_seeds.py
	$(BIN)/python benchmarks/contract.py
	$(BIN)/python benchmarks/fuzz.py
	$(BIN)/python benchmarks/kill_storm.py
	$(BIN)/python benchmarks/stream_storm.py
	$(BIN)/python benchmarks/soak.py
	$(BIN)/python benchmarks/accuracy.py $(DATA)
	$(if $(DATA),$(BIN)/python benchmarks/registered.py $(DATA))
	$(if $(DATA),$(BIN)/python benchmarks/floors.py $(DATA))
	$(if $(DATA),$(BIN)/python benchmarks/thin_crowds.py $(DATA))

.venv-peers/.ready: $(READY) requirements-peers.lock
	$(PYTHON) -m venv .venv-peers
	$(BIN)/uv pip sync --quiet --compile-bytecode --python .venv-peers/bin/python --require-hashes requirements-peers.lock
	@touch $@

bench: $(READY) .venv-peers/.ready ## compare with peers in the same run; writes docs/performance.md
	$(BIN)/python benchmarks/performance.py
	$(BIN)/python benchmarks/load.py
	$(BIN)/python benchmarks/streaming.py
	$(BIN)/python benchmarks/startup.py
	$(BIN)/python benchmarks/registered_growth.py

format: $(READY) ## format and mend what can be mended
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

openapi: $(READY) ## write openapi/openapi.json from the routes
	$(BIN)/python -m homsense_service.openapi openapi/openapi.json

lock: $(READY) ## resolve the dependencies again
	$(BIN)/uv pip compile pyproject.toml --all-extras --group test --group build --universal \
	  --generate-hashes --no-emit-index-url --no-emit-find-links --no-header --no-annotate \
	  --quiet --upgrade -o requirements.lock
	$(BIN)/uv pip compile --group boot --universal \
	  --generate-hashes --no-emit-index-url --no-emit-find-links --no-header --no-annotate \
	  --quiet --upgrade -o requirements-boot.lock
	$(BIN)/uv pip compile --group peers --universal \
	  --generate-hashes --no-emit-index-url --no-emit-find-links --no-header --no-annotate \
	  --quiet --upgrade -o requirements-peers.lock

clean: ## remove what the other commands made
	rm -rf .venv .venv-peers demo build dist .coverage .coverage.* .mypy_cache .ruff_cache .pytest_cache .hypothesis
