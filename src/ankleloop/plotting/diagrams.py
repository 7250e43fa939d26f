"""Block diagrams of the joint, and of the joint with its load in closed loop (Figures 1 and 2 of the paper)."""

from __future__ import annotations

from typing import Any

import matplotlib
from matplotlib.patches import Circle, Rectangle

from ankleloop.plotting.style import STYLE, TWO_COLUMNS, DataFigure, inches

INK = "#222222"
HEIGHT = 0.56  # of a block
RADIUS = 0.13  # of a summing point
SHADE = "#eeeeee"  # of blocks outside the joint

Point = tuple[float, float]


class _Diagram:
    """A drawing of blocks, summing points and wires on a canvas with units of its own, two columns wide in print."""

    def __init__(self, width: float, height: float) -> None:
        size = inches(TWO_COLUMNS)
        self.figure = DataFigure(figsize=(size, size * height / width))
        self.axis = self.figure.add_axes((0, 0, 1, 1))
        self.axis.set(xlim=(0, width), ylim=(0, height), aspect="equal")
        self.axis.set_axis_off()

    def block(
        self, x: float, y: float, text: str, *, width: float = 1.0, height: float = HEIGHT, shade: str = "white"
    ) -> None:
        """A block with its text, centred at x and y."""
        corner = (x - width / 2, y - height / 2)
        self.axis.add_patch(Rectangle(corner, width, height, fc=shade, ec=INK, lw=1.0, zorder=2))
        self.axis.text(x, y, text, ha="center", va="center", color=INK, zorder=3)

    def sum(self, x: float, y: float, **signs: str) -> None:
        """A summing point; signs by side: left, right, above, below."""
        self.axis.add_patch(Circle((x, y), RADIUS, fc="white", ec=INK, lw=1.0, zorder=2))
        offsets = {"left": (-0.24, 0.11), "right": (0.24, 0.11), "above": (0.11, 0.23), "below": (0.11, -0.23)}
        for side, sign in signs.items():
            dx, dy = offsets[side]
            self.text(x + dx, y + dy, sign, size=8)

    def wire(self, *corners: Point, arrow: bool = True) -> None:
        """A wire through its corners, with an arrow at the last one."""
        x, y = zip(*corners, strict=True)
        self.axis.plot(x, y, color=INK, lw=1.0, solid_capstyle="butt", solid_joinstyle="miter", zorder=1)
        if arrow:
            style = {"arrowstyle": "-|>,head_width=0.16,head_length=0.32", "color": INK, "lw": 1.0}
            self.axis.annotate("", corners[-1], corners[-2], arrowprops={**style, "shrinkA": 0, "shrinkB": 0})

    def branch(self, x: float, y: float) -> None:
        """A point at which a wire divides."""
        self.axis.plot([x], [y], "o", color=INK, ms=3.2, zorder=2)

    def text(self, x: float, y: float, text: str, *, size: float = 7.0, **properties: Any) -> None:
        """A text, centred at x and y unless its properties say otherwise."""
        self.axis.text(x, y, text, **{"ha": "center", "va": "center", "color": INK, "fontsize": size, **properties})

    def rectifier(self, x: float, y: float) -> None:
        """A block with the curve of the static nonlinearity."""
        self.block(x, y, "", width=0.62)
        self.axis.plot([x - 0.2, x + 0.2], [y - 0.1, y - 0.1], color="#999999", lw=0.6, zorder=3)
        self.axis.plot([x, x], [y - 0.18, y + 0.2], color="#999999", lw=0.6, zorder=3)
        self.axis.plot([x - 0.2, x, x + 0.2], [y - 0.1, y - 0.1, y + 0.18], color=INK, lw=1.3, zorder=4)


def _draw_joint(diagram: _Diagram, left: float, upper: float, lower: float) -> tuple[Point, Point]:
    """Draw the intrinsic path above the reflex path, from the branch at `left`; returns the ends of both paths."""
    middle = (upper + lower) / 2
    diagram.branch(left, middle)
    diagram.block(left + 2.3, upper, r"$K + Bs + Is^2$", width=1.5)
    diagram.text(left + 2.3, upper + 0.42, "intrinsic stiffness")
    diagram.wire((left, middle), (left, upper), (left + 1.55, upper))
    diagram.wire((left, middle), (left, lower), (left + 0.3, lower))
    diagram.block(left + 0.55, lower, "$s$", width=0.5)
    diagram.wire((left + 0.8, lower), (left + 1.05, lower))
    diagram.block(left + 1.35, lower, r"$e^{-s\tau}$", width=0.6)
    diagram.wire((left + 1.65, lower), (left + 1.9, lower))
    diagram.rectifier(left + 2.21, lower)
    diagram.wire((left + 2.52, lower), (left + 2.77, lower))
    diagram.block(
        left + 3.5, lower, r"$\dfrac{G\omega_n^2}{s^2 + 2\zeta\omega_n s + \omega_n^2}$", width=1.46, height=0.7
    )
    diagram.text(left + 2.3, lower - 0.5, "reflex stiffness: delay, static nonlinearity, linear dynamics")
    return (left + 3.05, upper), (left + 4.23, lower)


