"""Functions of submodules that the documentation names."""

from functools import partial
from pathlib import Path

import numpy as np

from ankleloop import DataError, LongRecord, block_bootstrap, identify, load_estimate, subspace
from ankleloop.assessment.cramer_rao import fisher_information
from ankleloop.assessment.residuals import residual_test
from ankleloop.assessment.scores import in_band_snr, summarise
from ankleloop.joint.basis import fit_basis
from ankleloop.joint.estimate_files import load_estimates, load_estimates_of, save_estimates
from ankleloop.joint.prepared import prepare
from ankleloop.methods.selection import select_options
from ankleloop.recordings.analysis import analyse
from ankleloop.recordings.export import export_estimate
from ankleloop.recordings.files import load_recording
from ankleloop.signals.decimation import decimation_factor
from ankleloop.signals.differentiation import differentiate
from ankleloop.signals.vaf import vaf_interval
from ankleloop.simulation.simulate import simulate_trials
from bad_inputs.bad_input import BadInput
from bad_inputs.inputs import (
    POSITION,
    TORQUE,
    changed,
    cut_off,
    fitted_estimate,
    hdf5_file,
    mat_file,
    missing,
    short_trial,
    simulated_trial,
    text_file,
    trial_file,
)

TITLE = "Functions of submodules"


def row(wrong, call, *says, make=lambda folder: None, error=DataError, shown=None, **outcome) -> BadInput:
    """A row of a call that takes what `make` returns."""
    return BadInput(wrong, make, call, says, error=error, shown=shown, **outcome)


def _a_trial(folder):
    return simulated_trial()


def _longer_trial(folder):
    return simulated_trial(duration=30.0)


def _rows_of_signals() -> list[BadInput]:
    return [
        row(
            "rates that do not divide",
            lambda _: decimation_factor(1000.0, 70.0),
            "not a whole multiple",
            "choose an identification_rate that divides it",
            shown="decimation_factor",
        ),
        row(
            "a rate of nan",
            lambda _: decimation_factor(1000.0, float("nan")),
            "identification_rate must be a finite number",
            "got nan",
            error=ValueError,
            shown="decimation_factor",
        ),
        row(
            "a velocity of two samples",
            lambda _: differentiate(POSITION[:2], 500.0),
            "a record of 2 samples is too short to differentiate",
            shown="differentiate",
        ),
        row(
            "signals of two lengths",
            lambda _: vaf_interval(TORQUE, TORQUE[1:], 10),
            "(300,)",
            "(299,)",
            shown="vaf_interval",
        ),
        row(
            "a residual with nan",
            lambda _: residual_test(changed(TORQUE, 7, np.nan), TORQUE, 100.0),
            "sample 7 of the residual is not finite",
            shown="residual_test",
        ),
        row(
            "a residual that is constant",
            lambda _: residual_test(np.ones(300), TORQUE, 100.0),
            "the residual is constant",
            shown="residual_test",
        ),
        row(
            "a residual and a signal of two lengths",
            lambda _: residual_test(TORQUE, TORQUE[1:], 100.0),
            "300 samples",
            "299",
            "pass equal lengths",
            shown="residual_test",
        ),
        row(
            "a residual of half a second",
            lambda _: residual_test(TORQUE[:50], POSITION[:50], 100.0),
            "0.5 s have 19 frequencies in the pass band",
            "use a longer record",
            shown="residual_test",
        ),
        row(
            "an unknown basis",
            lambda _: fit_basis(POSITION, "relu", 5),
            "unknown basis 'relu'; known:",
            error=ValueError,
            shown="fit_basis",
        ),
        row(
            "a basis of degree 2.5",
            lambda _: fit_basis(POSITION, "chebyshev", 2.5),
            "degree must be a whole number",
            error=ValueError,
            shown="fit_basis",
        ),
        row(
            "a basis of a velocity of zero",
            lambda _: fit_basis(np.zeros(300), "chebyshev", 5),
            "the velocity is zero throughout",
            shown="fit_basis",
        ),
        row(
            "a spline of three values of the velocity",
            lambda _: fit_basis(np.repeat([-1.0, 0.0, 1.0], 100), "spline", 8),
            "dwells on too few values",
            "use fewer terms or a rectifier",
            shown="fit_basis",
        ),
    ]


