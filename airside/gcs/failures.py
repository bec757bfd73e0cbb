"""Failures that the ground asks for: checked, passed on to the vehicle or the radio links, reported when they act."""

from __future__ import annotations

import heapq
import math
import time
from typing import Any, NamedTuple

from ftcc.airside.attacks.attack import FOR_EVER
from ftcc.airside.flight_path import Own
from ftcc.airside.gcs.answers import ACCEPTED, BUSY, DENIED, UNSUPPORTED, Answer, Request
from ftcc.airside.gcs.attacks import begin_lie
from ftcc.airside.gcs.autopilot_view import AutopilotView
from ftcc.airside.gcs.outbox import Outbox
from ftcc.airside.link_events import OWN_RADIO
from ftcc.airside.link_events import inject as inject_link_event
from ftcc.airside.model import Model, level_deflections
from ftcc.link.actuators import ACTUATORS, SLOT, in_slots
from ftcc.link.channel import Channel
from ftcc.link.compiled import fields
from ftcc.link.failures import AIRFRAME_SIZES, EVERY, LINK_SIZES, Meaning, failure_messages, meaning_of, parts_of
from ftcc.link.mavlink import dialect

__all__ = ["Failures"]

_VEHICLE_TIMEOUT = 0.2
"""Wall time that a vehicle has to answer, s."""
_NEVER = 2**62
"""Beyond every simulated time, us."""
_FAILED = dialect.MAV_RESULT_FAILED


class _Awaited(NamedTuple):
    """What the vehicle was asked, and has not answered yet."""

    request: Request
    meaning: Meaning
    instance: int
    until: float
    """Wall time, s (monotonic)."""


