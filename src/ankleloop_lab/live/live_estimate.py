"""Estimates while a subject is recorded: `riv` on a window that slides."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, suppress
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import ArrayLike

from ankleloop.assessment.scores import list_parameters
from ankleloop.checks.record import SHORTEST_RECORD
from ankleloop.errors import NUMERICAL_ERRORS, DataError, describe_error
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.prepared import prepare_trials
from ankleloop.methods.apparatus import subtract
from ankleloop.methods.registry import identify
from ankleloop.methods.riv.riv import RivOptions, identify_riv
from ankleloop.options import as_real, check_number
from ankleloop.signals.sampling import parse_rate
from ankleloop.trials.trial import check_sizes, new_trial
from ankleloop_lab.live.change import COMPARED, Change
from ankleloop_lab.live.record import Record
from ankleloop_lab.live.stream import Stream, check_window

OWNER = "LiveEstimate"
COLUMNS = [
    "time",
    "window",
    "latency",
    "K",
    "K_low",
    "K_high",
    "B",
    "B_low",
    "B_high",
    "I",
    "I_low",
    "I_high",
    "G",
    "G_low",
    "G_high",
    "warnings",
    "failure",
]
LONGEST_HISTORY = 7200  # rows, of an hour


class LiveEstimate(ExitStack):
    """K, B, I and G with intervals during the recording, by `riv` on a window that slides.

    Each estimate is that of ``identify(window, "riv", **options)``, with its warnings and intervals. The window has the
    last samples, at most `memory` seconds of them and at least 10 s. It begins anew after a sample that is missing or
    has no stamp, after a gap, and where stamps go back by more than `jitter`, as those of a program that is started
    again do; samples that come twice or late are left out. The warnings say so.
    Its `close`, or the end of a block that begins `with` it, waits for the fits that are due.

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
        never samples. Python runs one thread at a time, so `add` may wait for some milliseconds. Without the thread
        `add` fits itself, as for a record that is replayed.
    jitter : float
        How far stamps may be off [s]: those of programs that send samples in pieces are. Gaps up to it are not seen.
    record : Record, optional
        What writes the samples that follow one another, as `ankleloop live --record` does.
    apparatus : Estimate, optional
        What is subtracted of each window (`ankleloop.subtract`).
    **options
        Options of `riv`, see ``help(ankleloop.METHODS["riv"].options)``.

    Attributes
    ----------
    estimate : Estimate or None
        The newest estimate; its times are from the beginning of its window.
    samples : ndarray, shape (N, 4)
        The last samples that follow one another: time [s], position [rad], torque [N·m] and reference [rad], which is
        the position with ``reference="position"``.

    Raises
    ------
    TypeError, ValueError
        For an unknown option, or a value out of its range.
    DataError
        For a sampling rate that is no number.

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
        jitter: float = 0.0,
        record: Record | None = None,
        apparatus: Estimate | None = None,
        **options: Any,
    ) -> None:
        super().__init__()
        self._rate = parse_rate(sampling_rate, source=OWNER)
        self._memory = check_number(OWNER, "memory", memory, "s", ge=SHORTEST_RECORD, le=3600)
        every = check_number(OWNER, "every", every, "s", ge=0.1, le=COMPARED)
        self._apparatus = apparatus
        self._options = RivOptions.parse("method 'riv'", **options).at_rate(self._rate)
        self._given = options
        self.estimate: Estimate | None = None
        self._stream = Stream(self._rate, self._memory, jitter, record)
        self._step = round(every * self._rate)  # samples from one estimate to the next
        self._left = self._step  # samples to the next one
        self._rows = deque[dict[str, Any]](maxlen=LONGEST_HISTORY)
        self._changes = {"K": Change(), "G": Change()}
        self._beside = beside
        self._pool = self.enter_context(ThreadPoolExecutor(1))
        self._newest: Future[None] | None = None  # fit, which may still wait

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
            Where they jitter by half a sampling interval, state `jitter`, or leave them out.

        Raises
        ------
        DataError
            If a channel is missing, has no numbers, or is of another length.
        """
        if time is None:
            time = self._stream.end + np.arange(np.size(position)) / self._rate
        if self._options.reference == "position":
            reference = position
        given: dict[str, Any] = {
            "time": time,
            "position": position,
            "torque": torque,
            "reference": reference,
        }
        channels = {name: as_real(values, name).ravel() for name, values in given.items()}
        check_sizes({name: values.size for name, values in channels.items()}, source=OWNER)
        for stamp, *sample in np.column_stack(list(channels.values())).tolist():
            self._stream.add(stamp, sample)
            self._left -= 1
            if not self._left:
                self._left = self._step
                self._fit_window()

    @property
    def samples(self) -> np.ndarray:
        """The last samples that follow one another."""
        return self._stream.samples

    @property
    def history(self) -> pd.DataFrame:
        """A row for each of the last 7200 windows: an hour of two each second.

        `time` is the end of the window [s], from the first sample on, `window` its length [s], and `latency` the age of
        the estimate [s]: of the middle of the window without the ends that filters take. Then come K, B, I and G, each
        with the ends of its 95 % interval (`K_low`, `K_high`), `warnings`, and `failure`: why there is no estimate.
        """
        # A copy, because fits add rows beside.
        return pd.DataFrame(list(self._rows), columns=COLUMNS)

    @property
    def change(self) -> pd.DataFrame:
        """The last change of K and of G: `since` when [s], `before`, `after` and `score`; nan where none was found.

        The last 10 s are compared with the window before them. The score is in standard errors; the threshold is that
        of one false alarm of K in an hour. `power` is the probability that a step by 30 % is found: where it is small,
        a parameter may have changed unseen.
        """
        return pd.DataFrame.from_dict(self._changes, orient="index", columns=Change._fields)

    def enough(self, widths: Mapping[str, float]) -> bool:
        """Whether the window is full, and its intervals and most of those before them are as narrow as asked for.

        Intervals of shorter windows hold the truth less often, and so do those that are narrower than most: half of all
        full windows have to be within the width.

        Parameters
        ----------
        widths : mapping
            Half-width of the 95 % interval over the value, of K, B, I or G: ``{"K": 0.05}`` is K within 5 %.

        Returns
        -------
        bool
            False as well where the last window gave no estimate.

        Raises
        ------
        DataError
            For another parameter.
        """
        return not np.isnan(self.enough_since(widths))

    def enough_since(self, widths: Mapping[str, float]) -> float:
        """Time [s] since when all windows have been as `enough` asks for; nan where the last one is not.

        Parameters
        ----------
        widths : mapping
            As of `enough`.

        Returns
        -------
        float
        """
        history = self.history
        is_full = history["window"] > self._memory - 1.0 / self._rate
        is_enough = is_full
        for name, width in widths.items():
            if f"{name}_low" not in history:
                raise DataError(f"there is no parameter {name!r}; there are K, B, I and G.")
            half_width = (history[f"{name}_high"] - history[f"{name}_low"]) / 2.0
            share = (half_width / history[name].abs()).where(is_full)
            is_enough = is_enough & (np.maximum(share, share.expanding().median()) <= width)
        return float(history["time"].where(is_enough[::-1].cummin()).min())

    def _fit_window(self) -> None:
        """Fit the last samples, in the place of a window that still waits."""
        warnings = list(self._stream.list_faults())
        if self._newest and self._newest.cancel():
            warnings.append("the fits are late: a window was left out.")
        self._newest = self._pool.submit(self._fit, self._stream.end, self.samples, warnings)
        if not self._beside:
            self._newest.result()

    def _fit(self, end: float, samples: np.ndarray, warnings: list[str]) -> None:
        """Add the row of a window."""
        seconds = len(samples) / self._rate
        row: dict[str, Any] = {"time": end, "window": seconds, "failure": ""}
        try:
            if len(samples) < round(SHORTEST_RECORD * self._rate):
                raise DataError(f"{SHORTEST_RECORD:g} s are needed in which no sample is missing.")
            estimate = identify(self._make_trial(samples), "riv", **self._given)
            # Without an estimate of the last seconds, or of a window before them, nothing is compared.
            with suppress(LookupError, *NUMERICAL_ERRORS):
                self._find_changes(samples)
        except Exception as error:  # whatever it is, the recording goes on
            row["failure"] = describe_error(error)
        else:
            row |= list_parameters(estimate)
            row["latency"] = seconds - float(estimate.torque["time"].mean())
            warnings += check_window(samples, self._rate)
            warnings += estimate.warnings
            self.estimate = estimate
        row["warnings"] = " ".join(warnings)
        self._rows.append(row)

    def _make_trial(self, samples: np.ndarray) -> xr.Dataset:
        """Trial of samples."""
        _, position, torque, reference = samples.T
        trial = new_trial(position, torque, self._rate, reference)
        return trial if self._apparatus is None else subtract(trial, self._apparatus)

    def _find_changes(self, samples: np.ndarray) -> None:
        """Compare the last seconds with the window before them."""
        last = samples[-round(COMPARED * self._rate) :]
        # A window ends at the time of the sample that would come next.
        earlier = [row for row in self._rows if row["time"] < last[1, 0]][-1]
        # The window that they end was checked: their data are not checked again.
        trials = prepare_trials(self._make_trial(last))
        later = list_parameters(identify_riv(trials, self._options))
        for name, change in self._changes.items():
            self._changes[name] = change.update(name, earlier, later, self._memory)
