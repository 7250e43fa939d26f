"""Run a notebook with its parameter, and keep it with its outputs; what it draws and tabulates it writes itself."""

import base64
import json
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

import matplotlib
import nbformat
import papermill
import zmq
from traitlets.config import Config

from ankleloop.trials.files import PathLike, atomic_file
from ankleloop_workflow.jobs.job import log, running
from ankleloop_workflow.pages.study_page import StudyPage


def check_parameter(notebook: str, name: str) -> None:
    """Refuse a notebook that declares other parameters than that of the rule."""
    declared = papermill.inspect_notebook(notebook)
    if not declared:
        raise ValueError(f"{notebook} has no cell tagged 'parameters'.")
    if name not in declared:
        raise ValueError(f"{notebook} does not declare the parameter {name!r}.")
    for other in sorted(set(declared) - {name}):
        raise ValueError(f"the rule has no value for the parameter {other!r} of {notebook}.")


def execute(notebook: str, parameters: Mapping) -> nbformat.NotebookNode:
    """Run a notebook."""
    # Where the home cannot be written, they name another folder to the notebook, whose page would show the message.
    matplotlib.get_configdir()
    matplotlib.get_cachedir()
    with tempfile.TemporaryDirectory() as folder:
        path = f"{folder}/executed.ipynb"
        # Files, which other users cannot read, instead of open ports.
        sockets = {"transport": "ipc", "ip": f"{folder}/kernel"} if zmq.has("ipc") else {}
        papermill.execute_notebook(
            notebook,
            path,
            parameters,
            kernel_name="python3",
            progress_bar=False,
            config=Config(KernelManager=sockets),
        )
        executed = nbformat.read(path, as_version=4)
    for number, cell in enumerate(executed.cells):
        cell["id"] = f"cell-{number}"  # papermill gives the cell of the parameters a random one
    return executed


def write_executed(notebook: nbformat.NotebookNode, parameters: Mapping, path: PathLike) -> None:
    """Write an executed notebook, which runs from its folder, without times: the same bytes for the same outputs.

    Its parameter is the name of its file, in whose metadata the page reads the rest.
    """
    [(name, values)] = parameters.items()
    notebook.metadata.pop("papermill", None)
    notebook.metadata["parameter"] = values
    for cell in notebook.cells:
        cell.metadata.pop("papermill", None)
        cell.metadata.pop("execution", None)
        if "injected-parameters" in cell.metadata.get("tags", ()):
            cell.source = f'{name} = "{Path(path).stem}"'
    with atomic_file(path, overwrite=True) as partial:
        nbformat.write(notebook, partial)


def find_captions(notebook: nbformat.NotebookNode) -> dict[bytes, str]:
    """Captions of the pictures that a notebook shows: their alternative texts."""
    captions = {}
    for cell in notebook["cells"]:
        for output in cell.get("outputs", ()):
            picture = output.get("data", {}).get("image/png")
            if picture:
                attributes = output["metadata"].get("image/png", {})
                captions[base64.b64decode(picture)] = attributes.get("alt", "")
    return captions


def write_captions(captions: Mapping[bytes, str], folder: Path) -> None:
    """Captions of the figures in a folder by their names; a notebook of a user may show a figure without one."""
    names = {
        path.stem: captions.get(path.read_bytes(), "") for path in sorted(folder.glob("*.png"))
    }
    (folder / "captions.json").write_text(
        json.dumps(names, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
    )


with running(snakemake):
    notebook = snakemake.input.notebook
    parameters = dict(snakemake.params.parameters)
    check_parameter(notebook, *parameters)
    # Diagrams of the article.
    sources = snakemake.input.get("diagrams", ())
    copies = snakemake.output.get("diagrams", ())
    for source, target in zip(sources, copies, strict=True):
        shutil.copyfile(source, target)
    # A folder, which the notebook of a study fills.
    figures = snakemake.output.get("figures")
    if figures:
        Path(figures).mkdir(parents=True, exist_ok=True)
    executed = execute(notebook, parameters)
    log.info("executed %s", notebook)
    if "study" in parameters:
        StudyPage(**parameters["study"]).check_written(notebook)
    if figures:
        write_captions(find_captions(executed), Path(figures))
    write_executed(executed, parameters, snakemake.output.code)
