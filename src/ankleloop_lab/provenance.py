"""What a result comes from: version and commit of the program, and the packages that are installed."""

from __future__ import annotations

import getpass
import os
import platform
import subprocess
from importlib import metadata
from pathlib import Path
from typing import Any

import ankleloop
from ankleloop.trials.files import PathLike


def read_provenance(root: PathLike) -> dict[str, Any]:
    """Read version, commit (empty outside of a working copy of git), whether files differ from it, and packages."""
    commit = _ask_git(root, "rev-parse", "HEAD") if Path(root, ".git").exists() else ""
    changes = _ask_git(root, "status", "--porcelain", "--untracked-files=no") if commit else ""
    packages = {
        d.metadata["Name"]: d.version for d in metadata.distributions() if d.metadata["Name"]
    }
    return {
        "version": ankleloop.__version__,
        # Who runs the workflow: the name that git has, else that of the account.
        "agent": _ask_git(root, "config", "user.name") or getpass.getuser(),
        "commit": commit,
        "changed": bool(changes),
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.release()} on {platform.machine()}",
        "packages": dict(sorted(packages.items())),
    }


def _ask_git(root: PathLike, *arguments: str) -> str:
    """Answer of git; empty where it has none, or there is no git."""
    command = ["git", "--no-optional-locks", "-C", os.fspath(root), *arguments]
    try:
        answer = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    except (OSError, subprocess.SubprocessError):
        return ""
    return answer.stdout.strip()
