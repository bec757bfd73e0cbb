"""The page of the Python API, from signatures and docstrings of the public names."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any

import ftcc.groundside

__all__ = ["public_names", "python_api"]

_UNDERLINED = re.compile(r"^(\w[\w ]*)\n-{3,}$", re.MULTILINE)
_ENTRY = re.compile(r"^(?=\S)(.+)\n((?:[ ]{4}.+\n?)+)", re.MULTILINE)


def public_names() -> list[str]:
    """Names that `ftcc.groundside` offers to scripts."""
    return sorted(ftcc.groundside.__all__)


def _docstring(thing: Any) -> str:
    """A docstring in the style of numpydoc, as Markdown."""
    text = inspect.getdoc(thing) or ""
    pieces = _UNDERLINED.split(text)
    found = [pieces[0]]
    for title, body in zip(pieces[1::2], pieces[2::2], strict=True):
        entries = _ENTRY.findall(body.lstrip("\n") + "\n")
        listed = [f"- `{head}`: {' '.join(text.split())}" for head, text in entries]
        found.append(f"**{title}**\n\n" + ("\n".join(listed) if listed else body.strip()) + "\n")
    return "\n".join(found).replace("``", "`")


def _signature(name: str, function: Callable[..., Any]) -> str:
    """A function as it is called, over several lines where it is long."""
    signature = inspect.signature(function)
    own = [one for one in signature.parameters.values() if one.name not in ("self", "cls")]
    whole = _unquoted(f"{name}{signature.replace(parameters=own)}")
    if len(whole) <= 90:
        return whole
    lines, starred = [], False
    for one in own:
        if one.kind is one.KEYWORD_ONLY and not starred:
            lines.append("*")
        starred = starred or one.kind in (one.KEYWORD_ONLY, one.VAR_POSITIONAL)
        lines.append(_unquoted(str(one)))
    returns = "" if signature.return_annotation is signature.empty else f" -> {signature.return_annotation}"
    return f"{name}(\n" + "".join(f"    {line},\n" for line in lines) + f"){returns}"


def _unquoted(text: str) -> str:
    """Annotations as they are written: `inspect` quotes those that are texts."""
    return re.sub(r"(: |-> )(['\"])(.*?)\2(?=[,)=\s]|$)", r"\1\3", text)


def _members(kind: type) -> Iterator[tuple[str, Any]]:
    """The public members that a class and its bases here define, with docstrings."""
    for name, member in inspect.getmembers_static(kind):
        inner = member.fget if isinstance(member, property) else getattr(member, "func", member)
        module = getattr(inner, "__module__", "") or ""
        if not name.startswith("_") and module.startswith("ftcc.") and inspect.getdoc(inner):
            yield name, member


def _class(name: str, kind: type) -> str:
    sections = [f"## {name}\n"]
    if not issubclass(kind, Exception) and not dataclasses.is_dataclass(kind):
        sections.append(f"```python\n{_signature(name, kind)}\n```\n")
    sections.append(_docstring(kind) + "\n")
    values = []
    if dataclasses.is_dataclass(kind):
        values = [f"- `{field.name}`: `{field.type}`" for field in dataclasses.fields(kind)]
    described = len(sections)
    for member, what in _members(kind):
        if isinstance(what, (property, cached_property)):
            inner = what.fget if isinstance(what, property) else what.func
            values.append(f"- `{member}`: {' '.join(_docstring(inner).split())}")
        elif inspect.isfunction(inspect.unwrap(getattr(kind, member))):
            text = f"```python\n{_signature(member, getattr(kind, member))}\n```\n\n{_docstring(what)}\n"
            sections.append(f"### {name}.{member}\n\n{text}")
    if values:
        sections.insert(described, "**Attributes**\n\n" + "\n".join(values) + "\n")
    return "\n".join(sections)


def python_api() -> str:
    """The page."""
    sections = [
        "# Python API\n\nWhat `ftcc.groundside` offers to scripts and notebooks. [From Python](../docs/python.md) shows"
        " how it is used.\n\n"
        "```python\nfrom ftcc.groundside import simulate\n\n"
        'flight = simulate("demo", settings={"faults.0.effectiveness": 0.4})\n```\n'
    ]
    for name in public_names():
        thing = getattr(ftcc.groundside, name)
        if inspect.isclass(thing):
            sections.append(_class(name, thing))
        else:
            sections.append(f"## {name}\n\n```python\n{_signature(name, thing)}\n```\n\n{_docstring(thing)}\n")
    return "\n".join(sections)
