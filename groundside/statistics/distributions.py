"""Random quantities: distributions by scipy's names and parameters, read from TOML or from the command line."""

from __future__ import annotations

import ast
import difflib
import functools
import itertools
import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ftcc.groundside.errors import UserError
from ftcc.groundside.statistics.designs import SMALLEST

__all__ = ["Distribution", "DistributionError", "distribution_of"]

Array = NDArray[np.float64]

_ALIASES = {"normal": "norm", "integers": "randint"}
"""Names of numpy that stand for distributions of scipy."""
_OWN_PARAMETERS = {"integers": ("low", "high", "endpoint"), "choice": ("values", "p")}
_CHECKED = np.array([SMALLEST, 1e-6, 0.01, 0.5, 0.99, 1.0 - 1e-6, 1.0 - SMALLEST])
"""Points at which every distribution must have quantiles."""
_SUM = 1e-6
"""By how much the probabilities of a choice may differ from 1 in sum, as written decimals do."""


class DistributionError(UserError):
    """A distribution that does not exist, or whose parameters are wrong."""


@dataclass(frozen=True)
class Distribution:
    """A distribution and its parameters, as `distribution_of` has checked them."""

    name: str
    parameters: Mapping[str, Any]

    @property
    def text(self) -> str:
        """Return the distribution as the command line takes it, such as ``uniform(loc=0.3, scale=0.7)``."""
        return f"{self.name}({', '.join(f'{key}={_written(value)}' for key, value in self.parameters.items())})"

    @property
    def ordered(self) -> bool:
        """Return whether the values are numbers; False for a choice of words or of true and false."""
        return self.name != "choice" or all(_is_number(value) for value in self.parameters["values"])

    def values(self, u: ArrayLike) -> list[Any]:
        """Return the inverse of the distribution function at points in [0, 1), as float, int, str or bool of Python.

        Numbers of a choice are in the order of their size, words in that in which they stand.

        Raises
        ------
        DistributionError
            A point is outside [0, 1), or has no finite quantile, such as 0 of a normal distribution.
        """
        points = np.asarray(u, dtype=np.float64).ravel()
        if not ((points >= 0.0) & (points < 1.0)).all():
            raise DistributionError(f"quantiles of {self.text}: points must be from 0 to below 1")
        if self.name == "choice":
            values, ends = self._slices
            found = np.searchsorted(ends[:-1], points, side="right")
            return [values[n] for n in found]
        law, arguments = self._scipy
        if self._whole:  # to scipy the quantile of 0 is one less than the smallest value
            points = np.maximum(points, SMALLEST)
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            quantiles = np.asarray(law.ppf(points, **arguments), dtype=np.float64)
        if not np.isfinite(quantiles).all():
            raise DistributionError(f"{self.text} has no finite quantile at {points[~np.isfinite(quantiles)][0]:g}")
        return [round(value) for value in quantiles.tolist()] if self._whole else quantiles.tolist()

    def place(self, value: Any) -> float:
        """Return the value of the distribution function; the middle of its step if there is one at the value.

        Raises
        ------
        DistributionError
            The value is no number, or none of the choice.
        """
        if self.name == "choice":
            values, ends = self._slices
            places = [
                n for n, one in enumerate(values) if one == value and isinstance(one, bool) == isinstance(value, bool)
            ]
            if not places:
                raise DistributionError(f"{value!r} is none of {self.text}")
            (n,) = places
            return float(0.5 * ((ends[n - 1] if n else 0.0) + ends[n]))
        if not _is_number(value) or not _is_finite(value):
            raise DistributionError(f"{value!r} is no value of {self.text}")
        law, arguments = self._scipy
        with np.errstate(all="ignore"):
            below = float(law.cdf(value, **arguments))
            step = float(law.pmf(value, **arguments)) if self._whole else 0.0
        return min(max(below - 0.5 * step, 0.0), 1.0)

    @property
    def _slices(self) -> tuple[list[Any], Array]:
        """Values of a choice in the order of their slices of [0, 1], and the slices' upper ends."""
        values = list(self.parameters["values"])
        shares = np.array(self.parameters.get("p", [1.0] * len(values)), dtype=np.float64)
        if self.ordered:
            order = sorted(range(len(values)), key=values.__getitem__)
            values, shares = [values[n] for n in order], shares[order]
        ends = np.cumsum(shares)
        return values, ends / ends[-1]

    @property
    def _scipy(self) -> tuple[Any, dict[str, Any]]:
        """Scipy's distribution, and its parameters."""
        given = dict(self.parameters)
        if self.name == "uniform" and "low" in given:
            low = given.pop("low")
            given = {"loc": low, "scale": given.pop("high") - low}
        elif self.name == "integers":
            given = {"low": given["low"], "high": given["high"] + bool(given.get("endpoint", False))}
        # Whole numbers beyond 2^63 would be objects to numpy.
        return _laws()[_ALIASES.get(self.name, self.name)], {key: float(value) for key, value in given.items()}

    @property
    def _whole(self) -> bool:
        from scipy.stats import rv_discrete

        return isinstance(self._scipy[0], rv_discrete)


