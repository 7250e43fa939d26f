"""Run a parameterised notebook and render it as one page that needs nothing from elsewhere."""

from job import log, running  # first, for what it spares the imports of others

# isort: split
import html
import tempfile
from pathlib import Path

import nbformat
import papermill
from nbconvert import HTMLExporter

from ankleloop.records.files import whole_file


def check(notebook, given):
    """Refuse a notebook whose parameters are not exactly those that it is given."""
    declared = papermill.inspect_notebook(notebook)
    if not declared:
        raise ValueError(f"{notebook} has no cell tagged 'parameters'.")
    for odd, text in ((set(given) - set(declared), "does not declare"), (set(declared) - set(given), "is not given")):
        if odd:
            raise ValueError(f"{notebook} {text} the parameter {sorted(odd)[0]!r}.")


def page(executed, title, style):
    """Body of the notebook without its code, in a page with its own style."""
    exporter = HTMLExporter(template_name="basic", exclude_input=True, exclude_input_prompt=True)
    exporter.exclude_output_prompt = True
    body, _ = exporter.from_notebook_node(executed)
    return (
        Path(style).read_text(encoding="utf-8").replace("{{ title }}", html.escape(title)).replace("{{ body }}", body)
    )


with running(snakemake):
    notebook, given = snakemake.input.notebook, dict(snakemake.params.parameters)
    check(notebook, given)
    with tempfile.TemporaryDirectory() as folder:
        result = f"{folder}/executed.ipynb"
        papermill.execute_notebook(notebook, result, given, kernel_name="python3", progress_bar=False)
        executed = nbformat.read(result, as_version=4)
    log.info("executed %s", notebook)
    report = next(path for path in snakemake.output if path.endswith(".html"))
    with whole_file(report) as path:
        path.write_text(page(executed, given["title"], snakemake.input.style), encoding="utf-8")
