"""Options of a method against the trials of a study: what no trial of it could be identified with."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ankleloop.errors import DataError
from ankleloop.joint.regressors import decimation_grid
from ankleloop.methods.registry import METHODS
from ankleloop.options import suggest_name

if TYPE_CHECKING:
    from ankleloop.studies.method_settings import MethodSettings

REFERENCES = ("reference", "position")  # variables of a simulated trial that may serve as reference


def find_fault(method: MethodSettings, duration: float, rate: float) -> str:
    """Why a method cannot identify any simulated trial of some length and rate."""
    options = method.fixed_options
    reference = METHODS[method.method].reference(method.options)
    if reference is not None and reference not in REFERENCES:
        close = suggest_name(reference, REFERENCES)
        return f"a simulated trial has no {reference!r}{close} to serve as reference; it has {', '.join(REFERENCES)}."
    if "identification_rate" in options:
        try:
            decimation_grid(round(duration * rate), rate, options["identification_rate"], options.get("delay") or 0.0)
        except DataError as error:
            return f"{error}"
    rows, order, leads = (options.get(name) for name in ("block_rows", "order", "instrument_leads"))
    if rows is not None and rows <= (order or 1):
        return f"block_rows must be larger than the order ({order or 1}), got {rows}."
    if rows is not None and leads is not None and leads > rows:
        return f"instrument_leads must be between 0 and block_rows ({rows}), got {leads}."
    return ""
