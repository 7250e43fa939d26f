# `make help` lists the targets: the texts behind ## below.
SHELL := /bin/bash
.DELETE_ON_ERROR:
.DEFAULT_GOAL := all
.PHONY: all help setup test nightly beyond archive benchmark expected docs lint format package lock unlock clean

CORES ?= 2
# A configuration file of one's own: make CONFIG=mine.yaml, make archive CONFIG=mine.yaml.
CONFIG :=
GIVEN := $(if $(CONFIG),--configfile $(CONFIG))
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

# One line for each step, which its job writes; Snakemake's own account of the run is in .snakemake/log.
STEPS := --quiet rules progress host
SHORT := sed -u -E '/^(Select jobs to execute|Execute [0-9]+ jobs|Using |Conda env|Assuming |\[IPKernelApp\]|$$)/d'

all: setup ## Set up what is missing, then reproduce the paper (a few minutes).
	@set -o pipefail; snakemake --cores $(CORES) $(STEPS) $(GIVEN) 2>&1 | $(SHORT) || { $(LOCK_HINT); exit 1; }
	@echo "Open results/index.html"

# The texts behind ##, one for each target.
help: ## List the targets.
	@awk -F ':.*## ' '/^[a-z][a-z-]*:.*## / { printf "make %-13s %s\n", $$1, $$2 }' $(firstword $(MAKEFILE_LIST))
	@echo 'CORES=4 sets the cores (default: 2), CONFIG=mine.yaml runs a configuration of your own, PYTHON=python3.12 the Python of a new environment, ARGS="-k name" what a test or a benchmark takes.'

unlock: setup ## After a run that was killed: take away its lock, so that make can go on; nothing is lost.
	snakemake --cores 1 --unlock

setup: $(READY) ## Set up the environment in .venv, from environment.lock.

# As many processes as cores; a test file stays in one, and files keep their order: the longest first.
test: setup ## Set up what is missing, then run the tests.
	OMP_NUM_THREADS=1 python -m pytest -n $(CORES) --dist loadgroup --no-loadscope-reorder $(ARGS)

# Faults and all that takes long: kills, full disks, fuzzing, a Slurm of one node, memory, processors, the package.
nightly: setup ## An hour: killed runs, full disks, damaged files, Slurm, memory, coverage of intervals.
	OMP_NUM_THREADS=1 python -m pytest tests/nightly -v --durations=10 $(ARGS)

beyond: setup ## Reproduce the paper, and run the studies that go further.
	@set -o pipefail; snakemake --cores $(CORES) $(STEPS) --configfile config/beyond.yaml 2>&1 | $(SHORT) || { $(LOCK_HINT); exit 1; }
	@echo "Open results/index.html"

archive: all ## Reproduce the paper, and pack results, workflow and versions into results.zip: what one uploads beside a paper.
	python -m ankleloop_workflow.jobs.crate results results.zip
	@ls -sh results.zip

# The peers that are measured against go into a folder of their own, behind the environment.
PEERS := $(VENV)/peers
benchmark: setup $(PEERS) ## Forty minutes: write the tables of docs/measured; ARGS="speed" for one of them.
	python benchmarks/measured.py $(ARGS)

$(PEERS): benchmarks/requirements.txt $(READY)
	python -m pip install --quiet --disable-pip-version-check --upgrade --no-deps --target $@ -r $<
	@touch $@

# Results changed on purpose; look at the difference in git.
expected: setup ## Write the results that the regression tests expect.
	python -m pytest -q tests/regression --update-expected
	git --no-pager diff --stat -- tests/regression/expected

lint: setup ## Check style, types, layers of the library and the workflow.
	ruff check .
	ruff format --check .
	mypy --num-workers $(CORES)
	lint-imports
	nbstripout --verify --keep-id notebooks/*.ipynb
	snakefmt --check Snakefile workflow
	snakemake --lint

format: setup ## Format Python, notebooks and Snakefiles.
	ruff check --fix .
	ruff format .
	snakefmt Snakefile workflow

docs: setup ## Build the documentation as a site, in build/docs/html.
	python -m sphinx -W -n --keep-going -q -b html docs build/docs/html
	@echo "Open build/docs/html/index.html"

package: setup ## Build the wheel and the source distribution, in dist.
	@mkdir -p dist
	python -m hatchling build -d dist

# Newest versions that pyproject.toml allows, with hashes, for every platform.
lock: $(READY) ## Resolve the environment again, into environment.lock.
	python -m pip install --quiet uv
	uv pip compile pyproject.toml --all-extras --universal --generate-hashes --no-emit-index-url --no-header \
	  --python-version 3.11 --upgrade --quiet --output-file environment.lock
	echo '# Hash-pinned environment, made by "make lock" from pyproject.toml.' | cat - environment.lock > environment.new
	mv environment.new environment.lock

clean: ## Remove results, logs and the state of Snakemake.
	rm -rf results results.zip logs .snakemake

# pip compiles modules one by one, compileall on all cores; a package may have files that are no Python of this version.
$(PACKAGES): environment.lock
	@test -n "$(PYTHON)" || { echo "There is no Python on this machine. ankleloop needs Python 3.11 or newer."; exit 1; }
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "$$("$(PYTHON)" --version) is too old: ankleloop needs Python 3.11 or newer."; \
	  echo "Name another one with: make PYTHON=/path/to/python3.11"; exit 1; }
	@"$(PYTHON)" -c 'import venv, ensurepip' 2>/dev/null || { \
	  echo "$$("$(PYTHON)" --version) has no venv module. Install it (Debian and Ubuntu: apt install python3-venv)."; exit 1; }
	@echo "Setting up the environment in $(VENV): two to four minutes, once."
	"$(PYTHON)" -m venv --clear $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --no-deps --require-hashes -r environment.lock
	$(BIN)/python -m compileall -qq -j 0 $(VENV)/lib || true
	@touch $@

$(READY): $(PACKAGES) pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	$(BIN)/python -m compileall -q src
	@echo "Compiling the kernels, once: half a minute."
	$(BIN)/python -c "import ankleloop as a; t = a.simulate(seed=1, duration=12.0); \
	  [a.evaluate(t, a.identify(t, m)) for m in ('pr-moesp', 'eiv-moesp', 'parallel-cascade', 'riv')]; \
	  a.identify(t, 'pi-moesp', basis='rectifier')"
	@touch $@
