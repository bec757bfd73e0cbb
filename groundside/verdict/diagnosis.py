"""What diagnosis on board found of the faults that acted: delays, kinds, estimates against the truth, false alarms."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.diagnosis.beliefs import (
    BIAS,
    FAULTY,
    FLOATING,
    KINDS,
    LOSS,
    NO_KIND,
    SENSOR,
    SLOW,
    STATES,
    STUCK,
    UNDETERMINED,
    WRONG,
    belief_signals,
)
from ftcc.airside.spec import is_active
from ftcc.groundside.claims import Signals
from ftcc.link.actuators import in_slots
from ftcc.sim.faults import STUCK as HOLDS
from ftcc.sim.faults import Fault
from ftcc.sim.navigation import WRONG as NAVIGATION_WRONG
from ftcc.sim.navigation import NavigationFault
from ftcc.sim.plants import find

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission

__all__ = [
    "AFTER",
    "SIGMAS",
    "Alarm",
    "FaultFound",
    "columns_diagnosed",
    "false_alarms",
    "fault_onsets",
    "faults_found",
    "is_diagnosed",
    "true_kind",
]

AFTER = 5.0
"""How long after isolation an estimate is compared with the truth, s."""
SIGMAS = 2.0
"""Half width of an estimate's band, in standard deviations."""

_CLOSE = 1e-6
"""Tolerance for equal times, s."""
_SURFACES = ("aileron", "elevator", "rudder")
_NAVIGATION = ("position", "attitude")
"""Parts of the navigation solution, by number."""
_FIRST_OFFSET = NavigationFault._fields.index("first")
_ACTS = re.compile(r"(\w+) (wrong|off|stuck|slow|intermittent|repaired)(?:: (.*))?")
_SIZE = re.compile(r"(\w+) ([^ ,]+)")
"""What an autopilot reports of a failure that acts, see ``airside.gcs.failures``: its part, kind and sizes."""


class Diagnosed(Signals, Protocol):
    """A recording with its mission: a `Flight` or a `Run`."""

    @property
    def mission(self) -> Mission: ...


@dataclass(frozen=True)
class FaultFound:
    """A fault of an actuator, and what its aircraft found of it; times that did not come are nan."""

    uav: int
    actuator: str
    onset: float
    """s."""
    until: float
    """When it was repaired, another fault of this actuator followed, or the recording of this UAV ended, s."""
    true_kind: str
    """A word of ``beliefs.KINDS``."""
    slew: float
    """Fastest motion of a slow actuator, unit/s; inf: no limit of its own."""
    detected: float
    """First alarm for this actuator in this time, s."""
    isolated: float
    """First time after it at which its state was faulty, s."""
    kind: str
    """Found at isolation; "none": not isolated."""
    compared: float
    """When estimates and the truth were compared, s: `AFTER` s after isolation; nan: the fault did not last so long."""
    kind_compared: str
    """Believed then; "none" also where the state was no longer faulty."""
    effectiveness: float
    """Estimate then; nan: not compared, here and below."""
    effectiveness_sd: float
    bias: float
    bias_sd: float
    true_effectiveness: float
    """Then; where nothing was compared, at the end of this fault."""
    true_bias: float

    @property
    def detection_delay(self) -> float:
        """From onset to detection, s; nan: not detected."""
        return self.detected - self.onset

    @property
    def isolation_delay(self) -> float:
        """From onset to isolation, s; nan: not isolated."""
        return self.isolated - self.onset

    @property
    def determined(self) -> bool:
        """Whether the state was faulty when estimates were compared."""
        return self.kind_compared != KINDS[NO_KIND]

    @property
    def effectiveness_error(self) -> float:
        """Estimate less truth; nan: not compared."""
        return self.effectiveness - self.true_effectiveness

    @property
    def bias_error(self) -> float:
        """Estimate less truth, in the unit of the actuator; nan: not compared."""
        return self.bias - self.true_bias

    @property
    def effectiveness_covered(self) -> bool:
        """Whether the truth lay in the band of `SIGMAS` standard deviations; False where nothing was compared."""
        return abs(self.effectiveness_error) <= SIGMAS * self.effectiveness_sd

    @property
    def bias_covered(self) -> bool:
        """Whether the truth lay in the band of `SIGMAS` standard deviations; False where nothing was compared."""
        return abs(self.bias_error) <= SIGMAS * self.bias_sd