class Failures:
    """The failures of one UAV, on their way."""

    def __init__(self, view: AutopilotView, outbox: Outbox) -> None:
        self._view = view
        self._outbox = outbox
        self._waiting: _Awaited | None = None
        self._names = in_slots(self._view.scheme.commands)
        """The actuators by slot, as this kind of aircraft has them."""
        self._armed: list[tuple[int, int, str, str, str]] = []
        """What will act: time us, number, severity, text, who."""
        self._count = 0

    @property
    def waiting(self) -> bool:
        """Whether the vehicle still owes an answer."""
        return self._waiting is not None

    def inject(self, request: Request) -> Answer | None:
        """Arm a failure; None: the answer comes when the vehicle has given its own."""
        unit, kind, number, *_ = request.parameters
        meaning = meaning_of(unit, kind, number)
        if meaning is None:
            return Answer(UNSUPPORTED)
        if not self._view.failures_enabled:
            return Answer(DENIED, "SYS_FAILURE_EN is 0")
        at_us, why = self._view.acting_time()
        if why:
            return Answer(DENIED, why)
        instance = int(number)
        if meaning.kind == "wrong" and not meaning.unit.on_board:
            return self._lie(request, instance, at_us)
        if not meaning.unit.on_board:
            return self._fail_link(request, meaning, instance, at_us)
        if self._view.leader:
            return Answer(DENIED, "a leader is a reference point: it has no parts")
        missing = self._missing(meaning, instance)
        if missing:
            return Answer(UNSUPPORTED, missing)
        if self._waiting is not None:
            return Answer(BUSY, "the vehicle has not answered the last one")
        sizes = [self._view.failure_sizes[size.name] for size in AIRFRAME_SIZES]
        asked = 0 if self._view.at_ms == 0 else at_us
        self._view.vehicle.send(*failure_messages(self._view.spec.uav, meaning, instance, asked, sizes))
        self._waiting = _Awaited(request, meaning, instance, time.monotonic() + _VEHICLE_TIMEOUT)
        return None

    def take_vehicle_answer(self, message: Any) -> None:
        """COMMAND_ACK of the vehicle; it names the simulated time at which the failure acts."""
        if self._waiting is None or message.command != dialect.MAV_CMD_INJECT_FAILURE:
            return
        request, meaning, instance, _ = self._waiting
        self._waiting = None
        if message.result != ACCEPTED:
            self._outbox.answer(request, Answer(message.result, "refused by the vehicle"))
            return
        at_us = message.result_param2 * 1000
        text = self._text(meaning, instance)
        self._arm(request, "info" if meaning.kind == "ok" else "warning", text, at_us)
        warning = self._leaves_no_trim(meaning, instance)
        if warning:
            self._outbox.send_text(dialect.MAV_SEVERITY_WARNING, warning)
            self._view.log(warning, "warning")
        self._outbox.answer(request, Answer(ACCEPTED, detail=message.result_param2))

    def check_timeout(self) -> None:
        """Answer for a vehicle that does not."""
        if self._waiting is not None and time.monotonic() > self._waiting.until:
            request = self._waiting.request
            self._waiting = None
            self._outbox.answer(request, Answer(_FAILED, "the vehicle does not answer"))

    @property
    def armed(self) -> bool:
        """Whether something has been armed that does not act yet."""
        return bool(self._armed)

    @property
    def next_us(self) -> int:
        """When the next of what has been armed acts, simulated us."""
        return self._armed[0][0] if self._armed else _NEVER

    def report_acting(self, now_us: int) -> None:
        """Report the failures that have been armed for now or before."""
        while self._armed and self._armed[0][0] <= now_us:
            at_us, _, severity, text, who = heapq.heappop(self._armed)
            self._outbox.send_text(
                dialect.MAV_SEVERITY_WARNING if severity == "warning" else dialect.MAV_SEVERITY_NOTICE, text
            )
            self._view.log(text, severity, who, "acts", at_us)

    def _arm(self, request: Request, severity: str, text: str, at_us: int) -> None:
        if at_us > self._view.now_us + self._view.setting.timing.period_us:
            self._view.log(f"{text}{self._view.if_later(at_us)}", "info", request.who, "armed")
        entry = (at_us, severity, text, request.who)
        if all((at, *rest) != entry for at, _, *rest in self._armed):
            self._count += 1
            heapq.heappush(self._armed, (at_us, self._count, severity, text, request.who))

    def _fail_link(self, request: Request, meaning: Meaning, instance: int, at_us: int) -> Answer:
        spec = self._view.spec
        senders = [neighbour.uav for neighbour in spec.neighbours]
        if instance != EVERY and instance not in senders:
            return Answer(DENIED, f"UAV {spec.uav} does not hear UAV {instance}")
        own_radio = instance == EVERY and meaning.kind in ("off", "ok")
        edges = list(range(len(senders))) if instance == EVERY else [senders.index(instance)]
        if instance == EVERY and meaning.kind == "off":
            edges = []
        changes = [(edge, self._quality(meaning)) for edge in edges]
        if own_radio:
            changes.append((OWN_RADIO, self._quality(meaning)))
        for edge, quality in changes:
            if not inject_link_event(self._view.link_events, at_us, self._view.i, edge, quality):
                return Answer(BUSY, "too many link failures are waiting")
        self._arm(request, "info" if meaning.kind == "ok" else "warning", self._text(meaning, instance), at_us)
        return Answer(ACCEPTED, detail=at_us // 1000)

    def _lie(self, request: Request, instance: int, at_us: int) -> Answer:
        """Begin or end what is told instead of the truth."""
        lie = begin_lie(self._view, instance, at_us)
        if isinstance(lie, Answer):
            return lie
        # What was to end later ends here, or is replaced.
        over = (lie.begins, lie.ends)
        self._armed = [
            (at, n, severity, text, who)
            for at, n, severity, text, who in self._armed
            if at <= at_us or text not in over
        ]
        heapq.heapify(self._armed)
        self._arm(request, "warning" if lie.ends else "info", lie.begins, at_us)
        if lie.until_us != FOR_EVER:
            self._arm(request, "info", lie.ends, lie.until_us)
        return Answer(ACCEPTED, detail=at_us // 1000)

    def _quality(self, meaning: Meaning) -> Channel:
        """What a failure of a link changes; nan: nothing."""
        if meaning.kind == "ok":
            return self._view.channel._replace(blocked=0.0)
        if meaning.kind == "off":
            return Channel._make([math.nan] * len(LINK_SIZES) + [1.0])
        values = [
            self._view.failure_sizes[size.name] if size.name in meaning.sizes else math.nan for size in LINK_SIZES
        ]
        return Channel._make([*values, math.nan])

    def _text(self, meaning: Meaning, instance: int) -> str:
        if not meaning.unit.on_board:
            what = "own radio" if instance == EVERY else f"link from UAV {instance}"
        else:
            what = self._part(meaning, instance)
            what = self._names[SLOT[what]] if what in SLOT else what
        if meaning.kind == "ok":
            return f"{what} {meaning.text}"
        sizes = ", ".join(
            f"{name.removeprefix('FAIL_').lower()} {self._view.failure_sizes[name]:g}"
            for name in meaning.sizes
            if self._view.failure_sizes[name] != 0.0 or name in ("FAIL_EFF", "FAIL_DUTY")
        )
        return f"{what} {meaning.kind}{': ' if sizes else ''}{sizes}"

    def _missing(self, meaning: Meaning, instance: int) -> str:
        """What the aircraft has, where it has nothing of what is to fail; else empty."""
        has = [name for name in self._names if self._view.spec.travel[SLOT[name]] > 0.0]
        parts = parts_of(meaning.unit, has)
        asked = meaning.unit.parts if instance == EVERY else meaning.unit.parts[instance - 1 : instance]
        if not asked or (parts if instance == EVERY else instance in parts):
            return ""
        return f"no {' or '.join(asked)}: it has {', '.join(has)}"

    @staticmethod
    def _part(meaning: Meaning, instance: int) -> str:
        parts = meaning.unit.parts
        return parts[instance - 1] if 0 < instance <= len(parts) else meaning.unit.all_parts

    def _leaves_no_trim(self, meaning: Meaning, instance: int) -> str:
        """A warning where a failed actuator can no longer hold level flight at the present speed; else empty."""
        if meaning.kind not in ("wrong", "off") or not meaning.unit.parts:
            return ""
        own = fields(Own, self._view.autopilots.own[self._view.i])
        model = fields(Model, self._view.autopilots.model[self._view.i])
        effectiveness = 0.0 if meaning.kind == "off" else self._view.failure_sizes["FAIL_EFF"]
        bias = 0.0 if meaning.kind == "off" else self._view.failure_sizes["FAIL_BIAS"]
        for name in meaning.unit.parts if instance == EVERY else (self._part(meaning, instance),):
            if name not in self._view.scheme.commands:
                continue
            slot = ACTUATORS.index(name)
            travel = float(self._view.autopilots.travel[self._view.i, slot])
            needed = level_deflections(own.V, model).get(name, 0.0)
            if travel == 0.0 or abs(needed - bias) < effectiveness * travel or needed == bias:
                continue
            command = (needed - bias) / effectiveness if effectiveness > 0.0 else math.copysign(math.inf, needed - bias)
            return f"{name}: no trim, needs {command:.3g} of {travel:.3g}"
        return ""
