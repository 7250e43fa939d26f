"""Options of every method; they are checked, documented and defaulted without loading the methods themselves."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Literal

from ankleloop.options import Options, option

__all__ = [
    "METHOD_OPTIONS",
    "MoespModelOptions",
    "MoespOptions",
    "ParallelCascadeOptions",
    "RealTimeOptions",
    "RivOptions",
]


def delay_option(description: str = "reflex delay", *, estimated: bool = False) -> Any:
    """Declare the reflex delay; a method that estimates it takes None."""
    return option(0.04, description + ("; null estimates it" if estimated else ""), unit="s", ge=0, le=1)


def rate_option() -> Any:
    """Declare the identification rate."""
    return option(100.0, "rate of the identification; the sampling rate has to be a multiple of it", unit="Hz", gt=0)


def degree_option() -> Any:
    """Declare the number of basis functions."""
    return option(5, "number of basis functions (the rectifier has one)", ge=1, le=30)


class MoespModelOptions(Options):
    """Options of the model of the MOESP family, for records of any length."""

    order: int | None = option(
        2, "order of the reflex dynamics; null takes the largest drop of the singular values", ge=1, le=20
    )
    block_rows: int = option(15, "block rows of the Hankel matrices", unit="samples", ge=3, le=200)
    delay: float = delay_option()
    basis: Literal["chebyshev", "rectifier", "spline"] | None = option(
        None, "basis of the static nonlinearity; null for the method's own (chebyshev)"
    )
    degree: int = degree_option()
    identification_rate: float = rate_option()
    projection: Literal["ordinary", "correlation"] | None = option(
        None, "form of the projection; null for the method's own (correlation for eiv-moesp, else ordinary)"
    )
    instrument_rows: int | None = option(
        None,
        "block rows of the instruments; null for block_rows, or what the correlation form needs",
        unit="samples",
        ge=1,
        le=1000,
    )
    instrument_leads: int = option(
        0, "block rows by which the reference of pr-moesp reaches into the future as well", unit="samples", ge=0, le=200
    )
    # A delayed velocity among the basis functions repeats rows of the velocity up to the accuracy of the decimation,
    # which is the default: smaller directions are errors of the filters.
    rank_tolerance: float = option(
        1e-5, "singular values of the projection below this fraction of the largest count as zero", ge=0, lt=1
    )


class MoespOptions(MoespModelOptions):
    """Options of the MOESP family."""

    input_matrices: Literal["least-squares", "instruments"] = option(
        "least-squares",
        "how B and D are estimated; least squares is biased by torque that is fed back, instruments are rebuilt from "
        "the position that the reference predicts",
    )
    reference: str = option("reference", 'variable that serves as reference; "position" for open-loop records')
    free_b: bool = option(
        False,
        "let position, velocity and acceleration drive the state as well; K, B, I are then those of the second-order "
        "model that explains the intrinsic torque best",
    )


class ParallelCascadeOptions(Options):
    """Options of the parallel cascade."""

    delay: float = delay_option()
    basis: Literal["rectifier"] | None = option(
        None, "static nonlinearity; null for the method's own (rectifier), the only one that it has"
    )
    identification_rate: float = rate_option()
    max_passes: int | None = option(None, "most passes; 1 is the method as published, null runs to convergence", ge=1)
    tolerance: float = option(
        0.001, "converged when a pass adds less than this to the net VAF", unit="points of VAF", ge=0
    )
    intrinsic_lags: float = option(
        0.04, "half length of the two-sided intrinsic impulse response", unit="s", ge=0, le=1
    )
    reflex_lags: float = option(0.5, "length of the reflex impulse response", unit="s", gt=0, le=5)
    rank: Literal["full", "mdl"] = option(
        "full",
        "rank of the pseudo-inverse, full or of minimum description length (Westwick and Kearney 1997)",
    )
    rank_tolerance: float = option(
        1e-6, "singular values of the lagged inputs below this fraction of the largest count as zero", ge=0, lt=1
    )


class RealTimeOptions(Options):
    """Options of the real-time algorithm."""

    delay: float = delay_option()
    basis: Literal["rectifier"] | None = option(
        None, "static nonlinearity; null for the method's own (rectifier), the only one that it has"
    )
    identification_rate: float = rate_option()
    memory: float = option(10.0, "time constant of forgetting", unit="s", gt=0)
    settling: float | None = option(
        None, "time until the parameters count, where means of the traces start; null for the memory", unit="s", ge=0
    )
    reflex_lags: float = option(0.4, "length of the reflex impulse response", unit="s", gt=0, le=5)


class RivOptions(Options):
    """Options of refined instrumental variables."""

    order: Literal[2, 3] = option(2, "poles of the reflex dynamics (Eq. 2)")
    delay: float | None = delay_option(estimated=True)
    basis: Literal["chebyshev", "rectifier", "spline"] | None = option(
        None, "static nonlinearity; null for the method's own (rectifier)"
    )
    degree: int = degree_option()
    identification_rate: float = rate_option()
    reference: str = option(
        "reference",
        'variable of the trial that the load cannot reach: the command of the servo, or "position" in open loop',
    )
    weighting: Literal["noise", "flat"] = option(
        "noise",
        "weights of frequencies: the inverse of the noise spectrum, which is efficient where the model holds; or flat, "
        "which fits the torque where it is large and suits a model that is a simplification",
    )
    max_iterations: int = option(30, "most iterations", ge=1)
    tolerance: float = option(
        0.01,
        "the iteration ends when no parameter moves by more than this fraction of its standard error",
        gt=0,
    )


# Options by the name of the method.
METHOD_OPTIONS: Mapping[str, type[Options]] = MappingProxyType(
    {
        **dict.fromkeys(("pr-moesp", "eiv-moesp", "pi-moesp", "po-moesp", "moesp"), MoespOptions),
        "parallel-cascade": ParallelCascadeOptions,
        "real-time": RealTimeOptions,
        "riv": RivOptions,
    }
)