@dataclass(frozen=True)
class Alarm:
    """An alarm for an actuator that had no fault when it began."""

    uav: int
    actuator: str
    begin: float
    """s."""
    until: float
    """When the state was healthy or suspected again, or the recording of this UAV ended, s."""
    state: str
    """The most severe one, a word of ``beliefs.STATES``."""
    kind: str
    """The last one believed, a word of ``beliefs.KINDS``; "none": it was not isolated."""
    amid: tuple[str, ...]
    """What else of this UAV was faulty when it began: actuators, and "navigation"."""


class _Change(NamedTuple):
    """A fault or a repair at a time (s)."""

    time: float
    part: str
    """An actuator, or one of `_NAVIGATION`."""
    kind: int
    """Index into ``beliefs.KINDS``; 0: repaired."""
    slew: float = math.inf


class _Acting(NamedTuple):
    """A fault from its onset to its end, s."""

    onset: float
    until: float
    kind: int
    slew: float


def is_diagnosed(mission: Mission) -> bool:
    """Return whether the aircraft of a mission diagnose their actuators."""
    return is_active(mission.autopilots)


def columns_diagnosed(mission: Mission) -> frozenset[str]:
    """Return the recorded columns that `faults_found` and `false_alarms` need in a flight of this mission."""
    actuators = _actuators(mission)
    true = (f"{actuator}_{what}" for actuator in actuators for what in ("effectiveness", "bias"))
    shown = {quantity.name for quantity in mission.signals}
    return frozenset(q.name for q in belief_signals(actuators) if q.name in shown).union(true)


def true_kind(fault: Fault) -> int:
    """Return the kind of a fault, index into ``beliefs.KINDS``; 0 for a repair.

    An actuator without effectiveness that has a bias holds still, as one that is stuck.
    """
    if int(fault.kind) == HOLDS or (fault.effectiveness == 0.0 and fault.bias != 0.0):
        return STUCK
    if fault.effectiveness == 0.0:
        return FLOATING
    if fault.effectiveness != 1.0:
        return LOSS if fault.bias == 0.0 else WRONG
    if fault.bias != 0.0:
        return BIAS
    return SLOW if math.isfinite(fault.slew) else NO_KIND


def faults_found(recording: Diagnosed, events: Iterable[Mapping[str, Any]] = ()) -> tuple[FaultFound, ...]:
    """Return the faults of diagnosed actuators that acted in a flight, by UAV, actuator and onset.

    A fault is detected when the state of its actuator becomes undetermined or faulty between its onset and its end, or
    when an alarm that stands is raised anew.

    Parameters
    ----------
    recording : Flight or Run
        With the columns of `columns_diagnosed`; without diagnosis nothing is found.
    events : iterable of mapping
        The event log of a run (``Run.events``), which names the faults that were injected in flight.
    """
    return tuple(
        _found(recording, uav, actuator, fault)
        for uav, faults in _faults(recording, events)
        for actuator in _actuators(recording.mission)
        for fault in faults[actuator]
    )


def false_alarms(recording: Diagnosed, events: Iterable[Mapping[str, Any]] = ()) -> tuple[Alarm, ...]:
    """Return the alarms for actuators that had no fault when they began, by UAV, actuator and time.

    Parameters as of `faults_found`. A navigation fault makes no alarm for an actuator true, see ``Alarm.amid``.
    """
    return tuple(
        alarm
        for uav, faults in _faults(recording, events)
        for actuator in _actuators(recording.mission)
        for alarm in _alarms(recording, uav, actuator, faults)
    )


