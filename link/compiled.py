"""Compilation of laws, elements and plants, with a cache that notices every edit.

What is compiled is kept, see `numba_cache`. Only that module and this one import numba.
"""

from __future__ import annotations

import functools
import importlib.util
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import FunctionType, ModuleType
from typing import Any, TypeVar, get_args, get_type_hints

import numpy as np

from ftcc.link import cache
from ftcc.link.cache import SCHEME_ENTRY_POINTS
from ftcc.link.numba_cache import GUEST, index_of, is_guest
from ftcc.link.numba_messages import reason_of

__all__ = [
    "SCHEME_ENTRY_POINTS",
    "Room",
    "Vector",
    "call_by_address",
    "compiled",
    "compiled_apart",
    "compiled_to_wait",
    "compiled_within",
    "copy",
    "entry_of",
    "external",
    "fields",
    "fill",
    "instantiate",
    "is_guest",
    "is_kept",
    "is_left_out",
    "layout",
    "moved",
    "refusal",
    "store",
    "uncompile",
    "when_compiled",
    "width",
]

F = TypeVar("F", bound=Callable[..., Any])

import numba  # noqa: E402  (after numba_cache, which says how)
from llvmlite import ir  # noqa: E402
from numba.core import types  # noqa: E402
from numba.core.compiler_lock import global_compiler_lock  # noqa: E402
from numba.core.dispatcher import Dispatcher  # noqa: E402
from numba.core.registry import CPUDispatcher  # noqa: E402
from numba.core.types.containers import BaseTuple, NamedUniTuple, UniTuple  # noqa: E402
from numba.extending import intrinsic, overload  # noqa: E402


def compiled(function: F) -> F:
    """Compile ``function`` on its first call, cached on disk; with ``NUMBA_DISABLE_JIT=1`` it stays plain Python.

    No fast-math and no fused multiply-add: compiled and plain Python give the same bits. Compiled functions work on
    arrays that they are given and allocate none: without reference counting a flight is three times as fast.
    """
    return _compiled(function)


def compiled_apart(function: F) -> F:
    """As `compiled`, for a large function that is called from large ones: it is not copied into each of them.

    numba optimizes a function with all that is inlined into it: without such borders it would optimize the whole flight
    of a process again at each level of its functions.
    """
    return _compiled(function, forceinline=False)


def compiled_within(function: F) -> F:
    """As `compiled`, for a step of one long function: it is inlined into its caller before that is compiled.

    So it may take tuples of very many arrays, which cost seconds at each call between compiled functions.
    """
    return _compiled(function, inline="always")


def compiled_to_wait(function: F) -> F:
    """As `compiled`, for a function that waits for sockets: it releases the GIL."""
    return _compiled(function, nogil=True)


def _compiled(function: F, **options: Any) -> F:
    # The cache names its files by file and qualified name; two instances of one template need two names.
    function.__qualname__ = f"{function.__module__}.{function.__qualname__}"
    if numba.config.DISABLE_JIT:
        return function
    settings = {"nopython": True, "error_model": "numpy", "forceinline": True, "_nrt": False, "no_cfunc_wrapper": True}
    made = _Compiled(function, targetoptions=settings | options)
    made.enable_caching()
    return made


class _InTurn(CPUDispatcher):  # type: ignore[misc]
    """A compiled function; of several processes that need it at the same time one compiles it, and the others wait."""

    def compile(self, sig: Any) -> Any:
        if is_kept(self):
            return super().compile(sig)
        # Functions compile those that they call: processes take their turns in the order of calls, so none waits for
        # one that waits for it. Threads would, without numba's own lock around.
        with global_compiler_lock, cache.in_turn(index_of(self).with_suffix(".turn")):
            return super().compile(sig)


class _Compiled(_InTurn):
    """A compiled function that other compiled functions call without what it needs to be called from Python.

    That unpacks Python's objects. For a tuple of many arrays it is longer than the function itself, which Python hardly
    ever calls.
    """

    def __init__(self, function: Any, targetoptions: dict[str, Any]) -> None:
        super().__init__(function, targetoptions=targetoptions)
        within = FunctionType(
            function.__code__, function.__globals__, function.__name__, function.__defaults__, function.__closure__
        )
        within.__qualname__ = f"{function.__qualname__}-within"  # names its files in the cache
        within.__module__ = function.__module__
        self.within = _InTurn(within, targetoptions=targetoptions | {"no_cpython_wrapper": True})
        self.within.enable_caching()

    @property
    def _numba_type_(self) -> Any:
        """What compiled functions see where they name this one."""
        return self.within._numba_type_


