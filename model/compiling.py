"""Compiling functions with numba: at their first call, kept on disk, renewed when what they are built on changes."""

import hashlib
import inspect
from collections.abc import Callable
from types import ModuleType
from typing import Any, ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")


class Compiler:
    """The decorators of one file's compiled functions.

    Numba renews kept code when the file changes in which its function stands, not when a file changes whose functions
    are compiled into it. So kept code also has the content of those files in its name.

    Parameters
    ----------
    *built_on : module
        Whose functions, types and constants go into the compiled code.
    """

    def __init__(self, *dependencies: ModuleType) -> None:
        sources = "".join(inspect.getsource(module) for module in dependencies)
        self._digest = hashlib.sha256(sources.encode()).hexdigest()[:12] if dependencies else ""

    def compiled(self, function: Callable[P, R]) -> Callable[P, R]:
        """Compile a function at its first call, keep it on disk, and release the interpreter's lock while it runs."""
        return self._decorated(function, forceinline=False)

    def inlined(self, function: Callable[P, R]) -> Callable[P, R]:
        """Compile a function into those that call it: without counting of arrays' references, a third faster."""
        return self._decorated(function, forceinline=True)

    def _decorated(self, function: Callable[P, R], *, forceinline: bool) -> Callable[P, R]:
        # The one place where numba's decorator, which carries no types, meets typed code.
        decorate = cast("Callable[..., Any]", numba.njit)
        options = {"nogil": True, "error_model": "numpy", "forceinline": forceinline}
        if self._digest:
            function.__qualname__ += f"_{self._digest}"  # numba names the file after it
        try:
            return cast("Callable[P, R]", decorate(function, cache=True, **options))
        except RuntimeError:  # no folder to keep it in, neither beside the source nor in the user's cache
            return cast("Callable[P, R]", decorate(function, **options))
