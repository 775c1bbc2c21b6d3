# The commands of a contributor; `make` alone lists them.
# ARGS passes options on: make train ARGS="--help", make test ARGS="-k mesh -x".

PYTHON ?= python3
VENV ?= .venv
# The Ray programs have a separate environment, as Ray pins another gymnasium.
VENV_DISTRIBUTED ?= .venv-distributed
# Test processes; 0 runs the tests in one (for a debugger: make test WORKERS=0 ARGS="--pdb").
WORKERS ?= 2
ARGS ?=
# Tests that cover the kernels in minutes without the compiler.
UNCOMPILED := $(addprefix tests/physics/test_,$(addsuffix .py,contact corners mesh triangles simulate sweep swept_sphere world))

BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
INSTALLED_DOCS := $(VENV)/.installed-docs
INSTALLED_DISTRIBUTED := $(VENV_DISTRIBUTED)/.installed

.DEFAULT_GOAL := help
.PHONY: help train test test-all test-distributed soak fuzz endurance release licences mutants coverage bench docs notebooks lint check format clean

help: ## list the commands
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "make %-16s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

train: $(INSTALLED) ## train the PPO sample agent
	$(BIN)/python -m agents.train_ppo --max-runs 3 $(ARGS)

test: $(INSTALLED) ## run the tests
	$(BIN)/python -m pytest -n $(WORKERS) $(ARGS)

test-distributed: $(INSTALLED_DISTRIBUTED) ## run the tests of Ray on two nodes on this machine (minutes)
	$(VENV_DISTRIBUTED)/bin/python -m pytest tests/distributed $(ARGS)

bench: $(INSTALLED) ## measure speed, exactness and rendering next to other engines
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --requirement benchmarks/requirements.txt
	$(BIN)/python -m benchmarks.speed
	$(BIN)/python -m benchmarks.exactness
	$(BIN)/python -m benchmarks.rendering

test-all: $(INSTALLED) ## run the tests with each Python and Gymnasium, on wheel and sdist (an hour)
	$(BIN)/nox $(ARGS)

soak: $(INSTALLED) ## check every one of 10^8 time steps in random rooms (minutes)
	$(BIN)/python -m tools.soak $(ARGS)

release: $(INSTALLED) ## write wheel, sdist, lock file and bill of materials to dist/ (minutes)
	$(BIN)/nox -s release

licences: $(INSTALLED) ## write docs/licences.md, after a change of constraints.txt
	$(BIN)/nox -s licences

endurance: $(INSTALLED) ## 10^7 putts and 10,000 environments: memory and descriptors stay constant (half an hour)
	$(BIN)/python -m tools.endurance $(ARGS)

fuzz: $(INSTALLED) ## compare 10^5 sequences of calls with a small model (an hour)
	SEQUENCES=$${SEQUENCES:-100000} $(BIN)/python -m pytest -n $(WORKERS) tests/envs/test_sequences.py $(ARGS)

mutants: $(INSTALLED) ## break the program in 40 small ways and print those that no test notices (an hour)
	$(BIN)/python -m tools.mutation $(ARGS)

# Coverage does not see compiled code, so the faster tests run again without the compiler, where Python's floats would warn
# of divisions by zero.
coverage: $(INSTALLED) ## lines of the package that no test runs, compiled and not (half an hour)
	$(BIN)/coverage erase
	$(BIN)/coverage run -m pytest -n $(WORKERS)
	NUMBA_DISABLE_JIT=1 $(BIN)/coverage run -m pytest -n $(WORKERS) -W ignore::RuntimeWarning $(UNCOMPILED)
	$(BIN)/coverage combine
	$(BIN)/coverage report

docs: $(INSTALLED_DOCS) ## build the documentation: build/docs/index.html
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build

notebooks: $(INSTALLED) ## execute the notebooks and store their outputs (five minutes)
	$(BIN)/python -m notebooks.execute $(ARGS)

lint: $(INSTALLED) ## check style, types and import rules
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo

check: lint docs test ## what continuous integration runs: lint, build the pages, test

format: $(INSTALLED) ## fix style and formatting
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

clean: ## remove the environment, caches and build products
	rm -rf $(VENV) $(VENV_DISTRIBUTED) .nox build dist *.egg-info .*_cache .hypothesis
	find . -name __pycache__ -not -path './.*' -prune -exec rm -rf {} +

# The stamp file skips installation until a requirement or a pin changes.
$(INSTALLED): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --constraint constraints.txt --editable ".[agents,dev]"
	touch $@

# The documentation's few tools go into the same environment.
$(INSTALLED_DOCS): $(INSTALLED)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable ".[docs]"
	touch $@

$(INSTALLED_DISTRIBUTED): pyproject.toml constraints-distributed.txt
	$(PYTHON) -m venv $(VENV_DISTRIBUTED)
	$(VENV_DISTRIBUTED)/bin/python -m pip install --constraint constraints-distributed.txt --editable ".[agents,dev,distributed]"
	touch $@
