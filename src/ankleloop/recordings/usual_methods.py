"""Methods for a recording of which nothing is known yet: those that its check finds valid are fitted."""

from __future__ import annotations

from typing import Any

from ankleloop.recordings.validity import INSTRUMENTS

DEGREE = 8  # of the basis


def usual_methods(*, reference: bool, changing: bool = False) -> dict[str, dict[str, Any]]:
    """Methods with labels and options that suit a minute of a recording at the ankle.

    The nonlinearity of the reflex path is a spline, which takes a rectifier with or without a threshold. Without a
    reference its degree and the order of riv are selected on data that the fit has not used: there the VAF tells them
    apart. With a reference they are fixed, since a selection by instruments needs more than 20 s.
    """
    position = {} if reference else {"reference": "position"}
    instruments = dict(INSTRUMENTS) if reference else {}
    as_reference = "" if reference else ", position as reference"
    spline: dict[str, Any] = {"basis": "spline", **({"degree": DEGREE} if reference else {})}
    degrees = {} if reference else {"degree": [6, DEGREE, 12]}
    weighting = "noise" if reference else "flat"
    methods: dict[str, dict[str, Any]] = {
        "riv": {
            "label": f"Refined instrumental variables (spline){as_reference}",
            "method": "riv",
            "options": {**position, "weighting": weighting, **spline},
            "select": {} if reference else {**degrees, "order": [2, 3]},
        },
        "pr-moesp": {
            "label": f"PR-MOESP{as_reference}",
            "method": "pr-moesp",
            "options": {**position, **instruments, "degree": DEGREE, "block_rows": 20},
        },
        "pi-moesp": {
            "label": "PI-MOESP (spline)",
            "method": "pi-moesp",
            "options": {**instruments, "block_rows": 20, **spline},
            "select": degrees,
        },
        "parallel-cascade": {"label": "Parallel cascade, to convergence", "method": "parallel-cascade", "options": {}},
    }
    if changing:
        label = f"Joint that changes (riv-tv){as_reference}"
        methods["riv-tv"] = {"label": label, "method": "riv-tv", "options": {**position, "weighting": weighting}}
    return methods
