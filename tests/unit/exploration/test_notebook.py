"""The notebook runs without a browser: its widgets are moved by code."""

import json
from pathlib import Path

import nbformat
import pytest

nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed: it runs the notebook")
pytest.importorskip("ipywidgets", reason="ipywidgets is not installed: the notebook has sliders")

NOTEBOOK = Path(__file__).parents[3] / "notebooks" / "explore.ipynb"
MOVE = """
import json
from traitlets import TraitError

views, record = [view.value], {}
changes = [
    (settings["reflex_gain"], 20.0), (settings["load_stiffness"], 100.0), (settings["voluntary"], 0.5),
    (settings["delay"], 0.05), (settings["snr_db"], 30.0), (settings["perturbation"], "pulses"),
    (methods[0], "eiv-moesp"), (options[0]["order"], 3), (options[0]["block_rows"], 20),
    (options[0]["basis"], "rectifier"), (options[1]["delay"], 0.05), (settings["closed_loop"], False),
    (bootstrap, True),
]
for widget, value in changes:
    widget.value = value
    views.append(view.value)
bootstrap.value = False
record["pictures"] = len(set(views))
record["png"] = all(bytes(picture[:4]) == b"\\x89PNG" for picture in views)
settings["voluntary"].value = 1e9
settings["reflex_gain"].value = -5.0
options[0]["block_rows"].value = 10**6
record["clamped"] = [settings["voluntary"].value, settings["reflex_gain"].value, options[0]["block_rows"].value]
try:
    settings["perturbation"].value = "music"
except TraitError:
    record["refused"] = True
settings["closed_loop"].value = True
for name in ("load_stiffness", "load_viscosity", "load_inertia"):
    settings[name].value = 0.0
settings["reflex_gain"].value = 1e9
record["message"] = picture.message
print("RECORD" + json.dumps(record))
"""


def test_sliders_change_the_picture_and_stay_within_their_bounds():
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    notebook.cells.append(nbformat.v4.new_code_cell(MOVE))
    nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3").execute()
    texts = [output.get("text", "") for output in notebook.cells[-1].outputs]
    record = json.loads("".join(texts).split("RECORD")[1])
    assert record["pictures"] == 14  # each change gives another picture
    assert record["png"]
    assert record["clamped"] == [2.0, 0.0, 40]
    assert record["refused"]
    assert record["message"].startswith("the closed loop is unstable")