def distribution_of(spec: Mapping[str, Any] | str, where: str) -> Distribution:
    """Read and check a distribution.

    Parameters
    ----------
    spec : mapping or str
        A table such as ``{ distribution = "uniform", low = 0.3, high = 1.0 }``, or a text such as ``uniform(low=0.3,
        high=1)`` or ``choice(["elevator", "thrust"], p=[0.7, 0.3])``. Names and parameters are those of the continuous
        and discrete distributions of `scipy.stats`, and: ``normal`` (norm), ``uniform`` with low and high, ``integers``
        (low, high, which is excluded unless ``endpoint`` is true), ``choice`` (values, and p or equal probabilities).
    where : str
        Where it stands, for the errors.

    Raises
    ------
    DistributionError
        The text cannot be read, there is no such distribution, a parameter is unknown, missing or out of its range, or
        quantiles are not finite.
    """
    if isinstance(spec, str):
        name, parameters = _parse(spec, where)
    else:
        parameters = dict(spec)
        name = parameters.pop("distribution", None)
        if not isinstance(name, str):
            raise DistributionError(f'{where}: the name is missing, such as distribution = "uniform"')
    _check_name(name, where)
    if name == "choice":
        return _choice(parameters, where)
    if name == "integers":
        return _integers(parameters, where)
    _check_names_of_parameters(name, parameters, where)
    for key, value in parameters.items():
        if not _is_number(value):
            raise DistributionError(f"{where}: {key} = {value!r} of {name} must be a number")
        if not _is_finite(value):
            raise DistributionError(f"{where}: {key} = {value!r} of {name} must be finite")
    _check_ranges(name, parameters, where)
    found = Distribution(name, parameters)
    _check_quantiles(found, where)
    return found


@functools.cache
def _laws() -> dict[str, Any]:
    """Scipy's distributions by name."""
    from scipy import stats

    kinds = (stats.rv_continuous, stats.rv_discrete)
    return {name: law for name, law in vars(stats).items() if isinstance(law, kinds)}


def _parse(text: str, where: str) -> tuple[str, dict[str, Any]]:
    """Return name and parameters of ``name(parameter=literal, ...)``."""
    wrong = DistributionError(f"{where}: {text!r} must be such as uniform(low=0.3, high=1) or choice([1, 2, 3])")
    try:
        call = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise wrong from None
    if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Name):
        raise wrong
    name = call.func.id
    _check_name(name, where)
    if len(call.args) > (name == "choice"):
        raise DistributionError(f"{where}: the parameters of {name} need their names: {_takes(name)}")
    parameters = {"values": _literal(call.args[0], where)} if call.args else {}
    for keyword in call.keywords:
        if keyword.arg is None:
            raise wrong
        if keyword.arg in parameters:
            raise DistributionError(f"{where}: {keyword.arg} of {name} stands twice")
        parameters[keyword.arg] = _literal(keyword.value, where)
    return name, parameters


class _TomlWords(ast.NodeTransformer):
    """true and false as TOML writes them."""

    def visit_Name(self, node: ast.Name) -> ast.expr:
        return ast.Constant(node.id == "true") if node.id in ("true", "false") else node


def _literal(node: ast.expr, where: str) -> Any:
    text = ast.unparse(node)
    try:
        return ast.literal_eval(_TomlWords().visit(node))
    except (ValueError, TypeError, RecursionError, MemoryError):
        raise DistributionError(f"{where}: {text} must be a number, a word in quotes, or a list of them") from None


def _check_name(name: str, where: str) -> None:
    known = {*_laws(), *_ALIASES, *_OWN_PARAMETERS}
    if name not in known:
        near = difflib.get_close_matches(name.lower(), sorted(known), 3, 0.5) or ["uniform", "normal", "choice"]
        raise DistributionError(f"{where}: there is no distribution {name!r}; near it: {', '.join(near)}")


def _names_of(name: str) -> tuple[list[str], list[str]]:
    """Required and optional parameters."""
    from scipy.stats import rv_continuous

    law = _laws()[_ALIASES.get(name, name)]
    shapes = [shape.strip() for shape in law.shapes.split(",")] if law.shapes else []
    return shapes, ["loc", "scale"] if isinstance(law, rv_continuous) else ["loc"]


def _takes(name: str) -> str:
    """Return the parameters of a distribution as text."""
    if name in _OWN_PARAMETERS:
        return ", ".join(_OWN_PARAMETERS[name])
    required, optional = _names_of(name)
    return "loc, scale, or low, high" if name == "uniform" else ", ".join(required + optional)


