"""Block diagrams of the joint, and of the joint with its load in closed loop (Figures 1 and 2 of the paper)."""

from __future__ import annotations

from typing import Any

import matplotlib
from matplotlib.patches import Circle, Rectangle

from ankleloop.plotting.style import STYLE, TWO_COLUMNS, DataFigure

INK = "#222222"
HEIGHT = 0.56  # of a block
RADIUS = 0.13  # of a summing point
SHADE = "#eeeeee"  # of blocks outside the joint
ARROW: dict[str, Any] = {"arrowstyle": "-|>,head_width=0.16,head_length=0.32", "color": INK, "lw": 1.0}
ARROW |= {"shrinkA": 0, "shrinkB": 0}

Point = tuple[float, float]


class _Diagram:
    """A drawing of blocks, summing points and wires on a canvas with units of its own, two columns wide in print."""

    def __init__(self, width: float, height: float) -> None:
        self.figure = DataFigure(figsize=(TWO_COLUMNS / 25.4, TWO_COLUMNS / 25.4 * height / width))
        self.axis = self.figure.add_axes((0, 0, 1, 1))
        self.axis.set(xlim=(0, width), ylim=(0, height), aspect="equal")
        self.axis.set_axis_off()

    def block(
        self, start: Point, x: float, text: str, *, width: float = 1.0, height: float = HEIGHT, shade: str = "white"
    ) -> Point:
        """A block centred at x, with its text and a wire to it; returns the end from which the next wire goes on."""
        y = start[1]
        side = width / 2 if start[0] < x else -width / 2
        self.wire(start, (x - side, y))
        corner = (x - width / 2, y - height / 2)
        self.axis.add_patch(Rectangle(corner, width, height, fc=shade, ec=INK, lw=1.0, zorder=2))
        self.axis.text(x, y, text, ha="center", va="center", color=INK, zorder=3)
        return x + side, y

    def sum(self, x: float, y: float, **signs: str) -> None:
        """A summing point; signs by side: left, right, above, below."""
        self.axis.add_patch(Circle((x, y), RADIUS, fc="white", ec=INK, lw=1.0, zorder=2))
        offsets = {"left": (-0.24, 0.11), "right": (0.24, 0.11), "above": (0.11, 0.23), "below": (0.11, -0.23)}
        for side, sign in signs.items():
            self.text(x + offsets[side][0], y + offsets[side][1], sign, size=8)

    def wire(self, *corners: Point, arrow: bool = True) -> None:
        """A wire through its corners, with an arrow at the last one."""
        self.axis.plot(*zip(*corners, strict=True), color=INK, lw=1.0, solid_joinstyle="miter", zorder=1)
        if arrow:
            self.axis.annotate("", corners[-1], corners[-2], arrowprops=ARROW)

    def branch(self, x: float, y: float) -> None:
        """A point at which a wire divides."""
        self.axis.plot([x], [y], "o", color=INK, ms=3.2, zorder=2)

    def text(self, x: float, y: float, text: str, *, size: float = 7.0, align: str = "center") -> None:
        """A text at x and y."""
        self.axis.text(x, y, text, ha=align, va="center", color=INK, fontsize=size)

    def joint(self, left: float, middle: float, end: float, *, loop: bool = False) -> float:
        """Both paths of the joint from the branch at `left`, and their sum; returns the place of the sum."""
        unit = "" if loop else " [N·m]"
        x = left + 4.6
        self.wire((left - 0.6, middle), (left, middle), arrow=False)
        self.text(left - 0.33, middle + 0.17, r"$\theta$ [rad]")
        self.sum(x, middle, above="+", below="+", left="+" if loop else "")
        self.wire((x + RADIUS, middle), (end, middle))
        self.text(end - 0.32, middle + 0.17, "$TQ$ [N·m]")
        upper, lower = middle + 0.5, middle - 0.5
        self.branch(left, middle)
        self.wire((left, middle), (left, upper), arrow=False)
        path = self.block((left, upper), left + 2.3, r"$K + Bs + Is^2$", width=1.5)
        self.wire(path, (x, upper), (x, middle + RADIUS))
        self.text(left + 2.3, upper + 0.42, "intrinsic stiffness")
        self.wire((left, middle), (left, lower), arrow=False)
        path = self.block((left, lower), left + 0.55, "$s$", width=0.5)
        path = self.block(path, left + 1.35, r"$e^{-s\tau}$", width=0.6)
        path = self.block(path, left + 2.21, "", width=0.62)
        for color, lw, corners in (  # the curve of the static nonlinearity over its axes
            ("#999999", 0.6, ((-0.2, -0.1), (0.2, -0.1))),
            ("#999999", 0.6, ((0.0, -0.18), (0.0, 0.2))),
            (INK, 1.3, ((-0.2, -0.1), (0.0, -0.1), (0.2, 0.18))),
        ):
            places = [(left + 2.21 + dx, lower + dy) for dx, dy in corners]
            self.axis.plot(*zip(*places, strict=True), color=color, lw=lw, zorder=3)
        dynamics = r"$\dfrac{G\omega_n^2}{s^2 + 2\zeta\omega_n s + \omega_n^2}$"
        path = self.block(path, left + 3.5, dynamics, width=1.46, height=0.7)
        self.wire(path, (x, lower), (x, middle - RADIUS))
        self.text(left + 2.3, lower - 0.5, "reflex stiffness: delay, static nonlinearity, linear dynamics")
        self.text(x - 0.2 - 0.03 * len(unit), upper + 0.16, f"$TQ_I${unit}", align="right")
        self.text(x + 0.1, lower, f"$TQ_R${unit}", align="left")
        return x


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
    diagram.joint(0.75, 1.35, 6.45)
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
    middle, feedback = 2.4, 0.6
    diagram.text(0.38, middle + 0.17, "INP [rad]")
    end = diagram.block((0.1, middle), 1.17, "actuator", width=0.9, shade=SHADE)
    diagram.wire(end, (2.13 - RADIUS, middle))
    x = diagram.joint(2.85, middle, 8.5, loop=True)
    diagram.sum(2.13, middle, left="+", below="−")
    diagram.wire((6.95, middle), (x - RADIUS, middle))
    diagram.text(6.9, middle, "voluntary\ntorque, noise", align="right")
    diagram.branch(8.05, middle)
    diagram.wire((8.05, middle), (8.05, feedback), arrow=False)
    load = r"$H_{imp} = \dfrac{1}{I_L s^2 + B_L s + K_L}$"
    end = diagram.block((8.05, feedback), 4.95, load, width=2.0, height=0.7, shade=SHADE)
    diagram.text(4.95, feedback - 0.47, "impedance controller: the load")
    diagram.wire(end, (2.13, feedback), (2.13, middle - RADIUS))
    return diagram.figure
