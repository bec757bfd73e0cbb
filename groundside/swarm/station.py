"""Command a running swarm: flight commands, faults, link events and parameters, each acknowledged.

    with Station() as station:
        station.fault(3, "elevator", effectiveness=0.6, bias=0.2)

It speaks MAVLink with the autopilots, like any ground station, and finds their ports in the registry of running swarms.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from ftcc.groundside.swarm.conversation import Conversation, NoAnswerError, RefusedError, StationError, as_float32
from ftcc.link.attacks import KINDS as KINDS_OF_LIES
from ftcc.link.attacks import with_rate
from ftcc.link.failures import KINDS, UNITS, parameter_of
from ftcc.link.flight_modes import code_of, mode_called
from ftcc.link.mavlink import AUTOPILOT, dialect

__all__ = ["ACTUATORS", "NoAnswerError", "RefusedError", "Station", "StationError", "VehicleState", "sizes_of_fault"]

ACTUATORS = {
    "aileron": ("servo", 1),
    "elevator": ("servo", 2),
    "rudder": ("servo", 3),
    "thrust": ("motor", 1),
    "bank": ("servo", 1),
    "load_factor": ("servo", 2),
}
"""MAVLink unit and instance of each actuator; the last two are the inputs of a point mass."""

_NO_LOSS = {"loss": 0.0, "burst_s": 0.0, "burst_e": 1.0, "burst_l": 1.0}

_PARTS = {**ACTUATORS, "position": ("gps", 1), "attitude": ("gyro", 1)}


def sizes_of_fault(what: str, kind: str, given: Mapping[str, float]) -> dict[str, float]:
    """Return all sizes of a fault: a size that is not given has no effect, whatever an earlier fault had.

    Parameters
    ----------
    what, kind : as `Station.fault` takes them.
    given : the sizes by name, as there; ``onset`` is the rate of both effectiveness and bias.

    Raises
    ------
    StationError
        If a fault of an actuator has neither effectiveness nor bias.
    """
    sizes = dict(given)
    actuator = what not in ("position", "attitude")
    onset = sizes.pop("onset", None)
    if actuator and kind in ("wrong", "intermittent"):
        if not {"effectiveness", "eff", "bias"} & set(sizes):
            raise StationError(f"fault {what}: its size is missing; give --effectiveness, --bias or both")
        if "eff" not in sizes:
            sizes.setdefault("effectiveness", 1.0)
        sizes.setdefault("bias", 0.0)
    if actuator and kind == "wrong":
        sizes = {"effectiveness_onset": onset or 0.0, "bias_onset": onset or 0.0} | sizes
    return sizes


def check_attack(kind: str, given: Collection[str]) -> None:
    """Refuse a kind of lie that there is not, and sizes that are missing or that it does not have.

    Raises
    ------
    StationError
    """
    if kind != "none" and kind not in KINDS_OF_LIES:
        raise StationError(f"attack {kind}: no such kind; there are {', '.join(KINDS_OF_LIES)}, and none")
    needs, takes = ((), ()) if kind == "none" else (KINDS_OF_LIES[kind].needs, KINDS_OF_LIES[kind].takes)
    if missing := [name for name in needs if name not in given]:
        raise StationError(f"attack {kind}: needs {', '.join(missing)}")
    if extra := [name for name in given if name not in (*needs, *takes)]:
        listed = ", ".join((*needs, *takes)) or "none"
        raise StationError(f"attack {kind}: takes no {', '.join(extra)}; its sizes: {listed}")


@dataclass
class VehicleState:
    """State that a UAV reports."""

    uav: int
    role: str
    mode: str
    t: float
    """Simulated time, s."""
    altitude: float
    """m."""
    airspeed: float
    """m/s."""
    fault_tolerance: bool | None = None
    """None if the scheme has no fault tolerance to switch."""


class Station(Conversation):
    """A ground station for a running swarm; see `Conversation` for its parameters."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def vehicles(self) -> list[VehicleState | NoAnswerError]:
        """Return the state that each UAV reports, or the error if it does not answer."""
        found: list[VehicleState | NoAnswerError] = []
        for uav in self.uavs:
            try:
                found.append(self.state(uav))
            except NoAnswerError as error:
                found.append(error)
        return found

    def state(self, uav: int) -> VehicleState:
        """Return the state that one UAV reports."""
        beat = self.request(uav, dialect.MAVLINK_MSG_ID_HEARTBEAT)
        place = self.request(uav, dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
        card = self.card(uav)
        speed = math.sqrt(place.vx**2 + place.vy**2 + place.vz**2)
        try:
            tolerant: bool | None = bool(self.get(uav, "FTCC_FT"))
        except RefusedError:
            tolerant = None
        mode = mode_called(beat.custom_mode)
        return VehicleState(uav, card.role, mode, place.time_boot_ms / 1e3, -place.z, speed, tolerant)

    # Faults.

    def fault(
        self,
        uav: int,
        what: str,
        *,
        kind: str = "wrong",
        at: float | None = None,
        **sizes: float,
    ) -> float:
        """Inject a fault of an actuator or of the navigation solution.

        Parameters
        ----------
        what : "aileron", "elevator", "rudder", "thrust", or of a point mass "bank", "load_factor"; or "position",
            "attitude" of the navigation solution.
        kind : "wrong", "off", "stuck", "slow", "intermittent" or "ok".
        at : simulated time, s; None: now.
        sizes : such as ``effectiveness=0.6, bias=0.2``, see ``ftcc.link.failures.SIZES``.

        Returns
        -------
        float
            Simulated time at which the fault takes effect, s.

        Raises
        ------
        NoAnswerError, RefusedError
        """
        if what not in _PARTS:
            raise StationError(f"{what}: cannot fail; parts that can fail are {', '.join(_PARTS)}")
        unit, instance = _PARTS[what]
        return self.inject(uav, unit, kind, instance, at=at, **sizes)

    def repair(self, uav: int, what: str | None = None, *, at: float | None = None) -> None:
        """Remove the fault of one actuator or of the navigation solution, or all faults."""
        if what is not None:
            self.fault(uav, what, kind="ok", at=at)
            return
        for unit, instance in (("servo", 0), ("motor", 1), ("gps", 1), ("gyro", 1)):
            self.inject(uav, unit, "ok", instance, at=at)

    def inject(
        self, uav: int, unit: str, kind: str, instance: int = 0, *, at: float | None = None, **sizes: float
    ) -> float:
        """Send MAV_CMD_INJECT_FAILURE, unit and kind named as in `ftcc.link.failures`; return when it acts, s."""
        if unit not in UNITS or kind not in KINDS:
            raise StationError(f"{unit} {kind}: units are {', '.join(UNITS)}; kinds are {', '.join(KINDS)}")
        scheduled = _ScheduledAt(self, uav, at)
        try:
            parameters = {parameter_of(name): value for name, value in sizes.items()}
        except LookupError as error:
            raise StationError(str(error)) from None
        for name, value in parameters.items():
            as_float32(name, value)
        for name, value in parameters.items():
            self.set(uav, name, value)
        with scheduled:
            ack = self.command(uav, dialect.MAV_CMD_INJECT_FAILURE, UNITS[unit].code, KINDS[kind], instance)
        return float(ack.result_param2) / 1e3

    # Links.

    def cut(self, a: int, b: int | None = None, *, at: float | None = None) -> list[str]:
        """Cut the links between two UAVs, or switch off the radio of one.

        Returns the errors of UAVs that did not accept the command while others did; empty if all accepted.
        """
        if b is None:
            self.inject(a, "radio", "off", at=at)
            return []
        return self._both_ends(a, b, lambda uav, sender: self.inject(uav, "radio", "off", sender, at=at))

    def restore(self, a: int, b: int | None = None, *, at: float | None = None) -> list[str]:
        """Restore the links between two UAVs, or all links and the radio of one; returns errors as `cut`."""
        if b is not None:
            return self._both_ends(a, b, lambda uav, sender: self.inject(uav, "radio", "ok", sender, at=at))
        self.inject(a, "radio", "ok", at=at)
        return self._at_receivers(a, lambda uav: self.inject(uav, "radio", "ok", a, at=at))

    def degrade(self, a: int, b: int | None = None, *, at: float | None = None, **sizes: float) -> list[str]:
        """Degrade the links between two UAVs, or all links of one; returns errors as `cut`.

        ``sizes``: loss, burst_s, burst_e, burst_l (probabilities), delay, jitter (s).
        """
        kinds = {
            "intermittent": {n: v for n, v in sizes.items() if n in ("loss", "burst_s", "burst_e", "burst_l")},
            "delayed": {n: v for n, v in sizes.items() if n == "delay"},
            "slow": {n: v for n, v in sizes.items() if n == "jitter"},
        }
        if not any(kinds.values()):
            raise StationError("degrade: give at least one of loss, burst_s, burst_e, burst_l, delay or jitter")

        def degrade(uav: int, sender: int) -> None:
            for kind, given in kinds.items():
                if given:
                    # Reset the sizes that are not given, which would keep the values of the last command.
                    none = _NO_LOSS if kind == "intermittent" else {}
                    self.inject(uav, "radio", kind, sender, at=at, **(none | given))

        if b is not None:
            return self._both_ends(a, b, degrade)
        degrade(a, 0)
        return self._at_receivers(a, lambda uav: degrade(uav, a))

    def _both_ends(self, a: int, b: int, do: Callable[[int, int], object]) -> list[str]:
        ends = [(u, v) for u, v in ((a, b), (b, a)) if v in self.card(u).in_neighbours]
        if not ends:
            raise StationError(f"there is no link between UAV {a} and UAV {b}")
        return self._each([u for u, _ in ends], lambda uav: do(uav, b if uav == a else a))

    def _at_receivers(self, a: int, do: Callable[[int], object]) -> list[str]:
        return self._each([uav for uav in self.uavs if a in self.card(uav).in_neighbours], do)

    def _each(self, uavs: Iterable[int], do: Callable[[int], object]) -> list[str]:
        """Call ``do`` for each UAV and return the errors; raise the first one if every call fails."""
        failed: list[StationError] = []
        uavs = list(uavs)
        for uav in uavs:
            try:
                do(uav)
            except (NoAnswerError, RefusedError) as error:
                failed.append(error)
        if failed and len(failed) == len(uavs):
            raise failed[0]
        return [str(error) for error in failed]

    # Lies.

    def attack(
        self,
        uav: int,
        kind: str,
        *,
        to: int | None = None,
        victim: int | None = None,
        signals: Sequence[str] = (),
        consistent: bool = True,
        at: float | None = None,
        until: float | None = None,
        **sizes: float,
    ) -> float:
        """Have a UAV lie to its neighbours, in the place of an earlier lie, or tell the truth again.

        Parameters
        ----------
        kind : a name of ``ftcc.link.attacks.KINDS``, or "none": the truth.
        to : who alone hears the lie; None: everybody.
        victim : sybil: in whose name the UAV speaks, to all who hear both.
        signals : names of what is false; by default all shared values that are no rates.
        consistent : False: rates stay true.
        at, until : simulated times, s; None: now, never.
        sizes : ``size``, ``rate``, ``period``, ``delay``, ``onset``: what the kind needs. See `with_rate`.

        Returns
        -------
        float
            Simulated time at which it begins, s.

        Raises
        ------
        NoAnswerError, RefusedError
        """
        given = with_rate(kind, sizes) | ({} if victim is None else {"as": float(victim)})
        check_attack(kind, given)
        if kind == "none" and (until is not None or signals):
            raise StationError("none: ends every lie, and takes no until and no signals")
        if until is not None and until <= (at or 0.0):
            raise StationError(f"until = {until:g}: must be later than the beginning")
        self.card(uav)
        receivers = [one for one in self.uavs if uav in self.card(one).in_neighbours]
        if to is not None and to not in receivers:
            heard = f"UAVs {', '.join(map(str, receivers))} do" if receivers else "nobody does"
            raise StationError(f"UAV {to} does not hear UAV {uav}; {heard}")
        parameters = {"ATK_KIND": float(KINDS_OF_LIES[kind].code if kind in KINDS_OF_LIES else 0)}
        if kind != "none":
            parameters |= {"ATK_UNTIL": 0.0 if until is None else float(_milliseconds(until))}
            parameters |= {"ATK_SIGNALS": float(self._mask(uav, signals)), "ATK_CONSIST": float(consistent)}
            fields = {"size": 0.0, "rate": 0.0, "period": 0.0, "delay": 0.0, "onset": 0.0, "as": 0.0} | given
            known = (*KINDS_OF_LIES[kind].needs, *KINDS_OF_LIES[kind].takes)
            parameters |= {f"ATK_{name.upper()}": fields[name] for name in known}
        for name, value in parameters.items():
            as_float32(name, value)
        if victim is not None:
            both = [one for one in receivers if victim in self.card(one).in_neighbours and to in (None, one)]
            if not both:
                raise StationError(f"as = {victim}: nobody who is asked hears both UAV {uav} and UAV {victim}")
            targets = [(one, uav) for one in both]
        elif to is not None:
            targets = [(to, uav)]
        else:
            # The truth ends also what is false on single edges.
            targets = [(uav, 0), *((one, uav) for one in receivers if kind == "none")]
        began: list[float] = []

        def lie(target: tuple[int, int]) -> None:
            who, instance = target
            for name, value in parameters.items():
                self.set(who, name, value)
            began.append(self.inject(who, "radio", "wrong", instance, at=at))

        by_uav = dict(targets)
        problems = self._each(by_uav, lambda who: lie((who, by_uav[who])))
        if problems:
            raise RefusedError(f"done in part only: {'; '.join(problems)}")
        return max(began)

    def _mask(self, uav: int, signals: Sequence[str]) -> int:
        """What ATK_SIGNALS is for some signals of a UAV."""
        if not signals:
            return 0
        # Imported here: it loads numba, which no other command needs.
        from ftcc.airside.schemes import find

        flown = tomllib.loads((Path(self.entry.folder) / "scenario.toml").read_text(encoding="utf-8"))
        role = self.card(uav).role
        names = [quantity.name for quantity in find(flown["scheme"]).shared.get(role, ())]
        if unknown := [name for name in signals if name not in names]:
            shares = f"it shares {', '.join(names) or 'nothing'}"
            raise StationError(f"signals: UAV {uav}, a {role}, shares no {', '.join(unknown)}; {shares}")
        return sum(1 << names.index(name) for name in set(signals))

    def fault_tolerance(self, uav: int, on: bool) -> None:
        """Switch the fault tolerance of a UAV's law on or off."""
        self.set(uav, "FTCC_FT", float(on))

    # Motion.

    def lead(
        self, uav: int, *, altitude: float | None = None, speed: float | None = None, at: float | None = None
    ) -> None:
        """Command a leader's altitude (m) or speed (m/s), at a simulated time (s) or now."""
        if altitude is None and speed is None:
            raise StationError("a leader needs an altitude or a speed")
        with _ScheduledAt(self, uav, at):
            if altitude is not None:
                frame = dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT
                self.command(uav, dialect.MAV_CMD_DO_CHANGE_ALTITUDE, altitude, frame)
            if speed is not None:
                self.command(uav, dialect.MAV_CMD_DO_CHANGE_SPEED, dialect.SPEED_TYPE_AIRSPEED, speed, -1.0)

    def mode(self, uav: int, mode: str) -> None:
        """Set the flight mode: "mission", "hold" or "offboard"."""
        code = code_of(mode)
        if code is None:
            raise StationError(f"mode {mode}: must be mission, hold or offboard")
        flags = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | dialect.MAV_MODE_FLAG_SAFETY_ARMED
        self.command(uav, dialect.MAV_CMD_DO_SET_MODE, flags, code >> 16 & 0xFF, code >> 24)

    def attitude(self, uav: int, *, bank: float, alpha: float, beta: float = 0.0) -> None:
        """Command the attitude (rad) of a UAV relative to its velocity, for attitude schemes; it does not expire."""
        # Imported here: it loads numba, which no other command needs.
        from ftcc.link.rotation import body_attitude

        place = self.request(uav, dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
        gamma = math.atan2(-place.vz, math.hypot(place.vx, place.vy))
        wanted = body_attitude(math.atan2(place.vy, place.vx), gamma, bank, alpha, beta)
        ignored = (
            dialect.ATTITUDE_TARGET_TYPEMASK_BODY_ROLL_RATE_IGNORE
            | dialect.ATTITUDE_TARGET_TYPEMASK_BODY_PITCH_RATE_IGNORE
            | dialect.ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE
            | dialect.ATTITUDE_TARGET_TYPEMASK_THROTTLE_IGNORE
        )
        target = dialect.MAVLink_set_attitude_target_message(
            0, self.system(uav), AUTOPILOT, ignored, wanted, 0.0, 0.0, 0.0, 0.0
        )
        self.set(uav, "COM_OF_LOSS_T", 0.0)
        self.send(uav, target)
        self.mode(uav, "offboard")
        self.send(uav, target)


class _ScheduledAt:
    """Context manager that holds parameter FTCC_AT at a time while a command is sent."""

    def __init__(self, station: Station, uav: int, at: float | None) -> None:
        self._station, self._uav = station, uav
        self._ms = 0 if at is None else _milliseconds(at)

    def __enter__(self) -> None:
        self._station.set(self._uav, "FTCC_AT", self._ms)

    def __exit__(self, *_: object) -> None:
        if self._ms != 0:
            self._station.set(self._uav, "FTCC_AT", 0)


def _milliseconds(at: float) -> int:
    """Convert a simulated time (s) to whole ms, the unit of MAVLink.

    Raises
    ------
    StationError
        If it is negative, too large, or not a whole number of ms.
    """
    if not 0.0 <= at * 1e3 < 2**31:
        raise StationError(f"at = {at:.10g}: must be a simulated time from 0 to {(2**31 - 1) / 1e3} s")
    ms = round(at * 1e3)
    if abs(at * 1e3 - ms) > 1e-3:
        raise StationError(f"at = {at:.10g} s: must be a whole number of ms")
    return ms
