"""What a scheme (control law) is made of: the vocabulary that scheme files use and the rest of the product reads."""

from __future__ import annotations

import functools
import importlib
import importlib.util
import math
import re
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType, ModuleType
from typing import Any, Literal, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.law_checks import find_mistakes, shown_path, similar
from ftcc.airside.ranges import Range
from ftcc.airside.references.longitudinal import Reference
from ftcc.link.compiled import width
from ftcc.link.graph import Assumption, Graph

__all__ = [
    "FAULT_TOLERANCE",
    "FOLLOWED",
    "LARGEST_COMMAND",
    "LARGEST_STATE",
    "Flight",
    "Heard",
    "Problem",
    "Quantity",
    "Reference",
    "Role",
    "Scheme",
    "SchemeError",
    "quantities",
    "rates_of",
]


FAULT_TOLERANCE = "fault_tolerance"
"""The switch that the ground may throw in flight; a scheme without it has nothing to switch off."""


@dataclass(frozen=True)
class Quantity:
    """Name, unit and meaning of a number; used as annotation of gains and states and to list signals.

    ``published`` is the monograph's value of a gain, None where the monograph has none. ``bound`` names the signal
    (or gives the constant) that limits this one, for display. ``follows`` names what of the mission a gain follows
    unless it is given, see `FOLLOWED`. ``role`` is what a signal is to those who plot and judge it; None: as its
    ``meaning`` says, see `shown_as`. ``rate_of`` names the quantity of which this one is the rate, among the values
    that are shared with it, see `rates_of`.
    """

    name: str
    unit: str
    meaning: str = ""
    published: float | None = None
    bound: float | str | None = None
    follows: str = ""
    role: Role | None = None
    rate_of: str = ""

    @property
    def shown_as(self) -> Role:
        """The role that dashboard, report and verdict go by: the declared one, or the one its ``meaning`` names."""
        if self.role is not None:
            return self.role
        found = (role for role, words in _ROLE_WORDS.items() if re.search(words, self.meaning))
        return next(found, "plain")


Role = Literal["error", "estimate", "adapted", "reference", "plain"]
"""What a signal is to those who plot and judge it."""
_ROLE_WORDS: dict[Role, str] = {
    "error": r"error",
    "estimate": r"^(estimated (disturbance|effect|lumped)|unexplained)",
    "adapted": r"network|adapted|weights",
    "reference": r"^reference,",
}
"""By role, the words in a meaning that stand for it where none is declared; the first that fits."""

LARGEST_COMMAND, LARGEST_STATE = 1e30, 1e12
"""Beyond these a command or shared value, and a state of a law, count as not finite.

A larger command would not fit a float32 as a fraction of its travel. No quantity of an aircraft is as large as such a
state: it grows without end, and is reported before it is inf.
"""

FOLLOWED = {"leaders.z": "mean altitude of the leaders at the start, m"}
"""What gains may follow."""


class Heard(NamedTuple):
    """What a UAV has heard of its n neighbours, a row each."""

    values: NDArray[np.float64]
    """(n, m): shared values of the newest usable record, in the order of ``SHARED``."""
    age: NDArray[np.float64]
    """(n,): present time minus stamp, s, never negative."""
    valid: NDArray[np.float64]
    """(n,): 1 once the neighbour has been heard."""
    weight: NDArray[np.float64]
    """(n,): a_ij."""
    trust: NDArray[np.float64]
    """(n, m): share of its weight that the defences leave each value; 1 while nothing is doubted."""


@dataclass(frozen=True)
class Flight:
    """What is known before take-off, for a scheme's ``check``."""

    graph: Graph
    period: float
    """Control period, s."""
    exchange_period: float
    """s."""
    latency: float
    """Link latency, s."""
    leader_climb: float
    """Largest abs(climb rate) of the leaders' profiles, m/s."""
    leader_speed_varies: bool
    """Whether a leader ever flies at another speed than the mission's, which followers know."""
    leader_acceleration: float = 0.0
    """Largest acceleration of the leaders' profiles along either axis, m/s^2."""
    initial: Mapping[int, Reference] = field(default_factory=dict)
    """Initial speed and altitude of each follower, by id."""
    initial_errors: Mapping[int, tuple[float, float, float]] = field(default_factory=dict)
    """Where UAVs refer to an attitude of their own: the error of each in bank, alpha and sideslip at the start, rad."""


class Problem(NamedTuple):
    """A finding of a check: ``fatal`` ones refuse the flight, others warn."""

    fatal: bool
    text: str


@functools.cache
def quantities(record: Any) -> Mapping[str, Quantity]:
    """The `Quantity` that annotates each field of the NamedTuple class ``record``, by field name."""
    found = {}
    for name, hint in get_type_hints(record, include_extras=True).items():
        for note in getattr(hint, "__metadata__", ()):
            if isinstance(note, Quantity):
                found[name] = note
    return MappingProxyType(found)


