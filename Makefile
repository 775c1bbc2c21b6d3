# Everything a contributor runs. `make` alone lists the commands.
# ARGS passes options on: make train ARGS="--help", make test ARGS="-k mesh -x".

PYTHON ?= python3
VENV ?= .venv
# Ray pins another gymnasium, so what needs it has an environment of its own.
VENV_DISTRIBUTED ?= .venv-distributed
# Test processes; 0 runs the tests in one (for a debugger: make test WORKERS=0 ARGS="--pdb").
WORKERS ?= 2
ARGS ?=
# Tests that show the kernels at work in minutes without a compiler.
UNCOMPILED := $(addprefix tests/physics/test_,$(addsuffix .py,contact corners mesh normals simulate sweep swept_sphere world))

BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
INSTALLED_DOCS := $(VENV)/.installed-docs
INSTALLED_DISTRIBUTED := $(VENV_DISTRIBUTED)/.installed

.DEFAULT_GOAL := help
.PHONY: help train test test-all test-distributed soak fuzz endurance supply mutants mutants-envs coverage bench docs notebooks lint check format clean

help: ## list the commands
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "make %-16s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

train: $(INSTALLED) ## train the PPO sample agent
	$(BIN)/python -m agents.train_ppo --seeds 3 $(ARGS)

test: $(INSTALLED) ## run the tests
	$(BIN)/python -m pytest -n $(WORKERS) $(ARGS)

test-distributed: $(INSTALLED_DISTRIBUTED) ## run the tests of Ray on two nodes on this machine (minutes)
	$(VENV_DISTRIBUTED)/bin/python -m pytest tests/distributed $(ARGS)

bench: $(INSTALLED) ## measure speed, exactness and pictures beside other engines
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --requirement benchmarks/requirements.txt
	$(BIN)/python -m benchmarks.speed
	$(BIN)/python -m benchmarks.exactness
	$(BIN)/python -m benchmarks.rendering

test-all: $(INSTALLED) ## run the tests with each Python and Gymnasium, on wheel and sdist (an hour)
	$(BIN)/nox $(ARGS)

soak: $(INSTALLED) ## look at every one of 10^8 steps in random rooms (minutes)
	$(BIN)/python -m tools.soak $(ARGS)

supply: $(INSTALLED) ## write lock file, bill of materials and licences anew, after a change of constraints.txt
	$(BIN)/nox -s supply

endurance: $(INSTALLED) ## does the package tire of 10^7 putts and 10,000 environments? (half an hour)
	$(BIN)/python -m tools.endurance $(ARGS)

fuzz: $(INSTALLED) ## compare 10^5 sequences of calls with what must hold (an hour)
	SEQUENCES=$${SEQUENCES:-100000} $(BIN)/python -m pytest -n $(WORKERS) tests/envs/test_sequences.py $(ARGS)

mutants: $(INSTALLED) ## break the physics in many ways: do the tests notice? (twenty minutes)
	$(BIN)/python -m tools.mutation.mutations $(ARGS)

mutants-envs: $(INSTALLED) ## the same for rules and courses, with mutmut: 60 faults a module (an hour)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt mutmut==3.8.1
	$(BIN)/python -m tools.mutation.mutants --sample 60 $(ARGS)

# Compiled kernels are not seen: the tests that end in time are run once more without the compiler. Python's own floats
# would divide by zero with a warning.
coverage: $(INSTALLED) ## which lines of the package do the tests run, compiled and not? (half an hour)
	$(BIN)/coverage erase
	$(BIN)/coverage run -m pytest -n $(WORKERS)
	NUMBA_DISABLE_JIT=1 $(BIN)/coverage run -m pytest -n $(WORKERS) -W ignore::RuntimeWarning $(UNCOMPILED)
	$(BIN)/coverage combine
	$(BIN)/coverage report

docs: $(INSTALLED_DOCS) ## build the documentation: build/docs/index.html
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build

notebooks: $(INSTALLED) ## run the notebooks and store what they show (five minutes)
	$(BIN)/python -m notebooks.execute $(ARGS)

lint: $(INSTALLED) ## check style, types and import rules
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo

check: lint docs test ## what continuous integration runs: lint, build the pages, test

format: $(INSTALLED) ## mend style and formatting
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

clean: ## remove the environment, caches and build products
	rm -rf $(VENV) $(VENV_DISTRIBUTED) .nox build dist *.egg-info .*_cache .hypothesis
	find . -name __pycache__ -not -path './.*' -prune -exec rm -rf {} +

# The stamp makes a second run install nothing; a changed requirement or pin installs again.
$(INSTALLED): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --constraint constraints.txt --editable ".[agents,dev]"
	touch $@

# Its tools are few beside the rest: they go into the same environment, for those who build it.
$(INSTALLED_DOCS): $(INSTALLED)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable ".[docs]"
	touch $@

$(INSTALLED_DISTRIBUTED): pyproject.toml constraints-distributed.txt
	$(PYTHON) -m venv $(VENV_DISTRIBUTED)
	$(VENV_DISTRIBUTED)/bin/python -m pip install --constraint constraints-distributed.txt --editable ".[agents,dev,distributed]"
	touch $@
