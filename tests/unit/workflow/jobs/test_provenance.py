"""Versions of a run."""

import subprocess

from ankleloop_lab.provenance import read_provenance


def test_commit_of_a_working_copy(tmp_path):
    assert read_provenance(tmp_path)["commit"] == ""

    def git(*arguments):
        identity = ("-c", "user.name=a", "-c", "user.email=a@b")
        return subprocess.run(
            ["git", *identity, *arguments], cwd=tmp_path, check=True, capture_output=True, text=True
        )

    git("init", "--quiet")
    (tmp_path / "a").write_text("1")
    git("add", "a")
    git("commit", "--quiet", "-m", "a file")
    provenance = read_provenance(tmp_path)
    assert provenance["commit"] == git("rev-parse", "HEAD").stdout.strip()
    assert not provenance["changed"]
    (tmp_path / "a").write_text("2")
    assert read_provenance(tmp_path)["changed"]
