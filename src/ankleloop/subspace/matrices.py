"""A state-space model as arrays, and on request as an object of the control library."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from control import StateSpace


@dataclass(frozen=True)
class Matrices:
    """Matrices of x(t+1) = A x(t) + B u(t), y(t) = C x(t) + D u(t)."""

    A: np.ndarray  # shape (n, n)
    B: np.ndarray  # shape (n, m)
    C: np.ndarray  # shape (p, n)
    D: np.ndarray  # shape (p, m)
    dt: float = 1.0  # sampling interval [s]
    names: tuple[Sequence[str], Sequence[str]] | None = None  # names of inputs and outputs
    # Time by which each input is behind the signal of its name [s]. It is no part of A, B, C, D: u(t) is delayed
    # already.
    input_delays: Sequence[float] | None = None

    def select_inputs(self, inputs: np.ndarray) -> Matrices:
        """The model with some of its inputs only.

        Shapes: inputs (m,), of flags.
        """
        names = (
            None if self.names is None else (tuple(compress(self.names[0], inputs)), self.names[1])
        )
        delays = None if self.input_delays is None else tuple(compress(self.input_delays, inputs))
        return Matrices(
            self.A, self.B[:, inputs], self.C, self.D[:, inputs], self.dt, names, delays
        )

    def frequency_response(self, z: np.ndarray) -> np.ndarray:
        """Response of the first output to each input.

        Shapes: z (F,); returns (F, m).
        """
        shifted = z[:, None, None] * np.eye(len(self.A)) - self.A
        row = np.broadcast_to(self.C[0][:, None], (z.size, len(self.A), 1))
        rows = np.linalg.solve(np.swapaxes(shifted, 1, 2), row)  # C (z - A)⁻¹
        return rows[..., 0] @ self.B + self.D[0]

    def state_space(self) -> StateSpace:
        """The model as an object that simulates, plots and connects."""
        from control import (
            StateSpace,
        )  # here, because importing it takes longer than an identification

        inputs, outputs = self.names if self.names is not None else (None, None)
        matrices = (self.A, self.B, self.C, self.D)
        return StateSpace(
            *matrices, self.dt, inputs=inputs, outputs=outputs, remove_useless_states=False
        )
