"""Search for the solution of the equations of refined instrumental variables, by steps that never go back.

Begin at `solve`. A `Search` makes a `Point` of `Equations` at some parameters, takes from it the left side and its
slope, steps to other parameters, and makes the next one; `Equations` and `Point` know nothing of a search.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ankleloop.methods.riv.covariance import parameter_rows
from ankleloop.methods.riv.equations import Equations, Parameters, Point
from ankleloop.signals.least_squares import solve_scaled

# of a logarithm, or s, in one iteration
LARGEST_STEPS = {"omega_n": 0.4, "zeta": 0.4, "pole": 0.4, "delay": 0.01}
MOST_ITERATIONS = 50
TOLERANCE = 0.01  # standard errors: the search ends when no parameter moves by more
LEAST_GAIN = 1e-3  # relative, of the merit; and of the misfit
MOST_REFINEMENTS = 10  # iterations without second derivatives
SOLVED = 10.0  # tolerances: largest left side of a solution, over its standard deviation
NEARLY_ZERO = 3.0  # standard errors
# In units of the information of the instruments:
LEAST_DAMPING = 0.02
MOST_DAMPING = 1e6
FLAT = 1e-9  # slope in a direction that the record does not show


def solve(equations: Equations, start: Parameters) -> Search:
    r"""Solve the equations from a start.

    Weights and instruments belong to the parameters, so the left side g(θ) is a function of the parameters alone, and
    its size is a merit, q(θ) = gᵀ S⁻¹ g with its covariance S.

    The first iterations are those of refined instrumental variables: a step solves the equations with the weights and
    instruments of the point where it begins, and has to lower the size of their left side. Where the model holds they
    converge fast. Where they have not converged, the search begins again at the best of their points: in open loop g is
    the slope of a criterion, the misfit (the sum of squares, or the likelihood of a residual of unknown spectrum), and
    a step is accepted if no earlier point has both a smaller merit and a smaller misfit (a filter: Fletcher and
    Leyffer, Mathematical Programming 91, 239-269, 2002). So the search neither returns to where it was nor ends worse
    than it began, and it can leave a saddle point of the misfit, where the merit alone would hold it. Steps are those
    of Newton where the slope of g, with that of weights and instruments, is positive; elsewhere they are damped, along
    the directions of its symmetric part. A third pole or a delay that reaches its limit is held there. Of a search that
    does not converge, the point with the smallest merit is returned.
    """
    search = Search(equations, start)
    points = search.points
    while len(points) <= MOST_REFINEMENTS and not search.finished and search.refine():
        pass
    if not search.finished:
        search.first = len(points)
        search.accept(points[int(np.argmin(search.merits))])
    while len(points) <= MOST_ITERATIONS and not search.finished and search.advance():
        if search.point.pole_out_of_band:
            break
    if not search.finished:
        search.point = min(points, key=lambda point: point.merit(search.free))
    return search


class Search:
    """A search and its result."""

    def __init__(self, equations: Equations, start: Parameters) -> None:
        self.equations = equations
        self.points: list[Point] = []  # the start, and the point after each iteration
        self.merits: list[float] = []  # merit of each of them
        # Number of the first point of the filter: the last change of what is held, or where the search began again.
        self.first = 0
        self.held: set[str] = set()  # names of the unknowns that are held at a limit
        self.damping = 0.0
        self.finished = False  # whether the last step was within the tolerance
        self.accept(Point(equations, start))

    @property
    def converged(self) -> bool:
        """Whether the search has finished, and no delay is held at its limit."""
        return self.finished and "delay" not in self.held

    @property
    def values(self) -> dict[str, float]:
        """Parameters by name; without a G that is that of no reflex or of no ramp."""
        values = self.point.values
        path = self.point.reflex_path
        if path.passive or path.fault:
            del values["G"]
        return values

    @cached_property
    def shown_values(self) -> dict[str, float]:
        """Parameters that are not nearly zero: a shift in relation to another one would say nothing."""
        errors = {name: np.sqrt(row @ self.covariance @ row) for name, row in self.rows.items()}
        return {
            name: value
            for name, value in self.values.items()
            if abs(value) > NEARLY_ZERO * errors.get(name, 0.0)
        }

    @cached_property
    def covariance(self) -> np.ndarray:
        """Covariance of the unknowns that are free at the result, where the model is complete, shape (free, free)."""
        return self.point.covariance(self.free)

    @cached_property
    def rows(self) -> dict[str, np.ndarray]:
        """Slopes of the parameters by the unknowns that are free at the result, shapes (free,)."""
        return parameter_rows(self.point, self.covariance, self.free)

    def error(self, unknown: str) -> float:
        """Standard error of an unknown behind the linear ones, free at the result, where the model is complete."""
        names = np.array(self.point.names)[self.free].tolist()
        place = names.index(unknown)
        return float(np.sqrt(self.covariance[place, place]))

    def accept(self, point: Point) -> None:
        """Add a point."""
        self.point = point  # the last one; of a search that has ended, its result
        # Unknowns that are not held.
        self.free = np.flatnonzero([name not in self.held for name in point.names])
        self.points.append(point)
        self.merits.append(point.merit(self.free))

    def refine(self) -> bool:
        """Solve the equations for the present weights and instruments; false if this does not lower their left side."""
        point = self.point
        step = self._full_step(point.normal)
        if self._end(step):
            return self.finished
        limited_step = step / max(1.0, self._length(step))
        candidate = Point(self.equations, point.parameters.add(limited_step))
        side = np.real(point.weighted @ candidate.residual)
        lowered = side @ solve_scaled(point.scatter, side) < self.merits[-1]
        _, at_limits = self.equations.hold_at_limits(candidate.parameters)
        if not lowered or at_limits or candidate.pole_out_of_band:
            return False
        self.accept(candidate)
        return True

    def advance(self) -> bool:
        """Take a step that no earlier point makes useless, damped as much as it needs; false if there is none."""
        directions, curvatures = self._directions()
        side = directions.T @ self.point.side
        while self.damping < MOST_DAMPING:
            if self.damping == 0.0 and curvatures[0] > FLAT:
                step = self._full_step(self.point.slope)
                if self._end(step):
                    return True
            else:
                slopes = np.maximum(np.abs(curvatures), LEAST_DAMPING)
                step = directions @ (side / (slopes + self.damping))
            if self._try(step):
                self.damping = 0.1 * self.damping if self.damping > LEAST_DAMPING else 0.0
                return True
            self.damping = max(3.0 * self.damping, LEAST_DAMPING)
        return False

    def _try(self, step: np.ndarray) -> bool:
        """Accept the point after a step if no earlier one has a smaller left side and misfit; hold what is at a limit.

        What is held changes the unknowns, and the filter begins again.
        """
        if self._length(step) > 1.0:
            return False
        parameters, held = self.equations.hold_at_limits(self.point.parameters.add(step))
        candidate = Point(self.equations, parameters)
        if not held <= self.held:
            self.held |= held
            self.first = len(self.points)
        merit = candidate.merit(self.free)
        filtered = slice(self.first, None)
        for point, smallest in zip(self.points[filtered], self.merits[filtered], strict=True):
            no_smaller = merit >= (1.0 - LEAST_GAIN) * smallest
            if no_smaller and candidate.misfit >= point.misfit - LEAST_GAIN:
                return False
        self.accept(candidate)
        return True

    def _full_step(self, slope: np.ndarray) -> np.ndarray:
        """Step of all unknowns that solves the equations if their slope is this one."""
        free = self.free
        step = np.zeros(len(self.point.names))
        step[free] = solve_scaled(slope[np.ix_(free, free)], self.point.side[free])
        return step

    def _end(self, step: np.ndarray) -> bool:
        """Whether a step solves the equations, and by less than the tolerance: the last one, if not at a saddle point.

        It is taken unless it is lost in rounding.
        """
        # Singular equations can have short steps.
        if self.merits[-1] > self.free.size * (SOLVED * TOLERANCE) ** 2:
            return False
        errors = np.sqrt(np.diag(self.point.covariance(self.free)))
        if not np.all(np.abs(step[self.free]) <= TOLERANCE * errors):
            return False
        # Where the misfit is not smallest the search goes on; in closed loop the equations are not its slope.
        if not self.equations.open_loop or self._directions()[1][0] > FLAT:
            candidate = Point(self.equations, self.point.parameters.add(step))
            lowered = candidate.merit(self.free) <= self.merits[-1]
            self.accept(candidate if lowered else self.point)
            self.finished = True
        return True

    def _length(self, step: np.ndarray) -> float:
        """Length of a step, in units of what one iteration may change of dynamics and delay."""
        parameters = self.point.parameters
        largest = np.array([LARGEST_STEPS[name] for name in parameters.unknowns])
        return float(np.max(np.abs(step[parameters.linear.size :]) / largest, initial=0.0))

    def _directions(self) -> tuple[np.ndarray, np.ndarray]:
        """Directions that are independent for slope and information, in units of the latter, and slopes along them.

        Shapes: returns (unknowns, free), (free,).
        """
        select = np.ix_(self.free, self.free)
        information = self.point.information[select]
        scale = 1.0 / np.sqrt(np.diag(information))
        values, vectors = np.linalg.eigh(scale[:, None] * information * scale)
        white = scale[:, None] * vectors / np.sqrt(np.maximum(values, 1e-12 * values[-1]))
        slope = self.point.slope[select]
        curvatures, rotation = np.linalg.eigh(0.5 * white.T @ (slope + slope.T) @ white)
        directions = np.zeros((len(self.point.names), self.free.size))
        directions[self.free] = white @ rotation
        return directions, curvatures