def rates_of(shared: Sequence[Quantity]) -> tuple[int, ...]:
    """For each of the values that are shared, the column of which it is the rate; -1: it is the rate of none.

    Raises
    ------
    ValueError
        For the rate of what is not shared, or of itself.
    """
    columns = {quantity.name: column for column, quantity in enumerate(shared)}
    for quantity in shared:
        if quantity.rate_of and (quantity.rate_of not in columns or quantity.rate_of == quantity.name):
            raise ValueError(
                f"{quantity.name} is called the rate of {quantity.rate_of!r}; shared beside it are "
                f"{', '.join(name for name in columns if name != quantity.name) or 'no others'}"
            )
    return tuple(columns.get(quantity.rate_of, -1) for quantity in shared)


_REQUIRED = ("Gains", "State", "Output", "SHARED", "GRAPH", "COMMANDS", "start", "step", "share")
_DEFAULTS: dict[str, Any] = {
    "PLANT": "longitudinal",
    "FORMS": {"flight": {}},
    "SWITCHES": {},
    "RANGES": {},
    "check": lambda gains, flight: [],
    "climb_limit": lambda gains: math.inf,
    "command_limits": lambda gains: {},
}
"""What a file that does not say otherwise means."""


class SchemeError(TypeError):
    """A file that is no scheme; the text says what it lacks."""


