"""Estimates while a subject is recorded: `riv` on a window that slides."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from queue import Empty, Queue
from threading import Thread
from time import perf_counter
from typing import Any, Literal, Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from ankleloop.checks.record import SHORTEST_RECORD
from ankleloop.errors import DataError, describe_error
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.regressors import decimation_grid
from ankleloop.live.change import COMPARED, ChangeDetector
from ankleloop.live.stream import Stream, Window
from ankleloop.methods.method import NOMINAL_DELAY
from ankleloop.methods.registry import find_method, identify
from ankleloop.options import as_real, check_argument, check_flag, check_number
from ankleloop.quantities import PARAMETERS
from ankleloop.signals.sampling import parse_rate
from ankleloop.trials.trial import new_trial

OWNER = "LiveEstimate"
SHOWN = ("K", "B", "I", "G")
COLUMNS = (
    "time",
    "window",
    *(f"{name}{end}" for name in SHOWN for end in ("", "_low", "_high")),
    "warnings",
    "failure",
)
LONGEST_HISTORY = 3600.0  # s


class LiveEstimate:
    """K, B, I and G with intervals during the recording, by `riv` on a window that slides.

    Each estimate is that of ``identify(window, "riv", **options)``, with its warnings and intervals. The window holds
    the last samples, at most `memory` seconds of them and 10 s at least. It begins anew after a sample that is missing
    and after a gap; samples that come twice or late are left out.

    Parameters
    ----------
    sampling_rate : float
        Sampling rate of the stream [Hz].
    memory : float
        Longest window [s]. A longer one has narrower intervals, and follows a change later.
    every : float
        Time from one estimate to the next [s].
    beside : bool
        Whether a thread of its own fits, so that `add` returns at once. Where it is late, windows are left out, and
        never samples. Python runs one thread at a time: `add` may wait for some milliseconds. Without the thread `add`
        fits itself, as a record that is replayed needs it.
    **options
        Options of `riv`, see ``help(ankleloop.METHODS["riv"].options)``.

    Attributes
    ----------
    estimate : Estimate or None
        The newest estimate.

    Raises
    ------
    TypeError, ValueError
        For an unknown option, or a value out of its range.
    DataError
        For a sampling rate that is no number, or that the rate of the identification does not divide.

    Examples
    --------
    >>> from ankleloop import simulate
    >>> trial = simulate(seed=1, duration=22.0)
    >>> with LiveEstimate(sampling_rate=1000.0, every=2.0, beside=False) as live:
    ...     live.add(trial.position, trial.torque, trial.reference)
    >>> live.history["time"].tolist()[-2:], live.enough({"K": 0.1})
    ([20.0, 22.0], True)
    >>> low, high = live.estimate.intervals["K"]
    >>> low < 150.0 < high
    True
    """

    def __init__(
        self,
        sampling_rate: float,
        memory: float = 20.0,
        every: float = 0.5,
        *,
        beside: bool = True,
        **options: Any,
    ) -> None:
        rate = parse_rate(sampling_rate, source=OWNER)
        memory = check_number(OWNER, "memory", memory, "s", ge=SHORTEST_RECORD, le=3600)
        every = check_number(OWNER, "every", every, "s", ge=0.1, le=SHORTEST_RECORD)
        chosen = find_method("riv").options.parse("method 'riv'", **options).at_rate(rate)
        samples = round(memory * rate)
        delay = NOMINAL_DELAY if chosen.delay is None else chosen.delay
        grid = decimation_grid(samples, rate, chosen.identification_rate, delay)
        last = grid.first + grid.factor * (grid.samples - 1)
        self.estimate: Estimate | None = None
        self._rate = rate
        self._options = options
        self._has_reference = chosen.reference != "position"
        self._latency = {"filters": (samples - 1 - last) / rate, "window": 0.5 * memory, "fit": 0.0}
        self._stream = Stream(rate, memory, channels=3 if self._has_reference else 2)
        self._step = round(every * rate)  # samples from one estimate to the next
        self._left = self._step  # samples to the next one
        self._rows: list[dict[str, Any]] = []
        self._most_rows = round(LONGEST_HISTORY / every)
        self._changes = ChangeDetector(every)
        self._queue: Queue[Window | None] = Queue(maxsize=1)
        self._thread: Thread | None = None
        if check_flag(OWNER, "beside", beside):
            self._thread = Thread(target=self._work, name=OWNER, daemon=True)
            self._thread.start()

    def add(
        self,
        position: ArrayLike,
        torque: ArrayLike,
        reference: ArrayLike | None = None,
        time: ArrayLike | None = None,
    ) -> None:
        """Add samples: one, or any number of them.

        Parameters
        ----------
        position, torque : float or array_like, shape (N,)
            Position [rad] and torque [N·m]; nan where a sample is missing.
        reference : float or array_like, shape (N,), optional
            Command of the servo [rad]; it is not needed with ``reference="position"``.
        time : float or array_like, shape (N,), optional
            Stamps of the samples [s], from any origin. They show gaps, samples that come twice and a clock that drifts.
            Leave them out where they jitter by half a sampling interval.

        Raises
        ------
        DataError
            If a channel is no numbers, has another number of samples than the position, or is missing.
        """
        channels = {"position": position, "torque": torque}
        if self._has_reference:
            if reference is None:
                raise DataError(
                    f"{OWNER}: the reference is missing: add the command of the servo, or take reference='position' "
                    "in open loop."
                )
            channels["reference"] = reference
        if time is not None:
            channels["time"] = time
        rows = [as_real(values, name).ravel() for name, values in channels.items()]
        count = rows[0].size
        if any(row.size != count for row in rows):
            sizes = ", ".join(
                f"{name} {row.size}" for name, row in zip(channels, rows, strict=True)
            )
            raise DataError(f"{OWNER}: channels of different lengths ({sizes}): add whole samples.")
        stamps = None if time is None else rows.pop()
        samples = np.stack(rows)
        start = 0
        while start < count:
            part = slice(start, start + self._left)
            self._left -= self._stream.add(
                samples[:, part], None if stamps is None else stamps[part]
            )
            if not self._left:
                self._left = self._step
                self._hand_over(self._stream.take_window())
            start = part.stop

    def close(self) -> None:
        """Wait for the fits that are due, and end the thread."""
        if self._thread is not None:
            self._queue.put(None)
            self._thread.join()
            self._thread = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def history(self) -> pd.DataFrame:
        """A row for each window of the last hour.

        `time` is the end of the window [s], from the first sample on, and `window` its length [s]. Then come K, B, I
        and G, each with the ends of its 95 % interval (`K_low`, `K_high`), `warnings`, and `failure`: why there is no
        estimate, else empty.
        """
        return pd.DataFrame(list(self._rows), columns=COLUMNS)

    @property
    def change(self) -> pd.DataFrame:
        """The last change of K and of G: `since` when [s], `before`, `after` and `score`; nan where none was found.

        The last 10 s are compared with the window before them, in standard errors. The threshold is such that K of a
        constant joint gives one false alarm in an hour. `power` is the probability that a step by 30 % is found.
        """
        return self._changes.table

    @property
    def latency(self) -> dict[str, float]:
        """Age of the newest number [s]: what `filters` cut off, half of the `window`, and what the last `fit` took."""
        return dict(self._latency)

    def enough(self, widths: Mapping[str, float]) -> bool:
        """Whether the intervals of the last window are as narrow as asked for.

        Parameters
        ----------
        widths : mapping
            Half-width of the 95 % interval over the value, by parameter: ``{"K": 0.05}`` is K within 5 %.

        Returns
        -------
        bool
            False where the last window gave no estimate.

        Raises
        ------
        ValueError
            For an unknown parameter, or a width that is no number between 0.0001 and 10.
        """
        for name, width in widths.items():
            check_argument(Literal[tuple(PARAMETERS)], "enough", "parameter", name)
            check_number("enough", f"widths: {name}", width, ge=1e-4, le=10)
        estimate = self.estimate
        if estimate is None or self._rows[-1]["failure"]:
            return False
        values = {**estimate.stiffness, **estimate.reflex}
        for name, width in widths.items():
            low, high = estimate.intervals.get(name, (-np.inf, np.inf))
            value = values.get(name, np.nan)
            if not max(high - value, value - low) <= width * abs(value):
                return False
        return True

    def _hand_over(self, window: Window) -> None:
        """Fit a window, or leave it to the thread, in the place of one that still waits."""
        if self._thread is None:
            self._fit(window)
            return
        with suppress(Empty):
            late = self._queue.get_nowait()
            window.warnings.extend(late.warnings if late else [])
            window.warnings.append("a window was left out, because the computer is late.")
        self._queue.put(window)

    def _work(self) -> None:
        """Fit windows until there are no more."""
        while (window := self._queue.get()) is not None:
            self._fit(window)

    def _fit(self, window: Window) -> None:
        """Add the row of a window."""
        start = perf_counter()
        row: dict[str, Any] = {"time": window.time, "window": window.samples.shape[1] / self._rate}
        row["failure"] = ""
        warnings = window.warnings
        try:
            estimate, last = self._identify(window.samples)
        except Exception as error:  # whatever it is, the recording goes on
            row["failure"] = describe_error(error)
        else:
            self._changes.add(window.time, estimate, last)
            self.estimate = estimate
            row |= _list_numbers(estimate)
            warnings = [*warnings, *estimate.diagnostics["warnings"]]
        row["warnings"] = " ".join(dict.fromkeys(warnings))
        self._latency["fit"] = perf_counter() - start
        self._rows.append(row)
        del self._rows[: -self._most_rows]

    def _identify(self, samples: np.ndarray) -> tuple[Estimate, Estimate]:
        """Estimates of a window and of its last seconds."""
        seconds = samples.shape[1] / self._rate
        if seconds < SHORTEST_RECORD - 1e-9:
            raise DataError(
                f"the window holds {seconds:.3g} s, and {SHORTEST_RECORD:g} s are needed."
            )
        *channels, times = samples
        trial = new_trial(channels[0], channels[1], self._rate, *channels[2:])
        trial = trial.assign_coords(time=trial["time"].copy(data=trial["time"] + times[0]))
        window = identify(trial, "riv", **self._options)
        count = round(COMPARED * self._rate)
        if count == times.size:
            return window, window
        return window, identify(trial.isel(time=slice(-count, None)), "riv", **self._options)


def _list_numbers(estimate: Estimate) -> dict[str, float]:
    """Parameters of an estimate that are shown, with the ends of their intervals."""
    values = {**estimate.stiffness, **estimate.reflex}
    numbers = {}
    for name in SHOWN:
        low, high = estimate.intervals.get(name, (np.nan, np.nan))
        numbers |= {name: values.get(name, np.nan), f"{name}_low": low, f"{name}_high": high}
    return numbers
