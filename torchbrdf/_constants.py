"""Numbers that Python computes and torch.compile reads as constants."""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def constant(compute: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """The same function, whose result is a constant of a compiled graph: it is called while the graph is traced.

    What `torch.compiler.assume_constant_result` does, without importing the compiler: that takes as long again as
    torch itself, and most programs never compile. Also takes functions decorated with `lru_cache`, which the compiler
    would look through and trace.
    """

    @wraps(compute)
    def read(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        return compute(*args, **kwargs)

    read._dynamo_marked_constant = True  # pyright: ignore[reportFunctionMemberAccess, reportAttributeAccessIssue]
    return read