@dataclass(frozen=True)
class Scheme:
    """A scheme file, checked for completeness; what it leaves out has its default."""

    name: str
    module: ModuleType

    def __post_init__(self) -> None:
        missing = [name for name in _REQUIRED if not hasattr(self.module, name)]
        # Either both, or neither: then all states and outputs are shown.
        if hasattr(self.module, "SIGNALS") != hasattr(self.module, "observe"):
            missing += [name for name in ("SIGNALS", "observe") if not hasattr(self.module, name)]
        if missing:
            raise SchemeError(f"scheme {self.name} ({self.module.__name__}) lacks {', '.join(missing)}")
        self._require_quantities("gains", self.gains_type, self.gains_type._fields)
        if not hasattr(self.module, "SIGNALS"):
            self._require_quantities("states", self.module.State, self.module.State._fields)
            self._require_quantities("outputs", self.module.Output, self._shown)
            if any(width(record) != len(record._fields) for record in (self.module.State, self.module.Output)):
                raise SchemeError(
                    f"scheme {self.name}: states or outputs hold vectors; say with SIGNALS what is recorded"
                )
        for role, shared in self.shared.items():
            try:
                rates_of(shared)
            except ValueError as error:
                raise SchemeError(f'scheme {self.name}: SHARED["{role}"]: {error}') from None
        if mistakes := find_mistakes(self.module, Heard):
            raise SchemeError("; ".join(mistakes))

    def _require_quantities(self, kind: str, record: Any, names: Sequence[str]) -> None:
        missing = [name for name in names if name not in quantities(record)]
        if missing:
            raise SchemeError(f"scheme {self.name}: {kind} {', '.join(missing)} have no Quantity")

    @property
    def _shown(self) -> tuple[str, ...]:
        """The outputs that are no commands."""
        return self.module.Output._fields[len(self.commands) :]  # type: ignore[no-any-return]

    def _declared(self, name: str) -> Any:
        return getattr(self.module, name, _DEFAULTS[name])

    def __reduce__(self) -> tuple[Any, ...]:
        """To another process a scheme goes by name: its functions are there already."""
        return load, (self.name, self.module.__name__)

    @property
    def title(self) -> str:
        return (self.module.__doc__ or self.name).strip().splitlines()[0].rstrip(".")

    @property
    def gains_type(self) -> Any:
        return self.module.Gains

    @property
    def graph(self) -> Assumption:
        return self.module.GRAPH  # type: ignore[no-any-return]

    @property
    def plant(self) -> str:
        return self._declared("PLANT")  # type: ignore[no-any-return]

    @property
    def commands(self) -> tuple[str, ...]:
        return self.module.COMMANDS  # type: ignore[no-any-return]

    @property
    def shared(self) -> dict[str, tuple[Quantity, ...]]:
        return self.module.SHARED  # type: ignore[no-any-return]

    @property
    def signals(self) -> tuple[Quantity, ...]:
        """``SIGNALS``; without it all states, then the outputs behind the commands."""
        if hasattr(self.module, "SIGNALS"):
            return self.module.SIGNALS  # type: ignore[no-any-return]
        states, outputs = quantities(self.module.State), quantities(self.module.Output)
        return (*states.values(), *(outputs[name] for name in self._shown))

    @property
    def tracking(self) -> tuple[Quantity, ...]:
        """``TRACKING``: what the law shall make small, as expressions over recorded columns.

        ``bound`` is the size (or the signal) up to which one counts as small. Without it: the signals that are called a
        tracking error, by their own bounds.
        """
        if hasattr(self.module, "TRACKING"):
            return self.module.TRACKING  # type: ignore[no-any-return]
        return tuple(signal for signal in self.signals if "tracking error" in signal.meaning)

    @property
    def forms(self) -> dict[str, dict[str, float]]:
        return self._declared("FORMS")  # type: ignore[no-any-return]

    @property
    def switches(self) -> dict[str, dict[str, float]]:
        return self._declared("SWITCHES")  # type: ignore[no-any-return]

    @property
    def briefed(self) -> bool:
        """Whether every UAV knows how its neighbours move at t = 0, before it hears them."""
        return bool(getattr(self.module, "BRIEFED", False))

    @property
    def carries(self) -> bool:
        """Whether the law carries neighbours' values to the present by the rates told with them; else it holds them."""
        return bool(getattr(self.module, "CARRIES", True))

    @property
    def shared_width(self) -> int:
        return max(len(row) for row in self.shared.values())

    @property
    def climb_limit(self) -> Callable[..., float]:
        """Of some gains: the climb rate of a leader, m/s, that estimates can just follow."""
        return self._declared("climb_limit")  # type: ignore[no-any-return]

    @property
    def command_limits(self) -> Callable[..., dict[str, tuple[float, float]]]:
        """Of some gains: the least and largest command that the law itself gives, by actuator."""
        return self._declared("command_limits")  # type: ignore[no-any-return]

    @property
    def ranges(self) -> dict[str, Range]:
        """By gain: the values that it may take; a gain that is not there may take any that is finite."""
        return {name: allowed for allowed, names in self._declared("RANGES").items() for name in names.split()}

    def check(self, gains: Any, flight: Flight) -> list[Problem]:
        """What is wrong with gains: their ranges, and if nothing is, the scheme's own conditions."""
        ranges = self.ranges
        problems = [
            Problem(True, f"gain {name} = {value:g}: {refusal}")
            for name, value in gains._asdict().items()
            if name in ranges and (refusal := ranges[name].refusal(value))
        ]
        return problems or [*self._untried(gains), *self._declared("check")(gains, flight)]

    def _untried(self, gains: Any) -> list[Problem]:
        known, ranges = quantities(self.gains_type), self.ranges
        found = []
        for name, value in gains._asdict().items():
            values = (known[name].published, *(form.get(name) for form in self.forms.values()))
            flown = [one for one in values if one is not None]
            remark = ranges[name].remark(value, flown) if name in ranges else ""
            if remark:
                found.append(Problem(False, f"gain {name} = {value:g}: {remark}"))
        return found

    def gains(
        self, form: str, overrides: Mapping[str, float], followed: Mapping[str, float] = MappingProxyType({})
    ) -> Any:
        """The gains of a form with overrides: published values, then the form's own, then ``overrides``.

        A gain that follows one of ``followed`` (see `FOLLOWED`) takes its value from there, unless it is overridden.

        Raises
        ------
        ValueError
            For an unknown form or gain, a value that is not finite, or a gain that nobody gave a value.
        """
        if form not in self.forms:
            raise ValueError(f"scheme {self.name} has no form {form!r}; it has {', '.join(self.forms)}")
        known = quantities(self.gains_type)
        values = {name: note.published for name, note in known.items()} | self.forms[form]
        for name, note in known.items():
            if note.follows in followed:
                values[name] = followed[note.follows]
        for name, value in overrides.items():
            if name not in known:
                raise ValueError(f"scheme {self.name} has no gain {name!r}; {similar(name, known)}")
            if not math.isfinite(value):
                raise ValueError(f"gain {name} = {value}: must be a finite number")
            values[name] = value
        unset = [name for name, value in values.items() if value is None]
        if unset:
            raise ValueError(f"gains {', '.join(unset)} have no published value and must be given")
        return self.gains_type(**{name: float(value) for name, value in values.items() if value is not None})


def load(name: str, module: str) -> Scheme:
    """Import a scheme's module and check it.

    Raises
    ------
    SchemeError
        With file and line where it cannot be imported, or with what it lacks.
    """
    try:
        imported = importlib.import_module(module)
    except SyntaxError as error:
        raise SchemeError(f"{shown_path(error.filename or module)}:{error.lineno}: {error.msg}") from None
    except Exception as error:
        raise SchemeError(f"{_place_of_import_error(error, module)}: {type(error).__name__}: {error}") from error
    return Scheme(name, imported)


def _place_of_import_error(error: Exception, module: str) -> str:
    """Where a module that was imported raised an error: the last of its own lines."""
    spec = importlib.util.find_spec(module) if "." not in module else None
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if spec is not None and frame.filename == spec.origin]
    if not own:
        own = [frame for frame in frames if "importlib" not in frame.filename and frame.filename != __file__]
    return f"{shown_path(own[-1].filename)}:{own[-1].lineno}" if own else f"module {module}"
