"""A state-space model as arrays, and on request as an object of the control library."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
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

    def frequency_response(self, z: np.ndarray) -> np.ndarray:
        """Response of the first output to each input.

        Shapes: z (F,); returns (F, m).
        """
        transposed = z[:, None, None] * np.eye(len(self.A)) - self.A.T
        rows = np.linalg.solve(transposed, self.C[0])  # C (z - A)⁻¹
        return rows @ self.B + self.D[0]

    def state_space(self) -> StateSpace:
        """The model as an object that simulates, plots and connects."""
        # Here, because importing it takes longer than an identification.
        from control import StateSpace

        inputs, outputs = self.names or (None, None)
        return StateSpace(
            self.A,
            self.B,
            self.C,
            self.D,
            self.dt,
            inputs=inputs,
            outputs=outputs,
            remove_useless_states=False,
        )
