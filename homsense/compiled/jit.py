"""How the kernels are compiled.

Three costs decide. A function that may allocate counts references to every array that it takes
from a tuple, which is far more than the work of a short loop; so `inlined` and `apart` must not
allocate. A call passes each array as seven words; so what is called often is `inlined`. And a
signed index is tested for counting from the end; so what is indexed often is indexed by
`np.uint64(...)`, but for loops from 0, of which the compiler knows.
"""

import hashlib
import marshal
from collections.abc import Callable
from types import ModuleType
from typing import Any, TypeVar, cast

import numba
import numpy as np

Function = TypeVar("Function", bound=Callable[..., Any])


def inlined(function: Function) -> Function:
    """Compile what is called often; it becomes a part of its caller and must not allocate.

    Parameters
    ----------
    function : callable
        In numba's subset of Python.

    Returns
    -------
    callable
        The same.
    """
    return cast("Function", numba.njit(_nrt=False, forceinline=True)(function))  # type: ignore[call-overload]


def apart(function: Function) -> Function:
    """Compile what is called seldom; it must not allocate.

    Parameters
    ----------
    function : callable
        In numba's subset of Python.

    Returns
    -------
    callable
        The same.
    """
    return cast("Function", numba.njit(_nrt=False)(function))  # type: ignore[call-overload]


def allocating(function: Function) -> Function:
    """Compile what makes arrays.

    Parameters
    ----------
    function : callable
        In numba's subset of Python.

    Returns
    -------
    callable
        The same.
    """
    return cast("Function", numba.njit(function))


def kept(function: Function) -> Function:
    """Compile what Python calls, and keep the result on disk where numba finds a place for it.

    Parameters
    ----------
    function : callable
        In numba's subset of Python.

    Returns
    -------
    callable
        The same.
    """
    try:
        return cast("Function", numba.njit(cache=True)(function))
    except RuntimeError:
        return allocating(function)


def fingerprint(*modules: ModuleType) -> str:
    """Return a hash of all kernels; numba's own cache looks at the outermost function only.

    Parameters
    ----------
    *modules : module
        With functions of this file, and with the constants that they use.

    Returns
    -------
    str
        Hexadecimal digits.
    """
    digest = hashlib.sha256()
    for module in modules:
        for name, value in sorted(vars(module).items()):
            if hasattr(value, "py_func"):
                digest.update(name.encode() + marshal.dumps(value.py_func.__code__))
            elif isinstance(value, np.ndarray | np.generic):
                digest.update(name.encode() + value.tobytes())
            elif isinstance(value, int | float | tuple):
                digest.update(f"{name}={value!r}".encode())
    return digest.hexdigest()
