# Where the files of this repository are; results belong to the working directory. For a module they may be elsewhere:
# github("owner/ankleloop", path="workflow/Snakefile", tag="…").
import sys
import tempfile
from pathlib import Path


def copy_repository(place):
    """Folder with the commit of a repository elsewhere: Snakemake itself fetches Snakefiles and scripts alone."""
    clone = place.hosted_repo.repo
    commit = clone.git.rev_parse(f"{place.ref}^{{commit}}")
    folder = Path(".snakemake", "sources", commit).absolute()
    if not folder.exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        partial = Path(tempfile.mkdtemp(dir=folder.parent))
        copy = clone.clone(partial, no_checkout=True)
        copy.git.checkout(commit)
        partial.rename(folder)
    return folder


PLACE = workflow.current_basedir
if hasattr(PLACE, "hosted_repo"):
    ROOT = copy_repository(PLACE)
else:
    ROOT = Path(PLACE.get_path_or_uri(secret_free=True)).parent.parent
if "{" in str(ROOT) or "}" in str(ROOT):
    sys.exit(
        f"{ROOT}: Snakemake takes braces in this path for wildcards: rename the folder, or move the project."
    )
if ROOT.samefile("."):
    ROOT = Path()  # so that a folder which is moved or copied makes nothing again
