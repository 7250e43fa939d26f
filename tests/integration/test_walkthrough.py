"""The walk-through runs from a file to a decision."""

from pathlib import Path

import papermill
import scipy.io

NOTEBOOK = Path(__file__).parents[2] / "notebooks" / "walkthrough.ipynb"


def printed_text(notebook):
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    return "".join(output.get("text", "") for output in outputs if output.output_type == "stream")


def test_first_recording(tmp_path):
    folder = tmp_path / "walkthrough"
    parameters = {"folder": str(folder)}
    notebook = papermill.execute_notebook(
        str(NOTEBOOK),
        str(tmp_path / "executed.ipynb"),
        parameters,
        kernel_name="python3",
        progress_bar=False,
    )
    text = printed_text(notebook)
    assert "Set torque_sign: -1" in text  # the sign is detected, and then corrected
    assert (
        "The loop is closed. Valid methods: riv, pr-moesp, pi-moesp, po-moesp, eiv-moesp, riv-tv."
        in text
    )
    assert "take riv: the loop is closed" in text
    assert "written: estimate.csv, estimate.mat, estimate.nc" in text
    estimate = scipy.io.loadmat(folder / "estimate.mat", simplify_cells=True)["estimate"]
    for group, name, truth in (("stiffness", "K", 150.0), ("reflex", "G", 8.0)):
        low, high = estimate["intervals"][name]
        assert abs(estimate[group][name] - truth) < 3 * (high - low) / 3.92, (
            name
        )  # within three standard errors
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    figures = [output for output in outputs if "image/png" in output.get("data", {})]
    assert len(figures) == 4
