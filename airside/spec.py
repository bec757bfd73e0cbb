"""The specification of an autopilot, which its process gets at its start: plain, frozen, checked before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ftcc.airside.attacks.attack import Attack
from ftcc.airside.model import Model
from ftcc.airside.references.profiles import Profile
from ftcc.airside.scheme import Flight
from ftcc.link.actuators import ACTUATORS
from ftcc.link.attitude_target import UNCODED, AttitudeCode
from ftcc.link.channel import Channel

__all__ = ["AutopilotSpec", "DefenceSpec", "DiagnosisSpec", "LinkEvent", "Neighbour", "OwnReference", "is_active"]


@dataclass(frozen=True)
class Neighbour:
    """An in-edge of the graph: an in-neighbour of this UAV."""

    uav: int
    weight: float
    briefing: tuple[float, ...] = ()
    """Its shared values at t = 0, where they are known before its first record; else empty."""


@dataclass(frozen=True)
class LinkEvent:
    """A change of the radio, from a simulated time on."""

    at_us: int
    sender: int | None
    """The in-edge's sender; None: this UAV's own radio."""
    channel: Channel
    """The quality from then on; of the own radio only ``blocked`` counts."""


@dataclass(frozen=True)
class OwnReference:
    """A UAV's own reference; the module of its plant in `references` defines what the numbers mean."""

    initial: tuple[float, ...]
    """The ``Reference`` at t = 0."""
    parameters: tuple[float, ...] = ()
    commands: tuple[tuple[float, ...], ...] = ()
    """In order of time (s), which each begins with."""


@dataclass(frozen=True)
class DiagnosisSpec:
    """Active fault tolerance of one UAV, and the nominal actuators that it is judged by."""

    on: bool = False
    accommodates: bool = False
    """Whether the own law is told of known faults."""
    cooperates: bool = False
    """Whether the swarm makes room for a UAV that can do less."""
    gains: tuple[float, ...] = ()
    """In the order of `DiagnosisGains`."""
    actuators: tuple[str, ...] = ()
    """Those of the aircraft that a command moves."""
    lag: tuple[float, ...] = (0.0,) * len(ACTUATORS)
    """By slot, nominal bandwidth of the actuators, rad/s; 0 = none."""
    damping: tuple[float, ...] = (0.0,) * len(ACTUATORS)
    """By slot, nominal damping of second-order ones; 0 = first order."""


@dataclass(frozen=True)
class DefenceSpec:
    """Defences of one UAV against neighbours that share what is not so."""

    on: bool = False
    gains: tuple[float, ...] = ()
    """In the order of `DefenceGains`."""
    trusted: tuple[int, ...] = ()
    """Ids of those who are trusted whatever they tell."""
    leaders: tuple[int, ...] = ()
    """Ids of the swarm's leaders: they share other values than followers."""


@dataclass(frozen=True)
class AutopilotSpec:
    """One autopilot."""

    uav: int
    role: str
    """"follower" or "leader"."""
    scheme: str
    gains: tuple[float, ...]
    """In the order of the scheme's ``Gains``."""
    model: Model
    command: tuple[float, ...]
    """Command at the start (rad, N), by slot; it stays in force for actuators that the law does not command."""
    travel: tuple[float, ...]
    """Full deflection of each actuator (rad, N), by which commands are divided on the wire."""
    reference: OwnReference
    neighbours: tuple[Neighbour, ...]
    channel: Channel
    """Quality of every in-edge at the start."""
    link_events: tuple[LinkEvent, ...] = ()
    """In order of time."""
    profile: Profile | None = None
    """A leader's."""
    offset: float = 0.0
    """Lateral position, m."""
    datum: float = 0.0
    """Altitude from which that in the vehicle's messages counts, m."""
    course: float | None = None
    """Course that `lateral_hold` keeps for a law that commands no aileron and rudder, rad; None: there is none."""
    attitude_code: AttitudeCode = UNCODED
    """Whether and how commands travel as attitude targets."""
    receivers: tuple[int, ...] = ()
    """Ids of its out-neighbours."""
    tolerant_gains: tuple[float, ...] = ()
    """The same with fault tolerance on, where ``gains`` has it off."""
    diagnosis: DiagnosisSpec = DiagnosisSpec()
    defence: DefenceSpec = DefenceSpec()
    attacks: tuple[Attack, ...] = ()
    """Lies of this UAV, and on its in-edges."""
    authenticated: bool = False
    """Whether nobody can speak in the name of another UAV: records are signed."""
    flight: Flight | None = None
    """What the scheme's conditions on gains are checked against, also in flight; None: no check."""

    def edge_from(self, sender: int) -> int:
        """Index of the in-edge from a neighbour.

        Raises
        ------
        ValueError
            If it is no in-neighbour of this UAV.
        """
        return [neighbour.uav for neighbour in self.neighbours].index(sender)


def is_active(specs: Sequence[AutopilotSpec]) -> bool:
    """Whether any of the autopilots of a swarm has active fault tolerance: it diagnoses its actuators."""
    return any(spec.diagnosis.on for spec in specs)
