"""Fused multiply-adds in compiled code: the same bits whatever the compiler makes of the loop around them."""

from __future__ import annotations

from typing import Any

from numba import types
from numba.extending import intrinsic

__all__ = ["fuse"]


def _compile_fused_product(typing_context: Any, a: Any, b: Any, c: Any) -> tuple[Any, Any]:
    """Signature and code of a fused multiply-add."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), generate


fuse: Any = intrinsic(_compile_fused_product)  # a b + c, rounded once