def _rows_of_identification() -> list[BadInput]:
    pieces = partial(subspace.moesp_chunks, block_rows=8, order=1, instruments="past-input")
    fit = partial(identify, method="pr-moesp")
    return [
        row(
            "a number in place of a trial",
            lambda _: prepare(1.0),
            "a trial is an xarray.Dataset, not float",
            shown="prepare",
        ),
        row("no chunks", lambda _: pieces(lambda: iter([])), "the record has no chunks", shown="subspace.moesp_chunks"),
        row(
            "a chunk with nan",
            lambda _: pieces(lambda: iter([(changed(TORQUE, 9, np.nan)[:, None], TORQUE[:, None], None)])),
            "not finite",
            "9",
            shown="subspace.moesp_chunks",
        ),
        row(
            "a single fold",
            lambda trial: select_options(trial, fit, {"order": [1, 2]}, folds=1),
            "folds must be between 2 and 100, got 1",
            make=_a_trial,
            error=ValueError,
            shown="select_options",
        ),
        row(
            "candidates at several rates",
            lambda trial: select_options(trial, fit, {"identification_rate": [50.0, 100.0]}),
            "identification_rate cannot be selected",
            make=_a_trial,
            error=ValueError,
            shown="select_options",
        ),
        row(
            "folds shorter than a selection needs",
            lambda trial: select_options(trial, fit, {"order": [1, 2]}),
            "makes 2 folds",
            "use a longer record",
            make=lambda folder: simulated_trial(duration=6.0),
            shown="select_options",
        ),
        row(
            "an analysis by an unknown method",
            lambda trial: analyse(trial, {"a": {"method": "pr-moes"}}),
            "unknown method 'pr-moes'",
            make=_a_trial,
            error=ValueError,
            shown="analyse",
        ),
        row(
            "no seeds",
            lambda _: next(simulate_trials([None], duration=2.0)),
            "seed must be",
            "got None",
            error=ValueError,
            shown="simulate_trials",
        ),
        row(
            "information without a seed",
            lambda _: fisher_information(),
            "seed",
            error=TypeError,
            shown="fisher_information",
        ),
        row(
            "a level of 1",
            lambda trial: _bootstrap(trial).intervals(1.0),
            "level must be above 0 and below 1, got 1.0",
            make=_longer_trial,
            error=ValueError,
            shown="Bootstrap.intervals",
        ),
        row(
            "a level that too few samples allow",
            lambda trial: _bootstrap(trial).intervals(0.95),
            "needs at least 40 samples",
            "repeat more often",
            make=_longer_trial,
            error=ValueError,
            shown="Bootstrap.intervals",
        ),
        row(
            "a prediction by a method without a model",
            lambda trial: fitted_estimate("real-time").predict(trial),
            "real-time has no fixed model to predict with",
            make=_a_trial,
            shown="Estimate.predict",
        ),
        row(
            "a prediction of a short trial",
            lambda trial: fitted_estimate().predict(trial),
            "too short",
            make=lambda folder: short_trial(),
            shown="Estimate.predict",
        ),
        row(
            "a prediction of a slow record",
            lambda trial: fitted_estimate().predict(trial),
            "the sampling rate (50 Hz) is not a whole multiple of the identification rate (100 Hz)",
            make=lambda folder: short_trial(sampling_rate=50.0),
            shown="Estimate.predict",
        ),
        row(
            "the SNR of a recording",
            lambda trial: in_band_snr(trial, fitted_estimate()),
            "an in-band SNR needs the truths of a simulation",
            make=lambda folder: simulated_trial().drop_vars("torque_noise"),
            shown="in_band_snr",
        ),
        row(
            "a summary by a column that is not there",
            lambda trial: summarise(_scores(trial), ["metod"]),
            "by must be a list of columns of the scores",
            "metod",
            make=_a_trial,
            error=ValueError,
            shown="summarise",
        ),
    ]


def _bootstrap(trial):
    return block_bootstrap(trial, "pi-moesp", repetitions=2, basis="rectifier")


def _scores(trial):
    from ankleloop import evaluate

    return evaluate(trial, fitted_estimate())


def _estimates_file(folder: Path) -> Path:
    from ankleloop.joint.estimate_files import EstimateCollection

    collection = EstimateCollection()
    collection.add(fitted_estimate(), "only", 0)
    save_estimates({"a": collection}, folder / "0.nc")
    return folder / "0.nc"


def _rows_of_files() -> list[BadInput]:
    return [
        row(
            "estimates: there is no file",
            lambda path: load_estimates(path, "a"),
            "0.nc: there is no such file",
            make=missing("0.nc"),
            shown="load_estimates",
        ),
        row(
            "estimates: the file is cut off",
            lambda path: load_estimates(path, "a"),
            "0.nc",
            "damaged",
            make=cut_off(_estimates_file),
            shown="load_estimates",
        ),
        row(
            "estimates: a trial",
            lambda path: load_estimates(path, "a"),
            "0.nc",
            make=trial_file("0.nc"),
            shown="load_estimates",
        ),
        row(
            "estimates: no such method",
            lambda path: load_estimates(path, "b"),
            "0.nc",
            "'b'",
            make=_estimates_file,
            shown="load_estimates",
        ),
        row(
            "estimates: no such point",
            lambda path: load_estimates_of([path], "gain=9", "a"),
            "'gain=9'",
            make=_estimates_file,
            shown="load_estimates_of",
        ),
        row(
            "estimates over another file",
            lambda path: save_estimates({}, path),
            "0.nc",
            "the file exists already",
            make=text_file("0.nc", "irreplaceable"),
            shown="save_estimates",
        ),
        row(
            "an export over another file",
            lambda path: export_estimate(fitted_estimate(), path),
            "e.mat",
            "the file exists already",
            make=text_file("e.mat", "irreplaceable"),
            shown="export_estimate",
        ),
        row(
            "an export with an unknown suffix",
            lambda path: export_estimate(fitted_estimate(), path),
            "e.txt",
            ".mat",
            make=missing("e.txt"),
            shown="export_estimate",
        ),
        row(
            "an export that is loaded as an estimate",
            load_estimate,
            "e.mat",
            make=mat_file("e.mat"),
            shown="load_estimate",
        ),
        row(
            "a recording whose part has no samples",
            lambda path: load_recording(path, {"file": "a.mat", "start": 5.0, "stop": 9.0}),
            "a.mat: the segment from 5 to 9 s has no samples",
            "the trial covers 0 to 0.598 s",
            make=mat_file(),
            shown="load_recording",
        ),
        row(
            "a piece behind the end of a record",
            lambda path: LongRecord(path, 500.0, reference=None).read(400, 500),
            "a.h5: there are no samples 400 to 500",
            "the record has 300 samples",
            make=hdf5_file(),
            error=ValueError,
            shown="LongRecord.read",
        ),
        row(
            "a piece of a channel that is not read",
            lambda path: LongRecord(path, 500.0, reference=None).read(0, 9, ["reference"]),
            "a.h5: the record has no channel 'reference'; it has position, torque",
            make=hdf5_file(),
            error=ValueError,
            shown="LongRecord.read",
        ),
    ]


ROWS = [*_rows_of_signals(), *_rows_of_identification(), *_rows_of_files()]
