"""A plugin of mypy: pydrake's stubs say `ndarray[float64, dtype]`, where numpy has the shape first.

So none of our arrays would fit any argument of Drake. Here such an array is one of any shape.
"""

from __future__ import annotations

from collections.abc import Callable

from mypy.plugin import AnalyzeTypeContext, Plugin
from mypy.types import AnyType, Type, TypeOfAny, UnboundType


def _array(context: AnalyzeTypeContext) -> Type:
    args = context.type.args
    if len(args) != 2 or (isinstance(args[0], UnboundType) and args[0].name in _NO_SHAPES):
        args = (AnyType(TypeOfAny.special_form),) * 2
    return context.api.named_type("numpy.ndarray", [context.api.analyze_type(arg) for arg in args])


_NO_SHAPES = ("numpy.float64", "float64", "object", "numpy.object_")


class PydrakeArrays(Plugin):
    """See above."""

    def get_type_analyze_hook(self, fullname: str) -> Callable[[AnalyzeTypeContext], Type] | None:
        return _array if fullname == "numpy.ndarray" else None


def plugin(version: str) -> type[Plugin]:
    """Where mypy begins."""
    return PydrakeArrays