def _check_names_of_parameters(name: str, parameters: Mapping[str, Any], where: str) -> None:
    if name in _OWN_PARAMETERS:
        required, optional = list(_OWN_PARAMETERS[name][:-1]), [_OWN_PARAMETERS[name][-1]]
    elif name == "uniform" and {"low", "high"} & parameters.keys():
        required, optional = ["low", "high"], []
    else:
        required, optional = _names_of(name)
    for key in parameters:
        if key not in required + optional:
            raise DistributionError(f"{where}: {name} has no parameter {key!r} here; it takes {_takes(name)}")
    missing = [key for key in required if key not in parameters]
    if missing:
        raise DistributionError(f"{where}: {name} needs {' and '.join(missing)}; it takes {_takes(name)}")


def _check_ranges(name: str, parameters: Mapping[str, Any], where: str) -> None:
    law = _laws()[_ALIASES.get(name, name)]
    if parameters.get("scale", 1) <= 0:
        raise DistributionError(f"{where}: scale = {parameters['scale']!r} of {name} must be greater than 0")
    if "low" in parameters and name == "uniform" and not parameters["low"] < parameters["high"]:
        raise DistributionError(f"{where}: low = {parameters['low']!r} must be less than high = {parameters['high']!r}")
    shapes = _names_of(name)[0]
    if np.isnan(law.support(*(float(parameters[shape]) for shape in shapes))).any():
        given = ", ".join(f"{shape} = {parameters[shape]!r}" for shape in shapes)
        raise DistributionError(f"{where}: there is no {name} with {given}; see scipy.stats.{law.name}")
    from scipy.stats import rv_discrete

    if isinstance(law, rv_discrete) and parameters.get("loc", 0) != int(parameters.get("loc", 0)):
        raise DistributionError(f"{where}: loc = {parameters['loc']!r} of {name} must be a whole number")


def _check_quantiles(found: Distribution, where: str) -> None:
    try:
        values = found.values(_CHECKED)
    except DistributionError as error:
        raise DistributionError(f"{where}: {error}") from None
    except Exception as error:  # whatever a solver of scipy raises for these parameters
        raise DistributionError(f"{where}: quantiles of {found.text} cannot be computed: {error}") from None
    if any(right < left for left, right in itertools.pairwise(values)):
        raise DistributionError(f"{where}: quantiles of {found.text} cannot be computed with enough precision")


def _integers(parameters: dict[str, Any], where: str) -> Distribution:
    _check_names_of_parameters("integers", parameters, where)
    low, high, endpoint = parameters["low"], parameters["high"], parameters.get("endpoint", False)
    for key in ("low", "high"):
        value = parameters[key]
        if isinstance(value, bool) or not isinstance(value, int) or abs(value) > 2**53:
            raise DistributionError(f"{where}: {key} = {value!r} of integers must be a whole number")
    if not isinstance(endpoint, bool):
        raise DistributionError(f"{where}: endpoint = {endpoint!r} of integers must be true or false")
    if low >= high + endpoint:
        hint = "" if endpoint else ", which is excluded unless endpoint = true"
        raise DistributionError(f"{where}: low = {low} of integers must be less than high = {high}{hint}")
    return Distribution("integers", parameters)


def _choice(parameters: dict[str, Any], where: str) -> Distribution:
    _check_names_of_parameters("choice", parameters, where)
    values, p = parameters["values"], parameters.get("p")
    if not _is_list(values) or not values:
        raise DistributionError(f"{where}: values = {values!r} of choice must be a list, such as [1, 2, 3]")
    for value in values:
        if not isinstance(value, bool | str) and not (_is_number(value) and _is_finite(value)):
            raise DistributionError(f"{where}: {value!r} of choice must be a finite number, a word, true or false")
    if len({(isinstance(value, bool), value) for value in values}) < len(values):
        raise DistributionError(f"{where}: values = {values!r} of choice must differ; more of one is said by p")
    if p is None:
        return Distribution("choice", {"values": list(values)})
    if not _is_list(p) or len(p) != len(values):
        raise DistributionError(f"{where}: p = {p!r} of choice must be a list of {len(values)} probabilities")
    for one in p:
        if not _is_number(one) or not 0 <= one <= 1:
            raise DistributionError(f"{where}: {one!r} in p of choice must be a probability from 0 to 1")
    if abs(math.fsum(p) - 1.0) > _SUM:
        raise DistributionError(f"{where}: p = {p!r} of choice adds up to {math.fsum(p):g}; it must be 1")
    return Distribution("choice", {"values": list(values), "p": [float(one) for one in p]})


def _is_list(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number beyond all floats
        return False


def _written(value: Any) -> str:
    """Return a literal that the command line takes."""
    if isinstance(value, bool):
        return str(value).lower()
    if _is_list(value):
        return f"[{', '.join(_written(one) for one in value)}]"
    return repr(value)
