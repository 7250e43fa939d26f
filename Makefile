# make          set up what is missing, then reproduce the paper
# make test     set up what is missing, then run the tests
# make test-long  the faults that a run survives: kills, full disks, damaged files
# make test-cluster  a study on a Slurm of one node, which the test installs and starts (as root, Debian or Ubuntu)
# make audit    licences, bill of materials and known vulnerabilities of what ankleloop is built on
# make beyond   the paper, and the studies that go further
# make unlock   after a run that was killed: take away its lock, so that make can go on; nothing is lost
# make coverage how often the intervals of riv hold the truth: 1,000 trials of eight settings
# make fuzz     damaged files, ten minutes for each reader
# make benchmark  time, memory and accuracy beside other programs
SHELL := /bin/bash
.DELETE_ON_ERROR:
.DEFAULT_GOAL := all
.PHONY: all setup test test-long test-cluster audit fuzz beyond coverage benchmark expected docs-numbers lint format rulegraph lock unlock clean

CORES ?= 2
PYTHON ?= $(firstword $(shell command -v python3.11 python3 python))
VENV := .venv
BIN := $(VENV)/bin
PACKAGES := $(VENV)/.packages
READY := $(VENV)/.ready
export PATH := $(CURDIR)/$(BIN):$(PATH)
# A path of another environment must not reach into this one.
unexport PYTHONPATH PYTHONHOME

# A run that ends removes its lock, one that is killed cannot.
LOCK_HINT := test -z "$$(ls .snakemake/locks 2>/dev/null)" || echo "If no other run is going on in this folder, one that \
was killed has left its lock: make unlock, then the same command again. Nothing is lost."

all: setup
	snakemake --cores $(CORES) || { $(LOCK_HINT); exit 1; }

unlock: setup
	snakemake --cores 1 --unlock

setup: $(READY)

# As many processes as cores; a test file stays in one.
test: setup
	OMP_NUM_THREADS=1 python -m pytest -n $(CORES) --dist loadgroup $(ARGS)

# Half an hour: kills, full and read-only disks, jobs without memory, damaged files, set-ups that are interrupted.
test-long: setup
	python -m pytest tests/long $(ARGS)

# Ten minutes: a study through profiles/slurm, a node that fails, results in a storage; the same as those of one machine.
test-cluster: setup
	python -m pytest tests/cluster $(ARGS)

# Damaged files have to be read or refused: 70 minutes; ARGS="--minutes 1 --readers csv hdf5" for less.
fuzz: setup
	python tests/fuzz/fuzz.py --minutes 10 --processes 2 --json results/reliability/fuzz.json $(ARGS)

beyond: setup
	snakemake --cores $(CORES) --configfile config/beyond.yaml || { $(LOCK_HINT); exit 1; }

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

# Two minutes: licences, bill of materials, known vulnerabilities. The tools have an environment of their own.
AUDIT := $(VENV)/audit
audit: setup $(AUDIT)/.ready
	python audit/audit.py --tools $(AUDIT)/bin

$(AUDIT)/.ready: audit/requirements.txt $(PACKAGES)
	python -m venv --clear $(AUDIT)
	$(AUDIT)/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r $<
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
