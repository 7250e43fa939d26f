"""The picture of the exploration: made once, then its lines and texts are moved."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from PIL import Image

from ankleloop.exploration.experiment import SCORED, Fit, Result, pole_frequency
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import TORQUES
from ankleloop.plotting.method_styles import MethodStyle, method_styles
from ankleloop.plotting.style import MEASURED_LINE, REFERENCE_LINE, STYLE, TRUE_LINE
from ankleloop.quantities import QUANTITIES

SIZE = (11.4, 6.6)  # in
DOTS_PER_INCH = 88
WINDOW = 5.0  # s at the middle of the record that are drawn
PARAMETERS = ("K", "B", "I", "G")
LARGEST = 200.0  # % of the true value at which the axis of parameters ends
LOWEST = 0.0  # % at which the axis of VAF ends
OFFSETS = (-0.16, 0.16)  # of the rows of both methods
LINE = 150  # characters of a remark
SENTENCE = 70  # characters of a line of a refusal
LEVELS = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0)  # limits of an axis of torque, times a power of ten

Arrays = tuple[np.ndarray, np.ndarray]


class Picture:
    r"""Traces, parameters with intervals, VAF and poles of two methods.

    `update` moves what is drawn; `png` gives the picture as bytes. The axes, their labels and the truth are drawn by
    the style of all figures.
    """

    def __init__(self) -> None:
        with matplotlib.rc_context(STYLE):
            self.figure = Figure(figsize=SIZE, dpi=DOTS_PER_INCH)
            self._canvas = FigureCanvasAgg(self.figure)
            self._torques = dict(zip(TORQUES, self._make_torque_axes(), strict=True))
            symbols = [QUANTITIES[name].symbol for name in PARAMETERS]
            self._parameters = self._make_rows((0.62, 0.745, 0.36, 0.205), symbols)
            self._parameters.set(xlim=(0.0, LARGEST), xlabel="parameter over its true value [%]")
            self._parameters.axvline(100.0, **REFERENCE_LINE)
            self._vaf = self._make_rows((0.62, 0.545, 0.36, 0.125), list(TORQUES))
            self._vaf.set(xlim=(LOWEST, 101.0), xlabel="VAF [%]")
            self._poles = self._make_pole_axes()
            self._methods = [_MethodArtists(self, number) for number in range(2)]
            self._remarks = [self.figure.text(0.01, 0.035 - 0.024 * n, "", fontsize=7, va="center") for n in range(2)]
            self._numbers = self.figure.text(0.805, 0.30, "", fontsize=7, va="top", linespacing=1.4)
            self.figure.text(0.055, 0.965, "grey: measured, black: true", fontsize=7.5, va="center")
            self._limits: list[tuple[float, ...]] = []
            box = {"facecolor": "white", "edgecolor": "#888888", "pad": 12.0}
            self._refusal = self.figure.text(
                0.5, 0.5, "", fontsize=10, ha="center", va="center", bbox=box, visible=False
            )

        self._moving: list[Artist] = [*self._targets.values(), self._true_poles, self._numbers, *self._remarks]
        self._moving += [artist for method in self._methods for artist in method.all_artists()] + [self._refusal]
        for artist in self._moving:
            artist.set_animated(True)

    @property
    def message(self) -> str:
        """The sentence that stands in the picture where there is no trial."""
        return self._refusal.get_text().replace("\n", " ") if self._refusal.get_visible() else ""

    @property
    def remarks(self) -> list[str]:
        """What stands below the picture about both methods: warnings and refusals."""
        return [remark.get_text() for remark in self._remarks]

    def update(self, result: Result) -> None:
        """Show an experiment."""
        with matplotlib.rc_context(STYLE):
            self._refusal.set_text(textwrap.fill(result.refusal, SENTENCE))
            self._refusal.set_visible(bool(result.refusal))
            if result.trial is None:
                self._clear()
                return
            fits = result.fits
            styles = list(method_styles({str(n): fit.method for n, fit in enumerate(fits)}).values())
            window = _window(result.trial)
            self._show_truth(result, window)
            for artists, fit, style in zip(self._methods, fits, styles, strict=True):
                artists.show(result, fit, style, window)
            self._fit_limits()
            self._numbers.set_text(_describe_poles(result))
            for text, fit, style in zip(self._remarks, fits, styles, strict=True):
                text.set_text(
                    textwrap.shorten(f"{fit.method}: {fit.remark}" if fit.remark else "", LINE, placeholder=" …")
                )
                text.set_color(style.colour)

    def png(self) -> bytes:
        """The picture as a PNG file."""
        limits: list[tuple[float, ...]] = [(*axis.get_xlim(), *axis.get_ylim()) for axis in self._torques.values()]
        with matplotlib.rc_context(STYLE):
            if self._limits != limits:  # the axes alone, which stay as they are under most changes
                self._canvas.draw()
                self._axes, self._limits = self._canvas.copy_from_bbox(self.figure.bbox), limits
            self._canvas.restore_region(self._axes)
            for artist in self._moving:
                self.figure.draw_artist(artist)
        stream = io.BytesIO()
        Image.fromarray(np.asarray(self._canvas.buffer_rgba())[:, :, :3]).save(stream, "png", compress_level=1)
        return stream.getvalue()

    def _make_torque_axes(self) -> list[Axes]:
        axes: list[Axes] = []
        self._targets: dict[str, Line2D] = {}
        for row, torque in enumerate(TORQUES):
            place = (0.055, 0.71 - 0.295 * row, 0.485, 0.24)
            axis = self.figure.add_axes(place, sharex=axes[0] if axes else None)
            axis.set_ylabel(f"{torque} torque [N·m]")
            axis.tick_params(labelbottom=row == 2)
            target = MEASURED_LINE if torque == "net" else TRUE_LINE
            label = "measured" if torque == "net" else "true (simulated)"
            (self._targets[torque],) = axis.plot([], [], **target, label=label)
            axes.append(axis)
        axes[-1].set_xlabel("time [s]")
        return axes

    def _make_rows(self, place: tuple[float, float, float, float], names: Sequence[str]) -> Axes:
        """Axes with a row for each name."""
        axis = self.figure.add_axes(place)
        axis.set_ylim(len(names) - 0.5, -0.5)
        axis.set_yticks(range(len(names)), names)
        return axis

    def _make_pole_axes(self) -> Axes:
        axis = self.figure.add_axes((0.60, 0.055, 0.18, 0.235))
        axis.set(xlim=(-1.1, 1.1), ylim=(-1.1, 1.1), aspect="equal", xticks=[-1, 0, 1], yticks=[-1, 0, 1])
        axis.set_title("poles of the reflex")
        axis.add_patch(Circle((0, 0), 1.0, fill=False, lw=0.6, ec="#888888"))
        true: dict[str, Any] = {"marker": "x", "ls": "", "ms": 7, "mew": 1.4, "color": "black", "zorder": 4}
        (self._true_poles,) = axis.plot([], [], **true)
        return axis

    def _show_truth(self, result: Result, window: tuple[float, float]) -> None:
        """Torques of the trial, decimated as those of the estimates are."""
        trial = result.trial
        assert trial is not None  # of the caller
        estimate = next((fit.estimate for fit in result.fits if fit.estimate is not None), None)
        time = trial.samples("time") if estimate is None else estimate.torque["time"].values
        shown = (time >= window[0]) & (time <= window[1])
        for torque, line in self._targets.items():
            name = "torque" if torque == "net" else f"torque_{torque}"
            if estimate is None:
                values = trial.samples(name)
            else:
                values = trial.channel_at(name, time, estimate.torque.attrs["identification_rate"])
            line.set_data(time[shown], (values - values.mean())[shown])
        self._true_poles.set_data(result.poles.real, result.poles.imag)
        next(iter(self._torques.values())).set_xlim(*window)

    def _fit_limits(self) -> None:
        """Limits of the torques: of the truth, so that an estimate that is lost does not hide it."""
        for torque, axis in self._torques.items():
            values = np.asarray(self._targets[torque].get_ydata())
            limit = _round_up(1.15 * float(np.abs(values).max()) or 1.0)
            if axis.get_ylim() != (-limit, limit):
                axis.set_ylim(-limit, limit)

    def _clear(self) -> None:
        """Leave axes alone."""
        for line in (*self._targets.values(), self._true_poles):
            line.set_data([], [])
        for artists in self._methods:
            artists.clear()
        for text in (*self._remarks, self._numbers):
            text.set_text("")


class _MethodArtists:
    """Lines and symbols of one of the two methods."""

    def __init__(self, picture: Picture, number: int) -> None:
        self._offset = OFFSETS[number]
        self._traces = {torque: axis.plot([], [], lw=1.0)[0] for torque, axis in picture._torques.items()}
        rows = picture._parameters, picture._vaf
        self._symbols = [axis.plot([], [], ls="", ms=5)[0] for axis in rows]
        self._beyond = [axis.plot([], [], ls="", ms=7, clip_on=False)[0] for axis in rows]
        self._intervals = [picture._parameters.plot([], [], lw=1.4)[0] for _ in PARAMETERS]
        self._poles = picture._poles.plot([], [], ls="", ms=5)[0]
        self._title = picture.figure.text(0.27 + 0.15 * number, 0.965, "", fontsize=9, va="center", weight="bold")
        self._values = picture.figure.text(0.585 + 0.205 * number, 0.455, "", fontsize=7, va="top", linespacing=1.4)

    def show(self, result: Result, fit: Fit, style: MethodStyle, window: tuple[float, float]) -> None:
        """Move all artists to what the method has found."""
        self.clear()
        symbol = {"color": style.colour, "marker": style.marker, "markerfacecolor": style.symbol["markerfacecolor"]}
        self._title.set(text=f"- - {fit.method}", color=style.colour)
        self._values.set(text=f"{fit.method}\n{_describe_values(fit)}", color=style.colour)
        for line in (*self._traces.values(), *self._intervals):
            line.set(color=style.colour, linestyle="-" if line in self._intervals else (0, (4, 1.2)))
        for line in (*self._symbols, self._poles):
            line.set(**symbol)
        if fit.estimate is None:
            return
        time = fit.estimate.torque["time"].values
        shown = (time >= window[0]) & (time <= window[1])
        for torque, line in self._traces.items():
            values = fit.estimate.torque[torque].values
            line.set_data(time[shown], (values - values.mean())[shown])
        self._show_parameters(fit, result.truth)
        self._place(1, np.array([fit.vaf[torque] for torque in SCORED]), LOWEST, 101.0)
        self._poles.set_data(fit.poles.real, fit.poles.imag)

    def _show_parameters(self, fit: Fit, truth: Mapping[str, float]) -> None:
        assert fit.estimate is not None  # of the caller
        values = {**fit.estimate.stiffness, **fit.estimate.reflex}
        scale = {name: 100.0 / truth[name] if truth[name] else np.nan for name in PARAMETERS}
        self._place(0, np.array([values.get(name, np.nan) * scale[name] for name in PARAMETERS]), 0.0, LARGEST)
        for row, (name, line) in enumerate(zip(PARAMETERS, self._intervals, strict=True)):
            if name in fit.intervals:
                ends = np.array(fit.intervals[name]) * scale[name]
                line.set_data(ends, [row + self._offset] * 2)

    def _place(self, number: int, values: np.ndarray, low: float, high: float) -> None:
        """Place symbols, and arrow heads at the edge for values beyond it."""
        rows = np.arange(values.size) + self._offset
        inside = (values >= low) & (values <= high)
        self._symbols[number].set_data(values[inside], rows[inside])
        below = values < low
        beyond = below | (values > high)
        self._beyond[number].set_data(np.where(below, low, high)[beyond], rows[beyond])
        self._beyond[number].set(marker=8 if below.any() else 9, color=self._symbols[number].get_color())

    def all_artists(self) -> list[Artist]:
        """Lines, symbols and texts."""
        return [*self._lines(), self._title, self._values]

    def _lines(self) -> list[Line2D]:
        return [*self._traces.values(), *self._symbols, *self._beyond, *self._intervals, self._poles]

    def clear(self) -> None:
        """Draw nothing."""
        for line in self._lines():
            line.set_data([], [])
        for text in (self._title, self._values):
            text.set_text("")


def _window(trial: PreparedTrial) -> tuple[float, float]:
    time = trial.samples("time")
    middle = 0.5 * float(time[0] + time[-1])
    return max(float(time[0]), middle - WINDOW / 2), min(float(time[-1]), middle + WINDOW / 2)


def _round_up(value: float) -> float:
    """The next limit of an axis, so that small changes leave the axis as it is."""
    decade = 10.0 ** np.floor(np.log10(value))
    return float(decade * next((level for level in LEVELS if level * decade >= value), 10.0))


def _describe_values(fit: Fit) -> str:
    """K, B, I and G of a method with their intervals, and its VAF."""
    if fit.estimate is None:
        return "no estimate"
    values = {**fit.estimate.stiffness, **fit.estimate.reflex}
    lines = []
    for name in PARAMETERS:
        if name in values:
            interval = fit.intervals.get(name)
            ends = "" if interval is None else " ({:.3g} … {:.3g})".format(*interval)
            lines.append(f"{QUANTITIES[name].symbol} = {values[name]:.3g}{ends} {QUANTITIES[name].unit}")
    lines.append(f"VAF = {', '.join(_format(fit.vaf[torque]) for torque in SCORED)} %")  # in the order of the rows
    return "\n".join(lines)


def _format(value: float) -> str:
    return f"{value:.1f}" if np.isfinite(value) else "–"


def _describe_poles(result: Result) -> str:
    """Natural frequency and damping of all poles, in words."""
    rate = next((fit.estimate.torque.attrs["identification_rate"] for fit in result.fits if fit.estimate), None)
    lines = []
    if rate is not None:
        for name, poles in (("true", result.poles), *((fit.method, fit.poles) for fit in result.fits)):
            frequency, damping = pole_frequency(poles, rate)
            order = np.argsort(frequency)
            pairs = dict.fromkeys(f"{frequency[n]:.2g} Hz, ζ {damping[n]:.2f}" for n in order)
            lines += [f"{name}:", *(f"  {pair}" for pair in list(pairs)[:3])]
    return "\n".join(lines)
