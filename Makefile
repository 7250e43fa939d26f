# make          set up what is missing, then reproduce the paper
# make test     set up what is missing, then run the tests
# make beyond   the paper, and the studies that go further
# make coverage how often the intervals of riv hold the truth: 1,000 trials of eight settings
# make benchmark  time, memory and accuracy beside other programs
SHELL := /bin/bash
.DELETE_ON_ERROR:
.DEFAULT_GOAL := all
.PHONY: all setup test beyond coverage benchmark expected docs-numbers lint format rulegraph lock clean

CORES ?= 2
PYTHON ?= $(firstword $(shell command -v python3.11 python3 python))
VENV := .venv
BIN := $(VENV)/bin
PACKAGES := $(VENV)/.packages
READY := $(VENV)/.ready
export PATH := $(CURDIR)/$(BIN):$(PATH)
# A path of another environment must not reach into this one.
unexport PYTHONPATH PYTHONHOME

all: setup
	snakemake --cores $(CORES)

setup: $(READY)

test: setup
	python -m pytest $(ARGS)

beyond: setup
	snakemake --cores $(CORES) --configfile config/beyond.yaml

# Eight minutes on two cores; prints its progress and a table.
coverage: setup
	python benchmarks/coverage.py --cores $(CORES) $(ARGS)

# Ten minutes; the peers that are measured against go into a folder of their own, behind the environment.
PEERS := $(VENV)/peers
benchmark: setup $(PEERS)
	python benchmarks/peers.py $(ARGS)

$(PEERS): benchmarks/requirements.txt $(READY)
	python -m pip install --quiet --disable-pip-version-check --upgrade --no-deps --target $@ -r $<
	@touch $@

# Results changed on purpose: write those that the regression tests expect anew, and look at the difference in git.
expected: setup
	python -m pytest -q tests/regression --update-expected
	git --no-pager diff --stat -- tests/regression/expected

lint: setup
	ruff check .
	ruff format --check .
	mypy
	lint-imports
	snakefmt --check Snakefile workflow
	snakemake --lint

format: setup
	ruff check --fix .
	ruff format .
	snakefmt Snakefile workflow

# Measured numbers of the documentation: those whose source has changed; an hour if all of them have.
# make docs-numbers ARGS=--list names them.
docs-numbers: setup $(PEERS)
	python docs/numbers/renew.py $(ARGS)

# The picture in docs/architecture.md.
rulegraph: setup
	python docs/rulegraph.py

# Resolve the environment anew: newest versions that pyproject.toml allows, with hashes, for every platform.
lock: $(READY)
	python -m pip install --quiet uv
	uv pip compile pyproject.toml --all-extras --universal --generate-hashes --no-emit-index-url --no-header \
	  --python-version 3.11 --upgrade --quiet --output-file environment.lock
	sed -i '1i # Hash-pinned environment, made by "make lock" from pyproject.toml.' environment.lock

clean:
	rm -rf results logs .snakemake

$(PACKAGES): environment.lock
	@test -n "$(PYTHON)" || { echo "There is no Python on this machine. ankleloop needs Python 3.11 or newer."; exit 1; }
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "$$("$(PYTHON)" --version) is too old: ankleloop needs Python 3.11 or newer."; \
	  echo "Name another one with: make PYTHON=/path/to/python3.11"; exit 1; }
	@"$(PYTHON)" -c 'import venv, ensurepip' 2>/dev/null || { \
	  echo "$$("$(PYTHON)" --version) has no venv module. Install it (Debian and Ubuntu: apt install python3-venv)."; exit 1; }
	@echo "Setting up the environment in $(VENV): two to four minutes, once."
	"$(PYTHON)" -m venv --clear $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --compile --no-deps --require-hashes -r environment.lock
	@touch $@

$(READY): $(PACKAGES) pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	$(BIN)/python -m compileall -q src
	@echo "Compiling the kernels, once: half a minute."
	$(BIN)/python -c "import ankleloop as a; t = a.simulate(seed=1, duration=12.0); \
	  [a.evaluate(t, a.identify(t, m)) for m in ('pr-moesp', 'eiv-moesp', 'parallel-cascade', 'riv')]; \
	  a.identify(t, 'pi-moesp', basis='rectifier')"
	@touch $@
