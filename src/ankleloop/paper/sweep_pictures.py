"""Pictures of a sweep with their captions: lines over one parameter, maps over two, a matrix of effects over more."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from ankleloop.paper.sweep_captions import describe_map, describe_means
from ankleloop.paper.sweep_cells import list_slices, summarise_cells
from ankleloop.paper.sweep_study import SweepStudy
from ankleloop.paper.sweep_summary import summarise_effects
from ankleloop.plotting.sweep_maps import maps_figure
from ankleloop.plotting.sweeps import effects_figure, lines_figure

LINE_BINS = {"bins": 40, "most": 100}  # of a line over one parameter


def draw_sweep(sweep: SweepStudy) -> tuple[Figure, str]:
    """The picture of a sweep: lines over one axis, maps over two, a matrix of effects over more.

    Parameters
    ----------
    sweep : SweepStudy
        The sweep.

    Returns
    -------
    figure : matplotlib.figure.Figure
    caption : str

    Examples
    --------
    >>> import tempfile
    >>> import pandas as pd
    >>> from ankleloop.simulation.settings import SimulationSettings
    >>> from ankleloop.studies.config import SweepSettings
    >>> table = pd.DataFrame(
    ...     [
    ...         {"study": "s", "point": f"G={gain}", "reflex_gain": gain, "method": "riv", "trial": trial}
    ...         | {"vaf_net_true": 99.0, "failure": None, "warnings": ""}
    ...         for gain in (5.0, 10.0)
    ...         for trial in range(2)
    ...     ]
    ... )
    >>> shown = SweepSettings(quantities=["vaf_net_true"]).model_dump()
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     table.to_parquet(f"{folder}/s-trials.parquet")
    ...     sweep = SweepStudy.read(
    ...         f"{folder}/s-trials.parquet", ["reflex_gain"], {"riv": "RIV"}, shown, SimulationSettings.defaults()
    ...     )
    >>> figure, caption = draw_sweep(sweep)
    >>> len(figure.axes)
    1
    """
    if len(sweep.axes) == 2:
        return draw_map(sweep)
    bins = LINE_BINS if len(sweep.axes) == 1 else {}
    trials = sweep.shown_trials
    effects = pd.concat([summarise_effects(trials, axis, sweep.quantities, **bins) for axis in sweep.axes])
    band = sweep.settings["band"]
    if len(sweep.axes) == 1:
        figure = lines_figure(effects, sweep.axes[0], sweep.panels, band=band)
    else:
        figure = effects_figure(effects, sweep.axes, sweep.panels, band=band)
    return figure, describe_means(sweep, effects)


def draw_map(sweep: SweepStudy) -> tuple[Figure, str]:
    """Maps over the first two axes of a sweep; a few values of the other parameters have panels of their own."""
    x, y = sweep.axes[:2]
    others = [axis for axis in sweep.parameters if axis.name not in (x.name, y.name)]
    slices = list_slices(sweep.shown_trials, others)
    cells, edges = summarise_cells(sweep.shown_trials, (x, y), sweep.quantities, slices)
    names = list(dict.fromkeys(slices.values())) or [""]
    figure = maps_figure(cells, (x, y), edges, sweep.panels, names)
    return figure, describe_map(sweep, cells, edges, bool(slices))