def fault_onsets(mission: Mission, events: Iterable[Mapping[str, Any]] = ()) -> tuple[tuple[float, int, str], ...]:
    """Return time (s), UAV and part (an actuator, "position" or "attitude") of every fault, in order of time.

    Parameters
    ----------
    mission : Mission
        With the faults of its scenario.
    events : iterable of mapping
        The event log of a run, which names the faults that were injected in flight.
    """
    changes = [(spec.uav, change) for spec in mission.vehicles for change in _planned(mission, spec.uav)]
    changes += [(event["uav"], change) for event in events for change in _injected(event)]
    return tuple(sorted((change.time, uav, change.part) for uav, change in changes if change.kind != NO_KIND))


def _alarms(recording: Diagnosed, uav: int, actuator: str, faults: Mapping[str, Sequence[_Acting]]) -> Iterator[Alarm]:
    """Yield the alarms for an actuator that began without a fault of it."""
    t = recording.column("t", uav)
    state, kind = (recording.column(f"{name}_{actuator}", uav) for name in ("health", "kind"))
    alarmed = state >= UNDETERMINED
    for begin in np.flatnonzero(alarmed & ~np.concatenate(([False], alarmed[:-1]))).tolist():
        faulty = [part for part, acting in faults.items() if _in_force(acting, float(t[begin]))]
        if actuator in faulty:
            continue
        calm = np.flatnonzero(~alarmed[begin:])
        end = begin + int(calm[0]) if len(calm) else len(t)
        named = kind[begin:end][kind[begin:end] != NO_KIND]
        yield Alarm(
            uav,
            actuator,
            float(t[begin]),
            float(t[min(end, len(t) - 1)]),
            STATES[int(state[begin:end].max())],
            KINDS[int(named[-1]) if len(named) else NO_KIND],
            tuple(faulty),
        )


def _found(recording: Diagnosed, uav: int, actuator: str, fault: _Acting) -> FaultFound:
    """Return what a UAV found of one of its faults."""

    def read(name: str) -> NDArray[np.float64]:
        return recording.column(f"{name}_{actuator}", uav)

    t, state, kind = recording.column("t", uav), read("health"), read("kind")
    begin = int(np.searchsorted(t, fault.onset - _CLOSE))
    # A row at its end belongs to what follows, if anything does.
    end = len(t) if fault.until >= t[-1] else int(np.searchsorted(t, fault.until - _CLOSE))
    before = np.concatenate(([0.0], state[:-1]))
    raised = (state >= UNDETERMINED) & ((before < UNDETERMINED) | (read("evidence") >= 1.0) | (state < before))
    detected = _first(raised, begin, end)
    isolated = _first(state == FAULTY, detected, end) if detected is not None else None
    compared = None
    if isolated is not None and t[isolated] + AFTER <= t[end - 1] + _CLOSE:
        compared = int(np.searchsorted(t, t[isolated] + AFTER - _CLOSE))
    names = ("effectiveness_hat", "effectiveness_sd", "bias_hat", "bias_sd")
    estimates = [math.nan if compared is None else float(read(name)[compared]) for name in names]
    known = compared if compared is not None else end - 1
    still = compared is not None and state[compared] == FAULTY
    return FaultFound(
        uav,
        actuator,
        fault.onset,
        fault.until,
        KINDS[fault.kind],
        fault.slew,
        math.nan if detected is None else float(t[detected]),
        math.nan if isolated is None else float(t[isolated]),
        KINDS[NO_KIND if isolated is None else int(kind[isolated])],
        math.nan if compared is None else float(t[compared]),
        KINDS[int(kind[compared]) if still and compared is not None else NO_KIND],
        *estimates,
        *(float(recording.column(f"{actuator}_{what}", uav)[known]) for what in ("effectiveness", "bias")),
    )


