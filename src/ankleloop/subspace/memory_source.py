"""Data of an identification from records in memory."""

from __future__ import annotations

from functools import cached_property, reduce
from operator import add
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ankleloop.errors import DataError
from ankleloop.subspace.gram_projection import expect_accuracy
from ankleloop.subspace.hankel_factor import combine_factors
from ankleloop.subspace.hankel_rows import HankelRows
from ankleloop.subspace.input_matrices import InputMatrices, OutputRegression, solve_regression
from ankleloop.subspace.instruments import predict_from_reference
from ankleloop.subspace.options import MemoryOptions
from ankleloop.subspace.records import are_merged, list_records, remove_means, scale_records

__all__ = ["MemorySource"]

SMALL = 150_000  # products: a factor of so few takes no longer than their inner products


class MemorySource:
    """One record or merged records: each channel without its mean over each record, of unit variance over all records.

    Parameters
    ----------
    u, y, reference, dynamic, predicted_inputs
        As `ankleloop.subspace.moesp.moesp` takes them.
    options : MemoryOptions
        Options of the identification.

    Raises
    ------
    DataError
        If records differ in length, or a channel is constant or not finite.
    """

    def __init__(
        self, u: Any, y: Any, reference: Any, dynamic: ArrayLike | None, predicted_inputs: Any, options: MemoryOptions
    ) -> None:
        self.options, self.dynamic, self.predicted_inputs = options, dynamic, predicted_inputs
        self.input_matrices: str = options.input_matrices
        self.merged = are_merged(u)
        inputs, outputs = list_records(u, self.merged, "input"), list_records(y, self.merged, "output")
        references = None if reference is None else list_records(reference, self.merged, "reference")
        if predicted_inputs is not None and options.input_matrices != "instruments":
            raise ValueError(
                "predicted_inputs are instruments for B and D: use input_matrices='instruments' with them."
            )
        _check_lengths(inputs, outputs, "output")
        self.inputs, u_scale = self._scale(inputs, "input")
        self.outputs, y_scale = self._scale(outputs, "output")
        self.scales = u_scale, y_scale
        self.open_loop, self._references = False, references
        if references is not None:
            _check_lengths(inputs, references, "reference")
            self.open_loop = options.instruments == "past-reference" and all(map(np.array_equal, references, inputs))

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Numbers of inputs, outputs and references."""
        references = self._references[0].shape[1] if self._references else 0
        return self.inputs[0].shape[1], self.outputs[0].shape[1], references

    @cached_property
    def references(self) -> list[np.ndarray]:
        """Reference of each record, scaled; of no records where there is none."""
        if self._references is None or self.open_loop:
            return self.inputs if self.open_loop else []
        return self._scale(self._references, "reference")[0]

    def compute_gram(self, rows: HankelRows) -> tuple[np.ndarray | None, int]:
        """Inner products of the Hankel rows, None if the options exclude them; and the number of columns."""
        columns = rows.count_columns([len(record) for record in self.inputs])
        small = rows.count_products(rows.channels, columns) < SMALL
        if small or self.options.compression == "qr" or not self.options.offsets or self._is_narrow_band(rows):
            return None, columns
        records = self._stack_channels(rows)
        grams = [rows.start_gram(record.shape[1]) for record in records]
        for gram, record in zip(grams, records, strict=True):
            gram.add(record)
        indices = rows.list_indices(records[0].shape[1])
        return reduce(add, (gram.matrix(indices) for gram in grams)), columns

    def factor_rows(self, rows: HankelRows) -> np.ndarray:
        """Triangular factor of the Hankel rows, each less its mean over each record unless the options keep means.

        With instruments only the rows of inputs and instruments: the projection takes no others.
        """
        records = self._stack_channels(rows)
        channels = records[0].shape[1]
        factors = [rows.start_factor(channels, subtract_means=self.options.offsets) for _ in records]
        for factor, record in zip(factors, records, strict=True):
            factor.add(record)
        indices = rows.list_indices(channels)
        count = sum(rows.sizes) if rows.sizes[1] and len(factors) == 1 else None
        return combine_factors([factor.matrix(indices, count) for factor in factors])

    def estimate_input_matrices(self, A: np.ndarray, C: np.ndarray) -> InputMatrices:
        """B, D and initial states; with instruments, from inputs that the reference predicts."""
        predicted = self._predict_inputs() if self.input_matrices == "instruments" else None
        regression = OutputRegression(A, C, self.sizes[0], self.dynamic, offsets=self.options.offsets)
        return solve_regression(regression, self.inputs, self.outputs, predicted, self.options.regression_tolerance)

    def _scale(self, records: list[np.ndarray], name: str) -> tuple[list[np.ndarray], np.ndarray]:
        """Records without their means, of unit variance; and the number by which each channel was divided."""
        return scale_records(records, name, scaling=self.options.scaling, subtract_means=self.options.offsets)

    def _is_narrow_band(self, rows: HankelRows) -> bool:
        """Whether the inputs show that inner products will not be accurate enough."""
        if self.options.projection == "correlation":
            return False
        inputs = next(record for record in self.inputs if len(record) >= rows.window)
        return not expect_accuracy(inputs, rows.window, self.options.rank_tolerance)

    def _stack_channels(self, rows: HankelRows) -> list[np.ndarray]:
        """Records of inputs and outputs side by side, and of the reference where the instruments consist of it."""
        signals = [self.inputs, self.outputs]
        if rows.channels > rows.inputs + rows.outputs:
            signals.append(self.references)
        return [np.concatenate(parts, axis=1) for parts in zip(*signals, strict=True) if len(parts[0]) >= rows.window]

    def _predict_inputs(self) -> list[np.ndarray]:
        """Noise-free predictions of the inputs, in their scale."""
        if self.predicted_inputs is not None:
            predicted = list_records(self.predicted_inputs, self.merged, "predicted_inputs")
            _check_lengths(self.inputs, predicted, "predicted_inputs")
            if predicted[0].shape[1] != self.sizes[0]:
                raise DataError(
                    f"{self.sizes[0]} inputs, {predicted[0].shape[1]} predicted_inputs: pass a prediction of each."
                )
            predicted = remove_means(predicted) if self.options.offsets else predicted
            return [record / self.scales[0] for record in predicted]
        if not self.references:
            raise DataError("input_matrices='instruments' needs a reference: pass the external command of the loop.")
        return predict_from_reference(self.inputs, self.references)


def _check_lengths(inputs: list[np.ndarray], others: list[np.ndarray], name: str) -> None:
    """Refuse signals whose records do not have the lengths of the inputs."""
    if len(others) != len(inputs):
        raise DataError(f"{len(inputs)} records of inputs, {len(others)} of the {name}: give one for each.")
    for k, (u, other) in enumerate(zip(inputs, others, strict=True)):
        if len(other) != len(u):
            number = f" in record {k}" if len(inputs) > 1 else ""
            raise DataError(f"{len(u)} samples of inputs, {len(other)} of the {name}{number}: cut them to one length.")