def is_kept(function: Any) -> bool:
    """Whether ``function`` need not be compiled: it is in the cache, for some types, or is plain Python."""
    return not isinstance(function, Dispatcher) or index_of(function).exists()


def external(name: str, result: str, *arguments: str) -> Any:
    """The function ``name`` of the C library, for compiled code; types are numba's names, such as "int32".

    Compiled functions that call it can be cached: its address is looked up when they are loaded.
    """
    return types.ExternalFunction(name, getattr(types, result)(*(getattr(types, one) for one in arguments)))


@intrinsic
def call_by_address(_context, address, number):
    """In compiled code: call the C function ``void (int64)`` at ``address``, see `callbacks`."""

    def generate(context, builder, signature, arguments):
        whole = ir.IntType(64)
        kind = ir.FunctionType(ir.VoidType(), [whole])
        builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64), generate


def when_compiled(function: Callable[..., Any]) -> Callable[[F], F]:
    """Decorate the function that replaces ``function`` in compiled code; plain Python calls ``function`` itself."""

    def register(substitute: F) -> F:
        overload(function, strict=False)(lambda *arguments: substitute)
        return substitute

    return register


def entry_of(function: Any, *arguments: Any) -> Any:
    """The machine code of ``function`` for arguments of these types, for which it must be compiled already.

    It does not check the types of its arguments, which for tuples of a hundred arrays takes longer than a tick: the
    caller must always pass the same ones. Plain Python is returned as it is.
    """
    if not isinstance(function, Dispatcher):
        return function
    return function.get_overload(tuple(numba.typeof(argument) for argument in arguments))


def refusal(function: Any, *arguments: Any) -> str:
    """Compile ``function`` for compiled callers that pass ``arguments`` of these types: why numba refuses, or ""."""
    if isinstance(function, Dispatcher):
        called = function.within if isinstance(function, _Compiled) else function
        try:
            called.compile(tuple(numba.typeof(argument) for argument in arguments))
        except Exception as error:  # numba raises more than its own errors
            return reason_of(str(error)) or repr(error)
    return ""


def is_left_out(function: Any) -> bool:
    """Whether ``function`` is plain Python where others are compiled, so that these cannot call it."""
    return not numba.config.DISABLE_JIT and not isinstance(function, Dispatcher)


def uncompile(modules: Sequence[ModuleType]) -> None:
    """Turn the compiled functions of ``modules``, wherever these use them, back into plain Python."""
    homes = {__name__, *(module.__name__ for module in modules)}
    for module in modules:
        for name, value in list(vars(module).items()):
            if isinstance(value, Dispatcher) and value.py_func.__module__ in homes:
                setattr(module, name, value.py_func)


Vector = tuple[float, float, float]
"""Three axes; algebra on tuples allocates nothing."""


@dataclass(frozen=True)
class Room:
    """Annotates a field of a NamedTuple that is an array of this shape, modified in place."""

    shape: tuple[int, ...]

    @property
    def size(self) -> int:
        return math.prod(self.shape)


@functools.cache
def layout(cls: Any) -> tuple[tuple[int, int, int | Room], ...]:
    """First entry, end, and number of floats (or `Room`) of each field of a NamedTuple class in a vector."""
    hints = get_type_hints(cls, include_extras=True)
    found: list[tuple[int, int, int | Room]] = []
    at = 0
    for name in cls._fields:
        hint = hints[name]
        rooms = [note for note in getattr(hint, "__metadata__", ()) if isinstance(note, Room)]
        parts = get_args(hint.__origin__ if hasattr(hint, "__metadata__") else hint)
        what = rooms[0] if rooms else max(1, len(parts))
        end = at + (what.size if isinstance(what, Room) else what)
        found.append((at, end, what))
        at = end
    return tuple(found)


def width(cls: Any) -> int:
    """How many floats a NamedTuple class takes in a vector."""
    return layout(cls)[-1][1]


def fields(cls: Any, values: Any) -> Any:
    """The NamedTuple ``cls`` from the first entries of the vector ``values``.

    Its fields are floats, tuples of floats (`Vector`), or, where annotated with `Room`, views of ``values``.
    """
    if width(cls) == len(cls._fields):
        return cls(*values[: len(cls._fields)].tolist())
    made: list[Any] = []
    for at, end, what in layout(cls):
        entries = values[at:end]
        if isinstance(what, Room):
            made.append(entries.reshape(what.shape))
        else:
            made.append(tuple(entries.tolist()) if what > 1 else float(entries[0]))
    return cls(*made)


