"""Write the measured numbers of the documentation anew: those whose source has changed, or all of them.

Run by `make docs-numbers`; arguments in ARGS: names of blocks, --all, --list.
"""

import argparse
import importlib
import os
import subprocess
import sys
import time
from datetime import UTC, datetime
from pathlib import Path

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))
sys.path.append(str(Path(__file__).resolve().parents[2] / "benchmarks"))

from blocks import BLOCKS, ROOT, Unavailable, insert, is_current, read_stamps

# Each writes the blocks of a page, or of a part of it.
MODULES = sorted(path.stem for path in Path(__file__).parent.glob("*_numbers.py"))


def load_blocks():
    """All blocks by their names."""
    for module in MODULES:
        importlib.import_module(module)
    return BLOCKS


def stamp(item):
    """Date, commit and source of a block that is written now."""
    commit = _git("rev-parse", "--short", "HEAD")
    changes = " with changes" if _git("status", "--porcelain", "--", "src", "config", "workflow", "benchmarks") else ""
    return f"{datetime.now(UTC):%Y-%m-%d}, commit {commit}{changes}, source {item.fingerprint}"


def renew(item, page):
    """Write a block into its page; False where this machine cannot."""
    print(f"{item.name} …", flush=True)
    start = time.perf_counter()
    source = stamp(item)  # of what runs now, whatever is edited meanwhile
    try:
        text = item.write()
    except Unavailable as reason:
        print(f"  left as it was: {reason}")
        return False
    page.write_text(insert(page.read_text(encoding="utf-8"), item.name, text, source), encoding="utf-8")
    print(f"  {time.perf_counter() - start:.0f} s", flush=True)
    return True


def main():
    """Renew blocks; the exit status is 1 where one is left out of date."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="blocks to renew; by default those that are out of date")
    parser.add_argument("--all", action="store_true", help="renew every block")
    parser.add_argument("--list", action="store_true", help="only name the blocks that are out of date")
    arguments = parser.parse_args()
    blocks, stamps = load_blocks(), read_stamps()
    names = arguments.names or [
        name for name in blocks if arguments.all or not is_current(blocks[name], stamps[name][1])
    ]
    if arguments.list:
        print(*names, sep="\n")
        return 0
    renewed = [renew(blocks[name], stamps[name][0]) for name in names]
    return 0 if all(renewed) else 1


def _git(*arguments):
    return subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False).stdout.strip()


if __name__ == "__main__":
    sys.exit(main())
