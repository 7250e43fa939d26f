"""Notebooks of studies, and the figures that each draws; what each needs is in `ankleloop.studies.study_checks`."""

from __future__ import annotations

# Figures that each notebook draws beside its page and its table.
NOTEBOOKS = {
    "table1": ("figure3", "order"),
    "figure4": ("figure4", "passes"),
    "passes": ("passes",),
    "table2": ("figure5",),
    "comparison": ("stiffness", "vaf"),
    "traces": ("traces",),
    "sensitivity": ("map",),
    "efficiency": ("efficiency", "intervals"),
    "choosing": ("choosing",),
    "obstacles": ("obstacles",),
    "time-varying": ("errors", "trajectories"),
    "sweep": ("sweep",),
    "recordings": ("group",),
}
