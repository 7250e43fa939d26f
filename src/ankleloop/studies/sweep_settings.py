"""What the notebook `sweep` shows of a study: quantities, methods, a difference of two of them, axes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from ankleloop.options import Options, option, show_value, suggest_name
from ankleloop.paper.sweep_quantities import SWEEP_QUANTITIES

Names = Annotated[list[str], Field(min_length=1)]

SCORES = {
    None: ("vaf_net_measured", "vaf_net_true", "vaf_intrinsic_true", "vaf_reflex_true"),
    "measured": ("vaf_net_measured", "vaf_intrinsic_measured", "vaf_reflex_measured"),
}  # by `against`


class SweepSettings(Options):
    """Pictures of a study whose points differ in settings of the simulation or options of methods."""

    quantities: Names | None = option(
        None,
        "scores (vaf_net_true), parameters (K), relative errors of parameters (K_error), and shares of trials "
        "(failures, warnings) that are shown, a row or a panel each; null for the VAF of net, intrinsic and reflex "
        "torque and the errors of K and G",
    )
    methods: Names | None = option(None, "methods that are shown; null for all")
    difference: Annotated[list[str], Field(min_length=2, max_length=2)] | None = option(
        None, "two methods whose difference (first minus second, trial by trial) is shown as well; null for none"
    )
    axes: Names | None = option(
        None,
        "varied settings or options over which the pictures are drawn: one gives lines, two give maps, more give a "
        "matrix of effects; null for all in the order of the points",
    )
    band: Literal["mean", "trials"] = option(
        "mean", "bands of lines: the 95 % confidence interval of the mean, or 80 % of the trials (quantiles 10 to 90 %)"
    )

    @model_validator(mode="after")
    def _check_names(self) -> Self:
        _check_list("quantities", self.quantities or (), "quantity", SWEEP_QUANTITIES)
        for key in ("quantities", "methods", "difference", "axes"):
            for name, count in Counter(getattr(self, key) or ()).items():
                if count > 1:
                    raise ValueError(f"{key}: {name!r} is listed twice")
        return self


def check_sweep(
    sweep: SweepSettings,
    varied: Collection[str],
    methods: Collection[str],
    against: Literal["measured"] | None = None,
) -> None:
    """Refuse pictures of what a study does not have."""
    if not varied:
        raise ValueError("no setting and no option differs between the points: give points more than one value")
    _check_list("methods", sweep.methods or (), "method", methods)
    _check_list("difference", sweep.difference or (), "method", methods)
    _check_list("axes", sweep.axes or (), "varied parameter", varied)
    for name in sweep.quantities or ():
        if name.startswith("vaf_") and name not in SCORES[against]:
            scores = ", ".join(SCORES[against])
            raise ValueError(f"quantities: a study with against: {against or 'null'} has no {name}; it has {scores}")


def _check_list(key: str, names: Iterable[str], kind: str, known: Collection[str]) -> None:
    """Refuse names that are unknown."""
    for name in names:
        if name not in known:
            raise ValueError(
                f"{key}: there is no {kind} {show_value(name)}{suggest_name(name, known)}; there are {', '.join(known)}"
            )
