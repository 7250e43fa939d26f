"""Where results come from: version, commit, packages and machine; read once in a run, and kept in a file."""

from __future__ import annotations

import json
import os
import platform
import subprocess
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path

import ankleloop
from ankleloop.trials.files import atomic_file


@dataclass(frozen=True)
class Provenance:
    """What a result was made with."""

    version: str  # version of ankleloop
    commit: str  # commit of the repository; empty where it is no working copy of git
    changed: bool  # whether files of the working copy differ from that commit
    python: str  # version of Python
    system: str  # operating system and kind of processor
    packages: dict[str, str]  # version of each distribution of the environment, by its name

    def __str__(self) -> str:
        commit = f", commit {self.commit[:12]}{' with changes' * self.changed}" if self.commit else ""
        return f"ankleloop {self.version}{commit}, Python {self.python}, {self.system}"


def read_provenance(root: str | os.PathLike[str]) -> Provenance:
    """Read version, commit, packages and machine."""
    commit = _ask_git(root, "rev-parse", "HEAD") if os.path.exists(os.path.join(root, ".git")) else ""
    changed = bool(commit) and bool(_ask_git(root, "status", "--porcelain", "--untracked-files=no"))
    names = {d.metadata["Name"]: d.version for d in metadata.distributions() if d.metadata["Name"]}
    return Provenance(
        version=ankleloop.__version__,
        commit=commit,
        changed=changed,
        python=platform.python_version(),
        system=f"{platform.system()} {platform.release()} on {platform.machine()}",
        packages={name: names[name] for name in sorted(names, key=str.lower)},
    )


def save_provenance(provenance: Provenance, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write version, commit, packages and machine to a file."""
    with atomic_file(path, overwrite=overwrite) as partial:
        partial.write_text(json.dumps(asdict(provenance), indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def load_provenance(path: str | os.PathLike[str]) -> Provenance:
    """Read what `save_provenance` has written."""
    return Provenance(**json.loads(Path(path).read_text(encoding="utf-8")))


def _ask_git(root: str | os.PathLike[str], *arguments: str) -> str:
    """Answer of git; empty where it has none, or there is no git."""
    command = ["git", "--no-optional-locks", "-C", os.fspath(root), *arguments]
    try:
        process = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return process.stdout.strip() if process.returncode == 0 else ""
