"""Why numba refuses a function, in one line: its own message has dozens."""

from __future__ import annotations

import re

__all__ = ["reason_of"]

_MAKES_ARRAY = re.compile(
    r"\w*(zeros|ones|empty|full|array|arange|linspace|eye|identity|stack|concatenate|copy|diag|outer|dot|where)\w*\("
)
"""A call in numba's words that makes an array."""
_PLACE = re.compile(r'File "([^"]+)", line (\d+)')


def reason_of(text: str) -> str:
    """What numba's message ``text`` says: the first place outside numba that it names, and the problem there."""
    lines = [line.strip() for line in text.splitlines()]
    first, *more = [line for line in lines if line and not line.startswith(("Failed in", "During:", "File "))] or [""]
    call = next((line.removeprefix(">>>").strip() for line in more[:2] if line.startswith(">>>")), "")
    call = re.sub(r"Literal\[\w+\]\((.*?)\)", r"\1", call)
    place = next((found for line in lines if "/numba/" not in line and (found := _PLACE.match(line))), None)
    where = f"{place[1]}:{place[2]}: " if place else ""
    if _MAKES_ARRAY.match(call) or "array(" in call:
        return f"{where}{call} makes an array, which compiled code may not: use floats, tuples, or an array in State"
    if name := re.match(r"Untyped global name '(\w+)'.*<class 'function'>", first):
        return f"{where}{name[1]} is not @compiled, so compiled code cannot call it"
    return where + "; ".join(filter(None, (first.rstrip(":"), call)))
