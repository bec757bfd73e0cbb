"""Python functions that compiled code calls by their address.

Compiled functions are kept on disk, so they cannot hold a Python function. They get its address in an array, and call
it with an integer; the numbers that matter lie in arrays that both sides know. A call costs about a microsecond.
"""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ftcc.link.compiled import call_by_address, when_compiled

__all__ = ["NOBODY", "call", "register"]

NOBODY = 0
"""Address of no function."""

Function = Callable[[int], None]

_signature = ctypes.CFUNCTYPE(None, ctypes.c_int64)
_registered: dict[int, tuple[object, Function]] = {}


def register(function: Function) -> NDArray[np.int64]:
    """Return the address of ``function(number)``, as an array (1,); it can be called as long as that lives.

    An exception in ``function`` would be lost: it must catch and keep what it raises.
    """
    thunk = _signature(function)
    address = ctypes.cast(thunk, ctypes.c_void_p).value
    assert address is not None
    holder = np.array([address], np.int64)
    _registered[address] = (thunk, function)
    weakref.finalize(holder, _registered.pop, address, None)
    return holder


def call(address, number):
    """Call the function at ``address``, which `register` gave, with an integer."""
    _registered[int(address)][1](int(number))


@when_compiled(call)
def _call(address, number):
    call_by_address(address, number)
