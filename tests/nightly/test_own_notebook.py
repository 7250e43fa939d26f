"""The notebook of docs/how-to/own-notebook.md, made of the blocks of that page, in a copy of the repository."""

import copy
import re
from pathlib import Path

import nbformat
import nbformat.v4 as cells
import pandas as pd
import pytest
from nbclient import NotebookClient

pytestmark = pytest.mark.workflow

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "own-notebook.md"
TEXT = PAGE.read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)
(TITLE,) = [code for language, code in BLOCKS if language == "markdown"]
PARAMETERS, IMPORTS, FIGURE, TABLE = [code for language, code in BLOCKS if language == "python"]
ENTRY, CONFIG = [code for language, code in BLOCKS if language == "yaml"]
METADATA = {"kernelspec": {"name": "python3", "language": "python", "display_name": "Python 3"}}


@pytest.fixture(scope="module")
def results(copy_repository, snakemake):
    """Results of the study of the page, by its notebook."""
    repository = copy_repository()
    with (repository / "notebooks" / "notebooks.yaml").open("a", encoding="utf-8") as file:
        file.write(ENTRY)
    (repository / "config" / "mine.yaml").write_text(CONFIG, encoding="utf-8")
    code = [cells.new_code_cell(text) for text in (PARAMETERS, IMPORTS, FIGURE, TABLE)]
    code[0].metadata["tags"] = ["parameters"]
    notebook = cells.new_notebook(cells=[cells.new_markdown_cell(TITLE), *code], metadata=METADATA)
    path = repository / "notebooks" / "gain.ipynb"
    path.write_text(nbformat.writes(notebook), encoding="utf-8")
    snakemake(repository, "--configfile", "config/mine.yaml")
    return repository / "results"


def find_tables(cell):
    """HTML that a cell shows."""
    return [
        output.data["text/html"] for output in cell.outputs if "text/html" in output.get("data", {})
    ]


def test_figure_table_and_page(results):
    for name in ("figures/mine-stiffness.png", "figures/mine-stiffness.pdf", "tables/mine.md"):
        assert (results / name).stat().st_size > 0
    drawn = pd.read_csv(results / "figures" / "mine-stiffness.csv")
    table = pd.read_csv(results / "tables" / "mine.csv")
    assert drawn["x"].tolist() == table["point.reflex_gain"].tolist() == [5.0, 13.0]
    assert drawn["value"].tolist() == table["K_mean"].tolist()
    page = (results / "reports" / "mine.html").read_text(encoding="utf-8")
    for words in ("Stiffness over the reflex gain", "Mean K over the trials", "data:image/png"):
        assert words in page
    assert 'href="../notebooks/mine.ipynb"' in page
    # The code of the page runs from its folder, to the same table.
    path = results / "notebooks" / "mine.ipynb"
    executed = nbformat.read(path, as_version=4)
    again = copy.deepcopy(executed)
    NotebookClient(again, resources={"metadata": {"path": str(path.parent)}}).execute()
    tables = [find_tables(notebook.cells[-1]) for notebook in (executed, again)]
    assert tables[0] == tables[1] != []


def test_the_page_of_results_says_what_failed_until_a_run_is_complete(results, snakemake):
    repository = results.parent
    path = repository / "notebooks" / "gain.ipynb"
    code = path.read_text(encoding="utf-8")
    path.write_text(code.replace("format_means(summary", "no_means(summary"), encoding="utf-8")
    arguments = (repository, "--configfile", "config/mine.yaml")
    snakemake(*arguments, check=False)
    page = (results / "index.html").read_text(encoding="utf-8")
    assert "The last run has failed" in page
    assert "rule notebook, study mine: " in page
    assert "no_means" in page
    path.write_text(code, encoding="utf-8")
    snakemake(*arguments)
    assert "failed" not in (results / "index.html").read_text(encoding="utf-8")
    assert (results / "ro-crate-metadata.json").exists()
