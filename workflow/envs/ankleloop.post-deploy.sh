#!/usr/bin/env bash
# Runs in the new environment. Snakemake copies it to .snakemake/conda in the working directory, which has to be the root
# of the repository: there are the lock, which lists all packages, and the library, whose changes jobs have to follow.
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)"
python -m pip install --no-deps --require-hashes -r "$root/environment.lock"
python -m pip install --no-deps --no-build-isolation --editable "$root"
