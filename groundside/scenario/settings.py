"""Settings of a scenario as a script gives them: nested tables or dotted keys, turned into ``key.path=value`` texts."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ftcc.groundside.scenario.catalogue import ScenarioError

__all__ = ["Settings", "setting_texts"]

Settings = str | Sequence[str] | Mapping[Any, Any]
"""A text ``key.path=value``, several of them, or a mapping as `setting_texts` reads it."""


def setting_texts(settings: Settings, file: str | Path = "settings") -> tuple[str, ...]:
    """Return settings as the texts ``key.path=value`` that ``--set`` takes, the value as in TOML.

    Parameters
    ----------
    settings : mapping, text or sequence of texts
        In a mapping, a key is a name, several names with dots between them, or the number of a list's entry, from 0.
        A value is a number, text, bool, a list of these, or a mapping of its own: ``{"gains.k11": 3.0}`` and
        ``{"gains": {"k11": 3.0}}`` are the same. Within a list, a mapping is a table that is given whole.
    file : str or Path
        What the error names.

    Raises
    ------
    ScenarioError
        If a value is nothing that TOML has, or nan or infinite, or a key cannot be one.
    """
    if isinstance(settings, str):
        return (settings,)
    if not isinstance(settings, Mapping):
        for text in settings:
            if not isinstance(text, str):
                raise ScenarioError(file, [f"settings: {text!r}: must be a text, such as 'channel.loss=0.3'"])
        return tuple(settings)
    try:
        return tuple(f"{key}={_toml(value, key)}" for key, value in _leaves(settings, ""))
    except ValueError as error:
        raise ScenarioError(file, [str(error)]) from None


def _leaves(table: Mapping[Any, Any], above: str) -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        path = f"{above}.{_name(key, above)}" if above else _name(key, above)
        if isinstance(value, Mapping):
            yield from _leaves(value, path)
        else:
            yield path, value


def _name(key: Any, above: str) -> str:
    if isinstance(key, int | np.integer) and not isinstance(key, bool):
        return str(int(key))
    if not isinstance(key, str) or "=" in key or not all(part.strip() for part in key.split(".")):
        where = f"settings {above}" if above else "settings"
        raise ValueError(
            f"{where}: key {key!r}: must be a name, names with dots between them, or the number of an entry"
        )
    return key


def _toml(value: Any, key: str) -> str:
    """A value as TOML, on one line; ``key`` is where it is to stand.

    Raises
    ------
    ValueError
    """
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(int(value))
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{key} = {value}: must be a finite number")
        return repr(float(value))
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(_toml(one, f'{key}.{n}') for n, one in enumerate(value))}]"
    if isinstance(value, Mapping):
        pairs = (f"{_text(_name(name, key))} = {_toml(one, f'{key}.{name}')}" for name, one in value.items())
        return f"{{{', '.join(pairs)}}}"
    raise ValueError(f"{key} = {value!r}: must be a number, text, true, false, or a list or table of these")


def _text(text: str) -> str:
    # JSON escapes all that a basic string of TOML must, except one character.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
