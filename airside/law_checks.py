"""What can be wrong with a scheme's file and be seen without flying it: each finding with file and line.

Functions are read as text: nothing is compiled or called, so that a mistake is found before any of that.
"""

from __future__ import annotations

import ast
import difflib
import functools
import inspect
import linecache
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from ftcc.airside.flight_path import Own
from ftcc.airside.model import Model
from ftcc.airside.references import of_plant
from ftcc.link.actuators import SLOT

__all__ = ["ARGUMENTS", "find_mistakes", "ignores_trust", "place_of", "shown_path", "similar"]

_SUMS = "ftcc.airside.elements.neighbours"
"""The elements that weigh by ``heard.trust``."""

ARGUMENTS = {
    "start": ("own", "heard", "reference", "model", "gains"),
    "step": ("state", "own", "heard", "reference", "model", "gains", "dt"),
    "share": ("state", "own", "reference", "output", "gains"),
    "observe": ("state", "own", "reference", "output", "gains"),
    "climb_limit": ("gains",),
    "command_limits": ("gains",),
    "check": ("gains", "flight"),
}
"""What the functions of a scheme are called with, in this order."""


def shown_path(file: str) -> str:
    """A file as it is shown to who works here: relative to the working directory where it lies below it."""
    path = Path(file)
    try:
        return str(path.resolve().relative_to(Path.cwd()))
    except (ValueError, OSError):
        return str(path)


def place_of(function: Any) -> str:
    """File and line of a function, compiled or not: of its ``def``, below its decorators."""
    code = getattr(function, "py_func", function).__code__
    line = code.co_firstlineno
    while linecache.getline(code.co_filename, line).lstrip().startswith("@"):
        line += 1
    return f"{shown_path(code.co_filename)}:{line}"


def similar(name: str, known: Iterable[str]) -> str:
    """Which of ``known`` a name may have been meant for, as a question; all of them where none is near."""
    names = list(known)
    near = [one for one in names if one.lower() == name.lower()] or difflib.get_close_matches(name, names, 1, 0.5)
    return f"did you mean {near[0]}?" if near else f"there are {', '.join(names)}"


def find_mistakes(module: ModuleType, heard_type: Any) -> list[str]:
    """What is wrong with a scheme's module that has all that one needs."""
    return list(dict.fromkeys([*_signatures(module), *_names_of_gains(module), *_commands(module)])) or list(
        dict.fromkeys(_bodies(module, heard_type))
    )


def ignores_trust(modules: Iterable[ModuleType]) -> str | None:
    """Why the defences have no effect on a law, the modules of which are given; None: it weighs by ``heard.trust``.

    Either it reads the field itself, or it leaves its sums to elements that do.
    """
    hears = False
    for module in modules:
        _, tree = _tree(module)
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and node.attr == "trust":
                return None
            if isinstance(node, ast.ImportFrom) and node.module == _SUMS:
                return None
            hears = hears or (isinstance(node, ast.Attribute) and getattr(node.value, "id", "") == "heard")
    if not hears:
        return "the law hears nobody"
    return "the law does not weigh by heard.trust, see docs/tutorials/own-law.md"


def _functions(module: ModuleType) -> Iterator[tuple[str, Any]]:
    for name in ARGUMENTS:
        function = getattr(module, name, None)
        if hasattr(getattr(function, "py_func", function), "__code__"):
            yield name, function


def _signatures(module: ModuleType) -> Iterator[str]:
    for name, function in _functions(module):
        wanted = ARGUMENTS[name]
        signature = inspect.signature(getattr(function, "py_func", function))
        try:
            signature.bind(*wanted)
        except TypeError:
            yield (
                f"{place_of(function)}: {name}{signature} takes {len(signature.parameters)} arguments; "
                f"it is called as {name}({', '.join(wanted)})"
            )


def _names_of_gains(module: ModuleType) -> Iterator[str]:
    known = module.Gains._fields
    sets = [(f"{kind}.{name}", gains) for kind in ("FORMS", "SWITCHES") for name, gains in _sets(module, kind)]
    sets += [("RANGES", names.split()) for names in getattr(module, "RANGES", {}).values()]
    for where, names in sets:
        for name in names:
            if name not in known:
                kind = where.split(".")[0]
                yield f"{_place_of_name(module, kind)}: {where} names {name}, which is no gain; {similar(name, known)}"


def _sets(module: ModuleType, kind: str) -> Iterable[tuple[str, Any]]:
    return getattr(module, kind, {}).items()


def _commands(module: ModuleType) -> Iterator[str]:
    commands, outputs = tuple(module.COMMANDS), module.Output._fields
    if unknown := [name for name in commands if name not in SLOT]:
        yield (
            f"{_place_of_name(module, 'COMMANDS')}: COMMANDS names {', '.join(unknown)}, which is no actuator; "
            f"{similar(unknown[0], SLOT)}"
        )
    elif outputs[: len(commands)] != commands:
        yield (
            f"{_place_of_name(module, 'COMMANDS')}: Output must begin with the commands {', '.join(commands)}, "
            f"as COMMANDS lists them; it has {', '.join(outputs)}"
        )


