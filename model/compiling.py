"""Compilation with numba on the first call, with a cache on disk that also depends on imported sources."""

import hashlib
import inspect
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any, ParamSpec, TypeVar, cast

import numba
from numba.extending import overload

P = ParamSpec("P")
R = TypeVar("R")


class Compiler:
    """Decorators for the compiled functions of one file.

    Numba invalidates cached code when the function's own file changes, but not when a file changes whose functions are
    compiled into it. The name of the cached code therefore contains a digest of those files.

    Parameters
    ----------
    *dependencies : module
        Modules whose functions, types and constants are compiled into the code.
    """

    def __init__(self, *dependencies: ModuleType) -> None:
        sources = "".join(inspect.getsource(module) for module in dependencies)
        self._digest = hashlib.sha256(sources.encode()).hexdigest()[:12] if dependencies else ""

    def compiled(self, function: Callable[P, R]) -> Callable[P, R]:
        """Compile a function on its first call, cache it on disk, and release the GIL while it runs."""
        return self._decorated(function, forceinline=False)

    def inlined(self, function: Callable[P, R]) -> Callable[P, R]:
        """Inline a function into its callers: a third faster, because arrays are not reference-counted."""
        return self._decorated(function, forceinline=True)

    def _decorated(self, function: Callable[P, R], *, forceinline: bool) -> Callable[P, R]:
        # numba's decorator is untyped: the casts stay in this function.
        decorate = cast("Callable[..., Any]", numba.njit)
        options = {"nogil": True, "error_model": "numpy", "forceinline": forceinline}
        if self._digest:
            function.__qualname__ += f"_{self._digest}"  # numba names the cache file after it
        try:
            return cast("Callable[P, R]", decorate(function, cache=True, **options))
        except RuntimeError:  # no writable cache folder, neither beside the source nor in the user's cache
            return cast("Callable[P, R]", decorate(function, **options))


def selected_by_type(kernels: Mapping[Any, Callable[..., R]]) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator: in compiled code, the type of the first argument selects the kernel that is called.

    Numba cannot cache code with functions as arguments; a type costs nothing at run time. Interpreted code calls the
    decorated function itself.

    Parameters
    ----------
    kernels : mapping
        Type of the first argument, a NamedTuple, to the compiled function of the other arguments.
    """

    def decorated(function: Callable[P, R]) -> Callable[P, R]:
        def selected(first: Any, *_others: Any) -> Callable[..., R]:
            kernel = kernels[first.instance_class]
            return lambda first, *others: kernel(*others)  # noqa: ARG005  # numba requires equal signatures

        options = {"nogil": True, "error_model": "numpy", "forceinline": True}
        cast("Callable[..., Any]", overload)(function, jit_options=options, strict=False)(selected)
        return function

    return decorated
