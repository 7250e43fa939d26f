"""A state-space model as arrays, and as an object of the control library when it is asked for."""

from dataclasses import dataclass

import numpy as np

__all__ = ["Matrices"]


@dataclass(frozen=True)
class Matrices:
    """Matrices of x(t+1) = A x(t) + B u(t), y(t) = C x(t) + D u(t).

    Parameters
    ----------
    A, B, C, D : ndarray, shape (n, n), (n, m), (p, n), (p, m)
        The matrices.
    dt : float
        Sampling interval [s].
    names : tuple of two sequences of str, optional
        Names of inputs and outputs.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    dt: float = 1.0
    names: tuple | None = None

    def of_inputs(self, used):
        """The model from some of its inputs only; `used` is a mask or indices."""
        return Matrices(self.A, self.B[:, used], self.C, self.D[:, used], self.dt)

    def frequency_response(self, z):
        """Response of the first output to each input.

        Parameters
        ----------
        z : ndarray of complex, shape (F,)
            Points of the z-plane, exp(iω dt).

        Returns
        -------
        ndarray of complex, shape (F, m)

        Examples
        --------
        >>> one = np.eye(1)
        >>> Matrices(0.5 * one, one, one, 0 * one).frequency_response(np.ones(1)).real.tolist()
        [[2.0]]
        """
        shifted = z[:, None, None] * np.eye(len(self.A)) - self.A
        row = np.broadcast_to(self.C[0][:, None], (z.size, len(self.A), 1))
        left = np.linalg.solve(np.swapaxes(shifted, 1, 2), row)
        return left[..., 0] @ self.B + self.D[0]

    def state_space(self):
        """The same as an object that simulates, plots and connects.

        Returns
        -------
        control.StateSpace

        Examples
        --------
        >>> one = np.eye(1)
        >>> Matrices(0.5 * one, one, one, 0 * one, dt=0.01).state_space().poles().tolist()
        [(0.5+0j)]
        """
        from control import StateSpace  # here, because importing it takes longer than an identification

        inputs, outputs = self.names if self.names is not None else (None, None)
        matrices = (self.A, self.B, self.C, self.D)
        return StateSpace(*matrices, self.dt, inputs=inputs, outputs=outputs, remove_useless_states=False)
