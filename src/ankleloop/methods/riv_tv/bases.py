"""Splines of K, B, I and G, and where their coefficients stand among the linear parameters."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ankleloop.joint.time_varying_course import Course, Splines
from ankleloop.methods.riv_tv.options import RivTvOptions


class Bases:
    """Splines by the name of the parameter; a single one is a constant.

    The order of the names is that of the linear parameters: the intrinsic path comes first, as in `Parameters`.
    """

    def __init__(self, options: RivTvOptions, course: Course) -> None:
        stiffness, viscosity, gain = options.knots
        counts = {"K": stiffness, "B": viscosity, "I": options.inertia_knots, "G": gain}
        degree = 3 if options.interpolation == "cubic" else 0
        self.size = 0  # number of linear parameters
        self.splines: dict[str, Splines] = {}
        self.blocks: dict[str, slice] = {}
        # Values at all samples, shapes (splines, N).
        self.values: dict[str, np.ndarray] = {}
        # Weights of the coefficients in the mean over the record, shapes (splines,).
        self.mean_weights: dict[str, np.ndarray] = {}
        for name, count in counts.items():
            self.splines[name] = Splines(count, course.periodic, degree if count > 1 else 0)
            self.blocks[name] = slice(self.size, self.size + count)
            self.values[name] = self.splines[name](course.place).T
            self.mean_weights[name] = self.values[name][:, course.rows].mean(axis=1)
            self.size += count

    @property
    def trajectories(self) -> list[str]:
        """Names of the parameters that have a trajectory: an inertia has one where it has several splines."""
        return [name for name in self.splines if name != "I" or self.splines[name].size > 1]

    def means(self, linear: np.ndarray) -> dict[str, float]:
        """Means of K, B, I and G over the record.

        Shapes: linear (parameters,).
        """
        return {
            name: float(weights @ linear[self.blocks[name]])
            for name, weights in self.mean_weights.items()
        }

    def penalty(self, weights: Mapping[str, float], unknowns: int) -> np.ndarray:
        """Weighted sum of the penalties, shape (unknowns, unknowns)."""
        matrix = np.zeros((unknowns, unknowns))
        for name, block in self.blocks.items():
            matrix[block, block] = weights[name] * self.splines[name].penalty
        return matrix
