"""Run a notebook with parameters, and render it as one HTML page that needs no other files."""

import json
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

import matplotlib
import nbformat
import papermill
from nbconvert import HTMLExporter

from ankleloop.trials.files import atomic_file
from ankleloop_lab.pages.rendering import find_captions, render_page
from ankleloop_workflow.jobs.job import log, running
from ankleloop_workflow.pages.study_page import StudyPage


def check_parameters(notebook: str, parameters: Mapping) -> None:
    """Refuse a notebook that declares other parameters than those of the rule."""
    declared = papermill.inspect_notebook(notebook)
    if not declared:
        raise ValueError(f"{notebook} has no cell tagged 'parameters'.")
    for name in sorted(set(parameters) - set(declared)):
        raise ValueError(f"{notebook} does not declare the parameter {name!r}.")
    for name in sorted(set(declared) - set(parameters)):
        raise ValueError(f"the rule has no value for the parameter {name!r} of {notebook}.")


def execute(notebook: str, parameters: Mapping) -> nbformat.NotebookNode:
    """Run a notebook."""
    # Where the home cannot be written, they name another folder to the notebook, whose page would show the message.
    matplotlib.get_configdir()
    matplotlib.get_cachedir()
    with tempfile.TemporaryDirectory() as folder:
        path = f"{folder}/executed.ipynb"
        papermill.execute_notebook(
            notebook, path, parameters, kernel_name="python3", progress_bar=False
        )
        executed = nbformat.read(path, as_version=4)
    for number, cell in enumerate(executed.cells):
        cell["id"] = f"cell-{number}"  # papermill gives the cell of the parameters a random one
    return executed


def write_executed(notebook: nbformat.NotebookNode, study: Mapping, path: str) -> None:
    """Write an executed notebook, which runs from its folder, without times: the same bytes for the same outputs.

    Its parameter is the name of the study; `open_study` of its page reads the rest in the metadata.
    """
    notebook.metadata.pop("papermill", None)
    notebook.metadata["study"] = study
    for cell in notebook.cells:
        cell.metadata.pop("papermill", None)
        cell.metadata.pop("execution", None)
        if "injected-parameters" in cell.metadata.get("tags", ()):
            cell.source = f'study = "{study["study"]}"'
    with atomic_file(path, overwrite=True) as partial:
        nbformat.write(notebook, partial)


def export_outputs(notebook: nbformat.NotebookNode) -> str:
    """Texts and outputs of a notebook as HTML, without its code."""
    exporter = HTMLExporter(template_name="basic", exclude_input=True, exclude_anchor_links=True)
    exporter.exclude_input_prompt = exporter.exclude_output_prompt = True
    return exporter.from_notebook_node(notebook)[0]


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
    check_parameters(notebook, parameters)
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
    study = parameters.get("study")
    study_page = StudyPage(**study) if study else None
    if study_page:
        study_page.check_written(notebook)
    captions = find_captions(executed)
    if figures:
        write_captions(captions, Path(figures))
    body = export_outputs(executed)
    log.info("executed %s", notebook)
    # The article shows several studies, each of which has a page of its own in a folder.
    if study_page:
        write_executed(executed, study, snakemake.output.code)
        note, faults = "", ""  # pages of recordings have their own
        if "table_file" in study:
            note, faults = study_page.render_faults()
        body = f"{body}{faults}{study_page.render_sources()}"
        page = render_page(study_page.title, body, note=note, index="../index.html")
    else:
        page = render_page(parameters["title"], body, note="", index="index.html")
    report = next(path for path in snakemake.output if path.endswith(".html"))
    with atomic_file(report, overwrite=True) as path:
        path.write_text(page, encoding="utf-8")
