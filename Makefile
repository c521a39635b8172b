# Main targets: `make demo` and `make test`; the others are for development.
PYTHON ?= python3
BIN := .venv/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
# byte code of the environment on all cores, faster than pip, which uses one
BYTECODE := $(BIN)/python -m compileall -q -q -j 0 .venv/lib src || true

# checks the types and shapes of all arguments and results at run time, which doubles the time of the tests
CHECKED := omnidrive,beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))

.PHONY: help demo env test quick lint types contract test-long docs notebook peers-if-possible lock clean

help:  ## list the targets
	@grep -hE '^[a-z%-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/' | expand -t 16

demo: .venv/ready  ## run the paper's study with physics and write its report
	$(BIN)/omnidrive compare

env: .venv/ready  ## create the environment in .venv from the lock file

test: .venv/ready-dev lint contract  ## lint, types, import contract and every quick test
	@$(MAKE) --no-print-directory --jobs=2 types quick  # mypy uses one core, at the same time

quick: .venv/ready-dev
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "not long"

test-long: .venv/ready-dev  ## tests that take minutes; quick ones with types checked; new examples of property tests
	$(BIN)/python -m pytest -n 2 --dist worksteal -m long
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "not long" --jaxtyping-packages='$(CHECKED)'
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "hypothesis and not long" --hypothesis-profile=fresh

lint: .venv/ready-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: .venv/ready-dev
	$(BIN)/mypy

contract: .venv/ready-dev
	$(BIN)/lint-imports --no-logo

bench-fuzzy: .venv/peers/ready

bench-nmpc bench-planning: peers-if-possible

peers-if-possible: | .venv/made
	-@$(MAKE) --no-print-directory .venv/peers/ready

bench-%: .venv/ready-dev  ## run benchmarks/NAME.py, which prints its results and writes benchmarks/out/NAME.json
	$(BIN)/python benchmarks/$*.py

docs: .venv/docs/ready  ## build the documentation site into site/; broken links fail
	.venv/docs/bin/python docs/mkdocs/scenario_page.py
	NO_MKDOCS_2_WARNING=1 PATH="$$PWD/.venv/docs/bin:$$PATH" .venv/docs/bin/mkdocs build --strict

notebook: .venv/docs/ready  ## execute the notebook of the documentation and store its outputs
	.venv/docs/bin/python docs/mkdocs/execute.py docs/notebooks/first_steps.ipynb

.venv/made:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "omnidrive needs Python 3.11 or newer; select one with: make PYTHON=python3.12 demo" >&2; exit 2; }
	@$(PYTHON) -m venv --clear .venv \
	  || { echo "$(PYTHON) cannot create an environment; on Debian and Ubuntu: apt install python3-venv" >&2; exit 2; }
	@touch $@

.venv/ready: requirements.lock pyproject.toml | .venv/made
	$(PIP) install --no-compile --require-hashes -r requirements.lock
	$(PIP) install --no-deps --no-build-isolation -e .
	@$(BYTECODE)
	@touch $@

.venv/ready-dev: requirements-dev.lock .venv/ready
	$(PIP) install --require-hashes -r requirements-dev.lock
	@touch $@

.venv/peers/ready: benchmarks/peers.lock | .venv/made
	@$(PYTHON) -m venv --clear .venv/peers
	.venv/peers/bin/python -m pip --disable-pip-version-check --quiet install --require-hashes -r benchmarks/peers.lock
	@touch $@

.venv/docs/ready: requirements-docs.lock pyproject.toml | .venv/made
	@$(PYTHON) -m venv --clear .venv/docs
	.venv/docs/bin/python -m pip --disable-pip-version-check --quiet install --require-hashes -r requirements-docs.lock
	.venv/docs/bin/python -m pip --disable-pip-version-check --quiet install --no-deps --no-build-isolation -e .
	@touch $@

lock:  ## update the lock files (needs uv)
	uv pip compile --quiet --universal --generate-hashes --python-version 3.11 \
	  --custom-compile-command "make lock" --group build pyproject.toml -o requirements.lock
	uv pip compile --quiet --universal --generate-hashes --python-version 3.11 \
	  --custom-compile-command "make lock" --group dev --extra casadi --extra cluster --extra coppeliasim --extra gymnasium --extra lekiwi --extra mcap --extra pandas --extra ros2 --extra tuning --extra wheels \
	  -c requirements.lock pyproject.toml -o requirements-dev.lock
	uv pip compile --quiet --universal --generate-hashes --python-version 3.11 \
	  --custom-compile-command "make lock" --group build --group docs --extra pandas -c requirements.lock pyproject.toml \
	  -o requirements-docs.lock
	uv pip compile --quiet --universal --generate-hashes --python-version 3.11 \
	  --custom-compile-command "make lock" benchmarks/peers.in -o benchmarks/peers.lock

clean:  ## remove environment, caches and compiled kernels; results in runs/ are kept
	rm -rf .venv build dist site .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache benchmarks/out
	find src tests docs benchmarks examples -name __pycache__ -type d -prune -exec rm -rf {} +