def _first(there: NDArray[np.bool_], begin: int, end: int) -> int | None:
    rows = np.flatnonzero(there[begin:end])
    return begin + int(rows[0]) if len(rows) else None


def _in_force(faults: Iterable[_Acting], time: float) -> bool:
    return any(fault.onset - _CLOSE <= time < fault.until - _CLOSE for fault in faults)


def _actuators(mission: Mission) -> tuple[str, ...]:
    """Return the diagnosed actuators; those of the first follower are those of all."""
    return next((spec.diagnosis.actuators for spec in mission.autopilots if spec.diagnosis.on), ())


def _faults(
    recording: Diagnosed, events: Iterable[Mapping[str, Any]]
) -> Iterator[tuple[int, dict[str, list[_Acting]]]]:
    """Yield, for each UAV with diagnosis and rows, the faults of its diagnosed actuators and of `_NAVIGATION`."""
    mission = recording.mission
    followers = {spec.uav for spec in mission.autopilots if spec.diagnosis.on and spec.role == "follower"}
    injected = [(event["uav"], change) for event in events for change in _injected(event)]
    for uav in recording.uavs:
        t = recording.column("t", uav) if uav in followers else np.empty(0)
        if not len(t):
            continue
        changes = [*_planned(mission, uav), *(change for whose, change in injected if whose == uav)]
        changes.sort(key=lambda change: change.time)
        acting = {part: _lasting(changes, part, float(t[-1])) for part in (*_actuators(mission), *_NAVIGATION)}
        navigation = [fault for part in _NAVIGATION for fault in acting.pop(part)]
        yield uav, acting | {"navigation": navigation}


def _lasting(changes: Iterable[_Change], part: str, end: float) -> list[_Acting]:
    """Return the faults of a part until the ``end`` of a recording, s: each lasts until the next change of it."""
    own = [change for change in changes if change.part == part and change.time <= end]
    ends = (*(change.time for change in own[1:]), end)
    return [
        _Acting(change.time, until, change.kind, change.slew)
        for change, until in zip(own, ends, strict=False)
        if change.kind != NO_KIND and until > change.time
    ]


def _planned(mission: Mission, uav: int) -> Iterator[_Change]:
    """Yield what the scenario changes of a UAV."""
    spec = next(spec for spec in mission.vehicles if spec.uav == uav)
    names = in_slots(find(mission.plant).ACTUATORS)
    for fault in spec.faults:
        yield _Change(fault.time, names[int(fault.actuator)], true_kind(fault), fault.slew)
    for wrong in spec.navigation_faults:
        # A repair is a wrong solution without offsets.
        repaired = int(wrong.kind) == NAVIGATION_WRONG and not any(wrong[_FIRST_OFFSET:])
        yield _Change(wrong.time, _NAVIGATION[int(wrong.part)], NO_KIND if repaired else SENSOR)


def _injected(event: Mapping[str, Any]) -> Iterator[_Change]:
    """Yield what a failure that was injected in flight changes, from the event that reports that it acts."""
    words = _ACTS.fullmatch(str(event["text"])) if event.get("outcome") == "acts" else None
    if words is None:
        return
    what, kind, listed = words.groups()
    sizes = dict(_SIZE.findall(listed or ""))
    time = float(event["t"])
    if what in _NAVIGATION:
        yield _Change(time, what, NO_KIND if kind == "repaired" else SENSOR)
        return
    slew = float(sizes.get("slew", math.inf))
    fault = Fault(time, 0.0, float(sizes.get("eff", 1.0)), float(sizes.get("bias", 0.0)), 0.0, 0.0, slew=slew)
    if kind == "off":
        fault = fault._replace(effectiveness=0.0)
    elif kind == "stuck":
        fault = fault._replace(kind=HOLDS)
    for actuator in _SURFACES if what == "surfaces" else (what,):
        yield _Change(time, actuator, true_kind(fault), slew)
