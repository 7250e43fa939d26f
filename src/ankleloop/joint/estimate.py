"""The result that every method returns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from html import escape
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.intervals import Uncertainty, extend_intervals
from ankleloop.joint.models import Model
from ankleloop.joint.prepared import PreparedTrial, Trials, prepare_trials, sample_channel
from ankleloop.joint.regressors import MEASURED, merge_torques, split_torques, torque_variable
from ankleloop.joint.time_varying_course import Onsets, split_onsets
from ankleloop.options import check_number, suggest_name
from ankleloop.quantities import QUANTITIES
from ankleloop.signals.vaf import vaf
from ankleloop.subspace.matrices import Matrices

if TYPE_CHECKING:
    from control import StateSpace
    from matplotlib.figure import Figure, SubFigure

TRIM = 1.0  # s at either end: transients of filters and initial states are not scored
SHOWN_CORRELATION = 0.5
DIGITS = "{:.4g}".format  # of a parameter
LABELS = {
    "missing": "missing",
    "incomplete": "incomplete",
    "assumptions": "assumed",
    "remarks": "remark",
    "warnings": "warning",
}


@dataclass(frozen=True, eq=False)
class Estimate:
    """Result of an identification.

    Parameters
    ----------
    method : str
        Name of the method.
    torque : xarray.Dataset
        `net`, `intrinsic` and `reflex` torque over time [N·m], as deviations from their means, and the `measured`
        torque at the same times. Those of merged trials stand one after the other, each over its own time, with the
        coordinate `trial`, which counts them from 1. Of an ensemble they are means of each condition over the time from
        the onset, less what is the same in all trials.
    stiffness : dict
        "K" [N·m/rad], "B" [N·m·s/rad], "I" [kg·m²]; of an ensemble "K_slope" [N·m/(rad·s)], of an apparatus "friction"
        [N·m] and "offset" [N·m], too.
    reflex : dict
        "delay" [s] and, where the method gives them, "G" [N·m·s/rad], "omega_n" [rad/s], "zeta". Empty of an apparatus.
    intervals : dict
        95 % intervals (low, high) by the same names, where the method gives them.
    diagnostics : dict
        Details of the identification: see the notes. Any may be missing; those that have a property are read by it.
    predictor : ankleloop.joint.models.Model or None
        The model as data: all that `predict` needs, among it the basis, the delay and the rate of its inputs. None
        where the method has no fixed model.
    trajectories : xarray.Dataset or None
        K, B and G over "phase" (0 … 1), "time" [s] or "schedule", with the ends of their 95 % bands "K_low", "K_high",
        …, where the method estimates parameters that change in time; nan where the record does not show them.
        `stiffness` and `reflex` then hold their means.

    Notes
    -----
    Keys of `diagnostics` that other parts of the library read:

    ====================================  ==============================================================================
    key                                   what it holds
    ====================================  ==============================================================================
    warnings                              what was seen to be wrong, sentences: `warnings`
    remarks                               what moves parameters by less than the tolerance, sentences: `remarks`
    data_warnings                         those of them that are about the data (`ankleloop.checks.data.check_data`)
    remedy                                options of reading that would help, by name
    assumptions, missing, incomplete      what was taken for granted; which parameters could not be had, and why; how
                                          much of what is left of the torque depends on the movement
    holds                                 where a method holds that torque which is fed back biases: `holds`
    covariance, freedom, standard_errors  of the parameters: `covariance`, `freedom`, `standard_errors`
    intervals                             how the intervals were made, or None
    alternatives, shifts                  effects that the model lacks, with their shifts; those of all of them
                                          together: `alternatives`
    variation_p                           probability of a variation as large, by parameter and of "all"
    options, selection                    options that are no defaults; the choice by candidates, "chosen" and its curve
    reference                             variable of which instruments were made
    nonlinearity                          "velocity" [rad/s] and "torque" [N·m] of the curve before the dynamics
    noise_frequency, noise_spectrum       of what is left [Hz, (N·m)²/Hz]
    singular_values, order, poles         of a subspace method
    instrument_rows                       rows of its instruments
    excitation                            information about a trajectory over its mean
    converged                             whether a search ended
    conditions, position                  of an ensemble: trials of each condition, and its mean position [rad]
    apparatus                             what was subtracted: "text", "source", "fingerprint", "values", and the
                                          "standard_errors" of the parameters that are its own: `apparatus`
    source                                of an apparatus: what its record is called
    ====================================  ==============================================================================

    Examples
    --------
    >>> from ankleloop import identify, simulate
    >>> estimate = identify(simulate(seed=1, duration=20.0), "riv")
    >>> low, high = estimate.intervals["K"]
    >>> low < estimate.stiffness["K"] < high
    True
    >>> estimate["K"] == estimate.stiffness["K"]
    True
    >>> list(estimate.to_dataframe())
    ['net', 'intrinsic', 'reflex', 'measured']
    >>> estimate.model.ninputs, round(estimate.reflex["delay"], 2)
    (4, 0.04)
    >>> estimate.predict(simulate(seed=2, duration=20.0)).torque.sizes == estimate.torque.sizes
    True
    """

    method: str
    torque: xr.Dataset
    stiffness: dict[str, float]
    reflex: dict[str, float]
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict)
    diagnostics: dict[str, Any] = field(default_factory=dict)
    predictor: Model | None = field(default=None, repr=False)
    trajectories: xr.Dataset | None = field(default=None, repr=False)

    def __getitem__(self, name: str) -> float:
        """Value of a parameter, such as ``estimate["K"]``, by the names of `params`."""
        values = self.values
        if name not in values:
            known = ", ".join(values)
            raise KeyError(f"there is no {name!r}{suggest_name(name, values)}; there are {known}.")
        return values[name]

    @property
    def params(self) -> pd.DataFrame:
        """The parameters as a table.

        A row for each by its name, with `value`, `standard_error`, the ends `low` and `high` of its 95 % interval (nan
        where the method gives none), and `unit`.
        """
        values = self.values
        errors = self.standard_errors
        no_interval = (np.nan, np.nan)
        rows = {}
        for name, quantity in QUANTITIES.items():
            if name in values:
                low, high = self.intervals.get(name, no_interval)
                rows[name] = {
                    "value": values[name],
                    "standard_error": errors.get(name, np.nan),
                    "low": low,
                    "high": high,
                    "unit": quantity.unit,
                }
        return pd.DataFrame.from_dict(rows, orient="index").rename_axis("parameter")

    @property
    def residual(self) -> xr.DataArray:
        """Measured less net torque over time [N·m]."""
        if MEASURED not in self.torque:
            raise DataError(
                "an estimate of a study holds no measured torque, so it has no residual: identify the trial."
            )
        return self.torque[MEASURED] - self.torque["net"]

    def to_dataframe(self) -> pd.DataFrame:
        """The torques [N·m] over time [s], as `torque`; those of merged trials with the number of their `trial`."""
        return self.torque.to_dataframe()

    @property
    def matrices(self) -> Matrices | None:
        """Model in physical units from position, velocity, acceleration and the basis functions to the torque.

        None for methods without one. `model` is the same as a `control.StateSpace`. The basis functions are those of
        the velocity delayed by ``reflex["delay"]``: the delay is part of the inputs, not of A, B, C, D, and is also in
        `matrices.input_delays`.
        """
        return None if self.predictor is None else self.predictor.matrices

    @cached_property
    def model(self) -> StateSpace | None:
        """The matrices as a `control.StateSpace` with the names of its inputs; None for methods without them.

        Its reflex inputs are basis functions of the velocity delayed by ``reflex["delay"]``, made at the recording
        rate; its state belongs to the identification rate.
        """
        return None if self.matrices is None else self.matrices.state_space()

    @property
    def fit_warnings(self) -> list[str]:
        """Warnings about this fit, without those about the data, which concern every other fit to them alike."""
        about_data = self.diagnostics.get("data_warnings", ())
        return [text for text in self.warnings if text not in about_data]

    def predict(
        self,
        trial: Trials,
        *,
        cycle_onsets: Onsets = None,
    ) -> Estimate:
        """The estimate with the torques that its model gives on another trial, from a state of rest.

        Delay, basis and identification rate are those of the model, means those of the trial.

        Parameters
        ----------
        trial : xarray.Dataset or PreparedTrial, or list of those
            A trial that the fit need not have seen, recorded at any multiple of the identification rate; `evaluate`
            scores the result on it. Torques of several trials stand one after the other.
        cycle_onsets : str or sequence of float, optional
            Start of every cycle of this trial [s], or the variable that holds the phase, for a joint that changes with
            it; by default the variable that was fitted. Of several trials a sequence for each.

        Returns
        -------
        Estimate
            With a further warning in `diagnostics` where the velocity leaves the range to which a polynomial or spline
            basis was fitted.

        Raises
        ------
        DataError
            If the trial is unusable, or the method has no model to predict with.
        """
        if self.predictor is None:
            raise DataError(
                f"{self.method} has no fixed model to predict with: identify by another method."
            )
        trials = prepare_trials(trial)
        onsets = split_onsets(cycle_onsets, len(trials))
        pairs = zip(trials, onsets, strict=True)
        torques = [self.predictor.predict(part, own) for part, own in pairs]
        torque = add_measured(merge_torques(torques), trials)
        warnings = [text for part in trials for text in self.predictor.check_range(part)]
        diagnostics = dict(self.diagnostics)
        diagnostics["warnings"] = [*self.warnings, *dict.fromkeys(warnings)]
        return replace(self, torque=torque, diagnostics=diagnostics)

    @property
    def warnings(self) -> list[str]:
        """What was seen to be wrong, of the data and of the fit."""
        return list(self.diagnostics.get("warnings", ()))

    @property
    def remarks(self) -> list[str]:
        """What moves a parameter by less than the tolerance, with its size; the interval holds both values."""
        return list(self.diagnostics.get("remarks", ()))

    @property
    def trusted(self) -> bool:
        """Whether there is no warning about the fit (`ankleloop.joint.verdicts`); those about data concern all fits."""
        return not self.fit_warnings

    @property
    def standard_errors(self) -> dict[str, float]:
        """Standard errors of the parameters by name; empty where the method gives none."""
        return dict(self.diagnostics.get("standard_errors", {}))

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the intervals; infinite where they are normal."""
        return float(self.diagnostics.get("freedom", np.inf))

    @property
    def alternatives(self) -> list[dict[str, Any]]:
        """Effects that the record shows and the model lacks, the likeliest first, with how far they move parameters."""
        return list(self.diagnostics.get("alternatives", ()))

    @property
    def values(self) -> dict[str, float]:
        """Values of all parameters by their names."""
        return {**self.stiffness, **self.reflex}

    @property
    def conditions(self) -> dict[str, int]:
        """Trials of each condition of an ensemble by its name, in the order of their torques; else empty."""
        return dict(self.diagnostics.get("conditions", {}))

    @property
    def apparatus(self) -> str:
        """What was subtracted of the torque, in words; empty where nothing was."""
        return str(self.diagnostics.get("apparatus", {}).get("text", ""))

    @property
    def holds(self) -> str:
        """Where the parameters hold, "in open loop" for a method that torque that is fed back biases; else empty."""
        return str(self.diagnostics.get("holds", ""))

    @property
    def covariance(self) -> pd.DataFrame:
        """Covariance of the parameters, a row and a column for each; empty where the method gives no intervals."""
        return pd.DataFrame(self.diagnostics.get("covariance", {}))

    @property
    def correlation(self) -> pd.DataFrame:
        """Correlation of the parameters, a row and a column for each.

        Empty where the method gives no intervals, or where their covariance has fewer degrees of freedom than there are
        parameters: that of four trials that scatter has three, and its correlations are near ±1 whatever they are.
        """
        covariance = self.covariance
        if self.freedom < len(covariance):
            return pd.DataFrame()
        errors = np.sqrt(np.diag(covariance.to_numpy(dtype=float)))
        return covariance / np.outer(errors, errors)

    def interval(self, level: float = 0.95) -> dict[str, tuple[float, float]]:
        """Intervals of another confidence.

        Parameters
        ----------
        level : float
            Confidence; 0.95 is that of `intervals`.

        Returns
        -------
        dict of str to tuple of float
            Low and high by the names of `stiffness` and `reflex`; empty where the method gives no intervals. Where the
            record shows an effect that the model does not have, they hold the values with it, as `intervals` do.

        Raises
        ------
        ValueError
            For a level that is not between 0 and 1.

        Examples
        --------
        >>> from ankleloop import identify, simulate
        >>> estimate = identify(simulate(seed=1, duration=20.0), "riv")
        >>> (low, high), (lower, higher) = estimate.interval(0.9)["K"], estimate.intervals["K"]
        >>> lower < low < high < higher
        True
        """
        level = check_number("interval", "level", level, gt=0, lt=1)
        values = self.values
        uncertainty = Uncertainty(self.diagnostics.get("covariance", {}), self.freedom)
        intervals = uncertainty.intervals(values, level)
        return extend_intervals(intervals, values, self.diagnostics.get("shifts", {}))

    @property
    def vaf_net(self) -> float | None:
        """VAF of the net torque [%] without the first and the last second; None without a measured torque."""
        inside = scored_samples(self.torque, TRIM)
        if MEASURED not in self.torque or not all(rows.stop - rows.start > 1 for rows in inside):
            return None
        measured = self.torque[MEASURED].values
        estimated = self.torque["net"].values
        return vaf(join_centred(measured, inside), join_centred(estimated, inside))

    def summary(self) -> pd.DataFrame:
        """The parameters as a table to read: that of `params` by their symbols.

        Returns
        -------
        pandas.DataFrame
            A row for each parameter by its symbol, with `value`, the ends `low` and `high` of its 95 % interval (nan
            where the method gives none), and `unit`; and `holds`, "in open loop", where torque that is fed back biases
            the method.

        Examples
        --------
        >>> from ankleloop import identify, simulate
        >>> table = identify(simulate(seed=1, duration=20.0), "riv").summary()
        >>> print(f"K = {table.value['K']:.0f} {table.unit['K']}")
        K = 151 N·m/rad
        >>> list(table.index)
        ['K', 'B', 'I', 'G', 'ωn', 'ζ', 'delay']
        """
        symbols = {name: quantity.symbol for name, quantity in QUANTITIES.items()}
        table = self.params.drop(columns="standard_error").rename(index=symbols)
        if self.holds:
            table["holds"] = self.holds
        return table

    def plot(
        self,
        trial: Trials | None = None,
        figure: Figure | SubFigure | None = None,
        window: tuple[float, float] | None = None,
    ) -> Figure | SubFigure:
        """Plot the torques with the measured one, or the trajectories of a joint that changes.

        Parameters
        ----------
        trial : xarray.Dataset or PreparedTrial, or list of those, optional
            The trial. Of a simulated one, the true torques or trajectories are drawn, too. Of merged trials, the list
            of all; the torques of the first one are drawn.
        figure : matplotlib Figure or SubFigure, optional
            The figure to draw into; a new one if left out.
        window : tuple of float, optional
            Start and end of the torques that are drawn [s]; by default five seconds from 10 s on.

        Returns
        -------
        matplotlib.figure.Figure
            The figure, which notebooks and ``plt.show`` show, and ``savefig`` writes; its attribute `data` is the table
            of its numbers. Without a trial it names the measured torque that it shows: that at the samples of the
            estimate, less its mean.

        Raises
        ------
        DataError
            Without a trial, for an estimate of a study, which holds no measured torque.
        ValueError
            For a window that does not end after it starts.

        Examples
        --------
        >>> from ankleloop import identify, simulate
        >>> trial = simulate(seed=1, duration=20.0)
        >>> estimate = identify(trial, "riv")
        >>> [axis.get_ylabel() for axis in estimate.plot().axes]
        ['net torque [N·m]', 'intrinsic torque [N·m]', 'reflex torque [N·m]']
        >>> estimate.plot(trial).data["series"].unique().tolist()
        ['measured', 'riv (estimated)', 'true (simulated)']
        """
        from ankleloop.plotting.estimates import plot_estimate  # which stands above estimates

        return plot_estimate(self, trial, figure, window)

    def methods_text(self) -> str:
        """A paragraph for a paper: method, records, rate, delay, intervals, options and version.

        Returns
        -------
        str

        Examples
        --------
        >>> from ankleloop import identify, simulate
        >>> text = identify(simulate(seed=1, duration=20.0), "riv", order=3).methods_text()
        >>> "Options other than the defaults: order = 3." in text
        True
        """
        from ankleloop.methods.description import describe_methods  # which stands above estimates

        return describe_methods(self)

    def __eq__(self, other: object) -> bool:
        """Whether method, parameters, intervals and torques are the same; details of the fit do not count."""
        if not isinstance(other, Estimate):
            return NotImplemented
        return (
            self.method == other.method
            and self.stiffness == other.stiffness
            and self.reflex == other.reflex
            and self.intervals == other.intervals
            and self.torque.identical(other.torque)
        )

    def __hash__(self) -> int:
        """Of what equal estimates have alike: method and parameters."""
        parameters = self.values
        return hash((self.method, frozenset(parameters.items())))

    def __repr__(self) -> str:
        table = self.summary().to_string(float_format=DIGITS, na_rep="–", index_names=False)
        heading = f"<Estimate by {self.method}>"
        return "\n  ".join([heading, *table.splitlines(), *self._list_remarks()])

    def _repr_html_(self) -> str:
        """The same in a notebook."""
        table = self.summary().to_html(float_format=DIGITS, na_rep="–", index_names=False)
        remarks = "".join(f"<li>{escape(text)}</li>" for text in self._list_remarks())
        return f"<p><b>Estimate by {escape(self.method)}</b></p>{table}<ul>{remarks}</ul>"

    def _list_remarks(self) -> list[str]:
        """Net VAF, where the delay comes from, what is missing or assumed, and warnings."""
        first = []
        score = self.vaf_net
        if score is not None:
            first.append(f"net VAF: {score:.1f} %")
        if "delay" in self.reflex:
            delay = "estimated" if "delay" in self.intervals else "assumed"
            first.append(f"reflex delay: {delay}")
        lines = ["; ".join(first)]
        if self.apparatus:
            lines.append(self.apparatus)
        trials = len(split_torques(self.torque))
        if self.conditions:
            counts = [f"{name} ({count} trials)" for name, count in self.conditions.items()]
            lines.append(f"conditions: {', '.join(counts)}")
        elif trials > 1 and self.intervals:
            between = self.diagnostics.get("intervals") == "between trials"
            mean = "all trials like these" if between else "these trials"
            lines.append(f"intervals: for the mean over {mean} ({trials})")
        correlated = self._list_correlated()
        if correlated:
            lines.append(f"correlated: {', '.join(correlated)}")
        elif self.freedom < len(self.covariance):
            lines.append(
                f"correlated: cannot be judged ({self.freedom:g} degrees of freedom, {len(self.covariance)} parameters)"
            )
        for kind, label in LABELS.items():
            lines += [f"{label}: {text}" for text in self.diagnostics.get(kind, ())]
        return lines

    def _list_correlated(self) -> list[str]:
        """Pairs of parameters that are strongly correlated."""
        table = self.correlation
        return [
            f"{QUANTITIES[first].symbol} and {QUANTITIES[second].symbol} {table.loc[first, second]:.2f}"
            for first, second in combinations(table.index, 2)
            if abs(table.loc[first, second]) > SHOWN_CORRELATION
        ]


def add_measured(torque: xr.Dataset, trials: Sequence[PreparedTrial]) -> xr.Dataset:
    """Estimated torques and, at their times, the measured torque of each trial less its mean."""
    channels = sample_channel(trials, "torque", torque)
    values = np.concatenate([channel - channel.mean() for channel in channels])
    return torque.assign({MEASURED: torque_variable(MEASURED, values)})


def scored_samples(torque: xr.Dataset, trim: float) -> list[slice]:
    """Samples of torques without some time at either end [s], of each trial."""
    samples = []
    start = 0
    for part in split_torques(torque):
        time = part.variables["time"].values
        first = np.searchsorted(time, time[0] + trim)
        last = np.searchsorted(time, time[-1] - trim, side="right")
        samples.append(slice(start + int(first), start + int(last)))
        start += time.size
    return samples


def join_centred(values: np.ndarray, parts: Sequence[slice]) -> np.ndarray:
    """Parts of a signal, each less its mean, one after the other."""
    return np.concatenate([values[part] - values[part].mean() for part in parts])