@overload(fields)
def _fields_compiled(cls, values):
    if not isinstance(cls, types.NamedTupleClass):
        return None
    kind: Any = cls.instance_class
    # Entry by entry: to_fixed_tuple takes 10 ns for each.
    made = []
    for at, end, what in layout(kind):
        if isinstance(what, Room):
            made.append(f"values[{at}:{end}].reshape({what.shape})" if len(what.shape) > 1 else f"values[{at}:{end}]")
        else:
            entries = ", ".join(f"values[{n}]" for n in range(at, end))
            made.append(f"({entries})" if what > 1 else entries)
    return eval(f"lambda cls, values: kind({', '.join(made)})", {"kind": kind})


def _rooms(record_type: Any) -> dict[int, int]:
    """Sizes of the arrays among the fields of a tuple type, by place."""
    if not hasattr(record_type, "_fields"):
        return {}
    return {n: what.size for n, (_, _, what) in enumerate(layout(record_type)) if isinstance(what, Room)}


def store(record: Any, values: Any) -> None:
    """Write a tuple into the first entries of the vector ``values``; the inverse of `fields`.

    A number in place of an array fills it.
    """
    rooms = _rooms(type(record))
    at = 0
    for n, field in enumerate(record):
        entries = np.ravel(field)
        size = rooms.get(n, len(entries))
        values[at : at + size] = entries
        at += size


@overload(store)
def _store_compiled(record, values):
    if isinstance(record, UniTuple | NamedUniTuple) and record.dtype == types.float64:

        def store_floats(record, values):
            for n in range(len(record)):
                values[n] = record[n]

        return store_floats
    rooms = _rooms(getattr(record, "instance_class", None))
    lines = ["def store_fields(record, values):", "    at = 0"]
    for n, field in enumerate(record.types):
        if isinstance(field, BaseTuple):
            lines += [f"    values[at + {m}] = record[{n}][{m}]" for m in range(len(field))]
            lines.append(f"    at += {len(field)}")
        elif isinstance(field, types.Array):
            lines += [f"    for entry in record[{n}].flat:", "        values[at] = entry", "        at += 1"]
        else:
            size = rooms.get(n, 1)
            lines += [f"    for m in range({size}):", f"        values[at + m] = record[{n}]", f"    at += {size}"]
    made: dict[str, Any] = {}
    exec("\n".join(lines), made)
    return made["store_fields"]


def moved(state: Any, h: float, rates: Any) -> Any:
    """``state`` + ``h`` * ``rates``, as a NamedTuple of floats: it stays in registers; an array would be slow."""
    return type(state)(*(x + h * rate for x, rate in zip(state, rates, strict=True)))


@overload(moved)
def _moved_compiled(state, h, rates):
    terms = ", ".join(f"state[{n}] + h * rates[{n}]" for n in range(state.count))
    made: dict[str, Any] = {"kind": state.instance_class}
    exec(f"def moved_entries(state, h, rates):\n    return kind({terms})", made)
    return made["moved_entries"]


@compiled
def copy(source, target):
    """Copy the vector ``source`` into the beginning of ``target``; an assignment of slices would allocate."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@compiled
def fill(target, value):
    """Set every entry of the vector ``target`` to ``value``."""
    for i in range(target.shape[0]):
        target[i] = value


def instantiate(template: str, name: str, **names: Any) -> ModuleType:
    """Load the module ``template`` once more, as ``template[name]``, with ``names`` already defined in it.

    A compiled function that takes another function as an argument is never cached. A template module whose free names
    are given here is: its functions see the chosen scheme and plant as ordinary globals.
    """
    full_name = f"{template}[{name}]"
    if full_name in sys.modules:
        return sys.modules[full_name]
    spec = importlib.util.find_spec(template)
    if spec is None or spec.origin is None:
        raise ImportError(f"no template module {template}")
    place = importlib.util.spec_from_file_location(full_name, spec.origin)
    assert place is not None
    assert place.loader is not None
    module = importlib.util.module_from_spec(place)
    module.__dict__.update(names)
    module.__dict__[GUEST] = any(is_guest(one) for one in names.values() if isinstance(one, ModuleType))
    sys.modules[full_name] = module
    place.loader.exec_module(module)
    return module