@matplotlib.rc_context(STYLE)
def parallel_cascade_diagram() -> DataFigure:
    r"""Draw the parallel cascade of intrinsic and reflex stiffness, Figure 1 of the paper.

    Returns
    -------
    DataFigure
        Joint position θ in [rad], torques in [N·m].

    Examples
    --------
    >>> parallel_cascade_diagram().get_size_inches().round(1).tolist()
    [7.1, 2.7]
    """
    diagram = _Diagram(6.6, 2.5)
    upper, lower, middle = 1.85, 0.85, 1.35
    intrinsic, reflex = _draw_joint(diagram, 0.7, upper, lower)
    diagram.wire((0.15, middle), (0.7, middle), arrow=False)
    diagram.text(0.3, middle + 0.16, r"$\theta$ [rad]")
    x = 5.4
    diagram.sum(x, middle, above="+", below="+")
    diagram.wire(intrinsic, (x, upper), (x, middle + RADIUS))
    diagram.wire(reflex, (x, lower), (x, middle - RADIUS))
    diagram.text(4.55, upper + 0.16, r"$TQ_I$ [N·m]")
    diagram.text(x + 0.1, lower, r"$TQ_R$ [N·m]", ha="left")
    diagram.wire((x + RADIUS, middle), (6.45, middle))
    diagram.text(6.05, middle + 0.16, r"$TQ$ [N·m]")
    return diagram.figure


@matplotlib.rc_context(STYLE)
def closed_loop_diagram() -> DataFigure:
    r"""Draw the joint and its load in closed loop, Figure 2 of the paper.

    Returns
    -------
    DataFigure
        The reference INP passes the actuator; all torque that acts on the load, voluntary torque and noise included,
        moves the joint back through the admittance of the load.

    Examples
    --------
    >>> closed_loop_diagram().get_size_inches().round(1).tolist()
    [7.1, 3.0]
    """
    diagram = _Diagram(8.6, 3.6)
    upper, lower, middle, feedback = 2.9, 1.9, 2.4, 0.6
    diagram.text(0.38, middle + 0.17, "INP [rad]")
    diagram.wire((0.1, middle), (0.72, middle))
    diagram.block(1.17, middle, "actuator", width=0.9, shade=SHADE)
    diagram.wire((1.62, middle), (2.0, middle))
    diagram.sum(2.13, middle, left="+", below="−")
    diagram.wire((2.26, middle), (2.85, middle), arrow=False)
    diagram.text(2.55, middle + 0.17, r"$\theta$ [rad]")
    intrinsic, reflex = _draw_joint(diagram, 2.85, upper, lower)
    _draw_torque_sum(diagram, intrinsic, reflex, (upper, middle, lower))
    diagram.branch(8.05, middle)
    diagram.wire((8.05, middle), (8.05, feedback), (5.95, feedback))
    load = r"$H_{imp} = \dfrac{1}{I_L s^2 + B_L s + K_L}$"
    diagram.block(4.95, feedback, load, width=2.0, height=0.7, shade=SHADE)
    diagram.text(4.95, feedback - 0.47, "impedance controller: the load")
    diagram.wire((3.95, feedback), (2.13, feedback), (2.13, middle - RADIUS))
    return diagram.figure


def _draw_torque_sum(diagram: _Diagram, intrinsic: Point, reflex: Point, heights: tuple[float, float, float]) -> None:
    """Draw the sum of the torques of both paths, of voluntary torque and of noise."""
    upper, middle, lower = heights
    x = 7.35
    diagram.sum(x, middle, above="+", below="+", left="+")
    diagram.wire(intrinsic, (x, upper), (x, middle + RADIUS))
    diagram.wire(reflex, (x, lower), (x, middle - RADIUS))
    diagram.text(6.6, upper + 0.16, r"$TQ_I$")
    diagram.text(x + 0.1, lower, r"$TQ_R$", ha="left")
    diagram.wire((6.85, middle), (x - RADIUS, middle))
    diagram.text(6.8, middle, "voluntary\ntorque, noise", ha="right")
    diagram.wire((x + RADIUS, middle), (8.5, middle))
    diagram.text(8.2, middle + 0.17, "TQ [N·m]")
