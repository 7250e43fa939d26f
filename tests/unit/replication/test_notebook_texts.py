"""Texts of notebooks that no run can change hold no results: no numbers of results, no words of comparison.

Fixed texts are the Markdown cells and the string constants of the code. Results belong in expressions.
"""

import ast
import json
import re
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[3] / "notebooks").glob("*.ipynb"))
UNIT = r"(?:%|times|fold|points?|trials?|passes|N·m(?:·s)?(?:/rad)?|kg·m²|rad(?:/s)?|dB|Hz|ms|s|MB)"
NUMBER = re.compile(rf"\d[\d.,]*\s*{UNIT}(?![\w·/])|±\s*\d")
WORDS = "accurate|bad|best|better|biased|collapses?|fails|falls|good|grows|hardly|higher|lower|nearly|poor|slow|slowly|"
WORDS += "unbiased|well|worse|worst|wrong"
COMPARISON = re.compile(rf"\b(?:{WORDS})\b", re.IGNORECASE)
# What may stand: levels of intervals, limits of axes, claims of the paper, words that compare nothing.
PERMITTED = [
    r"95 %(?: confidence)? (?:intervals?|bands?)",
    r"\(95 %:",  # in front of an interval
    r"[Tt]he axes end at −?\d+ %",  # a limit that the same cell sets
    r"The paper states that methods made for open loop are biased in closed loop",
    r"highest net VAF on the (?:unseen half|half that was not fitted)",  # of the row with the largest value
    r"method with the highest VAF on the unseen",
    r"how far is the worst of the numbers|the worst of them",  # the largest of computed deviations
    r"good for",
    r"no unbiased method can go below",  # the definition of the bound
    r"at least 1 point, 1 %",  # thresholds of the same notebook
    r"the rectifier would see the wrong half",  # what a change of the sign of the position does
]


def fixed_texts(notebook):
    """Markdown cells, and string constants of the code that read like sentences, with the number of their cell."""
    for number, cell in enumerate(json.loads(notebook.read_text(encoding="utf-8"))["cells"]):
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            yield number, source
        else:
            for node in ast.walk(ast.parse(source)):
                if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value.strip():
                    yield number, node.value


def remove_permitted(text):
    for pattern in PERMITTED:
        text = re.sub(pattern, "", " ".join(text.split()))
    return text


def list_results(text):
    """What reads like a result in a fixed text."""
    text = remove_permitted(text)
    return NUMBER.findall(text) + COMPARISON.findall(text)


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_fixed_texts_hold_no_results(notebook):
    results = [(number, text, matches) for number, text in fixed_texts(notebook) if (matches := list_results(text))]
    assert results == []


@pytest.mark.parametrize(
    "text",
    [
        "steps alias without a filter: inertia comes out 9 % high",
        "the gain lowers both, by 3.5 points",
        "EIV-MOESP takes 1.3 times the time",
        "K = 150 ± 6",
        "Without inputs scaled to unit variance EIV-MOESP collapses.",
        "The net VAF prefers what is wrong.",
        "It converges to the truth: slowly.",
        "Lines have 95 % confidence bands; the net VAF is 93 %.",
    ],
)
def test_results_are_recognised(text):
    assert list_results(text)


@pytest.mark.parametrize(
    "text",
    [
        "## 3. Simulation study",
        "Zhao, Ludvig and Kearney (ACC 2008), Table 1 and Eq. 17",
        "Means over trials with their 95 % intervals",
        "K, B and I of 1 model",
    ],
)
def test_other_numbers_are_no_results(text):
    assert not list_results(text)


def test_notebooks_have_no_outputs():
    for notebook in NOTEBOOKS:
        for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
            assert not cell.get("outputs"), notebook.name
            assert cell.get("execution_count") is None, notebook.name
