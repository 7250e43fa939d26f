"""A state-space model as arrays, and on request as an object of the control library."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
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
        names = self.names
        if names is not None:
            names = (tuple(compress(names[0], inputs)), names[1])
        delays = self.input_delays
        if delays is not None:
            delays = tuple(compress(delays, inputs))
        B = self.B[:, inputs]
        D = self.D[:, inputs]
        return replace(self, B=B, D=D, names=names, input_delays=delays)

    def frequency_response(self, z: np.ndarray) -> np.ndarray:
        """Response of the first output to each input.

        Shapes: z (F,); returns (F, m).
        """
        states = len(self.A)
        shifted = z[:, None, None] * np.eye(states) - self.A
        row = np.broadcast_to(self.C[0][:, None], (z.size, states, 1))
        rows = np.linalg.solve(np.swapaxes(shifted, 1, 2), row)  # C (z - A)⁻¹
        return rows[..., 0] @ self.B + self.D[0]

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