# The text of a file.


@functools.cache
def _tree(module: ModuleType) -> tuple[str, ast.Module]:
    """File and syntax tree of a module; an empty one where there is no source."""
    file = getattr(module, "__file__", None)
    if not file:
        return module.__name__, ast.Module([], [])
    try:
        return shown_path(file), ast.parse(Path(file).read_text(encoding="utf-8"))
    except (OSError, SyntaxError, ValueError):
        return shown_path(file), ast.Module([], [])


def _place_of_name(module: ModuleType, name: str) -> str:
    """Where a module defines ``name``; its file alone where that is not found."""
    file, tree = _tree(module)
    for node in tree.body:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        names = [getattr(node, "name", None), *(getattr(target, "id", None) for target in targets)]
        if name in names:
            return f"{file}:{node.lineno}"
    return file


def _bodies(module: ModuleType, heard_type: Any) -> Iterator[str]:
    """Fields that records do not have, and tuples of another length than is wanted, in the scheme's functions."""
    file, tree = _tree(module)
    records = {
        "own": Own,
        "heard": heard_type,
        "reference": of_plant(getattr(module, "PLANT", "longitudinal")).Reference,
        "model": Model,
        "gains": module.Gains,
        "state": module.State,
        "output": module.Output,
    }
    for function in tree.body:
        if not isinstance(function, ast.FunctionDef) or function.name not in ARGUMENTS:
            continue
        given = [one.arg for one in (*function.args.posonlyargs, *function.args.args)]
        assigned = {node.id for node in ast.walk(function) if isinstance(node, ast.Name) and not _is_read(node)}
        kinds = {
            name: records[role]
            for name, role in zip(given, ARGUMENTS[function.name])
            if role in records and name not in assigned
        }
        for node in ast.walk(function):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in kinds:
                kind = kinds[node.value.id]
                if not hasattr(kind, node.attr):
                    what = "gain" if kind is module.Gains else f"field of {kind.__name__}"
                    yield (
                        f"{file}:{node.lineno}: in {function.name}: {node.value.id}.{node.attr} is no {what}; "
                        f"{similar(node.attr, kind._fields)}"
                    )
            elif isinstance(node, ast.Call):
                yield from _call(module, file, function.name, node)
            elif isinstance(node, ast.Return):
                yield from _result(module, file, function.name, node)


def _is_read(node: ast.Name) -> bool:
    return isinstance(node.ctx, ast.Load)


def _call(module: ModuleType, file: str, function: str, node: ast.Call) -> Iterator[str]:
    """A ``State`` or ``Output`` that is made of too few or too many values."""
    name = getattr(node.func, "id", "")
    if name not in ("State", "Output") or any(isinstance(one, ast.Starred) for one in node.args):
        return
    fields = getattr(module, name)._fields
    keywords = [keyword.arg for keyword in node.keywords]
    if None in keywords:
        return
    for keyword in keywords:
        if keyword not in fields:
            yield (
                f"{file}:{node.lineno}: in {function}: {keyword} is no field of {name}; {similar(str(keyword), fields)}"
            )
            return
    defaults = len(getattr(module, name)._field_defaults)
    if not len(fields) - defaults <= len(node.args) + len(keywords) <= len(fields):
        yield (
            f"{file}:{node.lineno}: in {function}: {name} is made of {len(node.args) + len(keywords)} values; "
            f"it has {len(fields)}: {', '.join(fields)}{_of_commands(module, name)}"
        )


def _of_commands(module: ModuleType, name: str) -> str:
    return f" (the commands {', '.join(module.COMMANDS)} first)" if name == "Output" else ""


def _result(module: ModuleType, file: str, function: str, node: ast.Return) -> Iterator[str]:
    """A result that is a tuple of the wrong length, or what can be no result."""
    wanted: dict[str, tuple[str, Sequence[str]]] = {
        "step": ("the next State and the Output", ("State", "Output")),
        "share": ('the values of SHARED["follower"]', [q.name for q in module.SHARED.get("follower", ())]),
        "observe": ("the values of SIGNALS", [q.name for q in getattr(module, "SIGNALS", ())]),
    }
    if function not in wanted:
        return
    what, names = wanted[function]
    value = node.value
    if isinstance(value, ast.Tuple) and not any(isinstance(one, ast.Starred) for one in value.elts):
        count = len(value.elts)
        # Signals may be vectors, which observe returns as they are.
        if count == len(names) or (function == "observe" and count < len(names)):
            return
        got = f"{count} value{'s' if count != 1 else ''}"
    elif value is None or isinstance(value, ast.Constant):
        got = "nothing" if value is None else ast.unparse(value)
    elif function == "step" and isinstance(value, ast.Call) and getattr(value.func, "id", "") in ("State", "Output"):
        got = f"{getattr(value.func, 'id', '')} alone"
    else:
        return
    yield f"{file}:{node.lineno}: {function} returns {got}; it must return {what} ({', '.join(names)})"
