"""Lies that the ground asks for: MAV_CMD_INJECT_FAILURE of the radio, type WRONG, what and how much from ATK_*."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ftcc.airside.attacks.arrays import FROM_GROUND, OWN, add_attack, end_attacks
from ftcc.airside.attacks.attack import FOR_EVER, Attack, values_by_signal
from ftcc.airside.gcs.answers import BUSY, DENIED, Answer
from ftcc.airside.gcs.autopilot_view import AutopilotView
from ftcc.airside.scheme import Quantity
from ftcc.link.attacks import KINDS, LONGEST, attack_text, kind_of
from ftcc.link.failures import EVERY

__all__ = ["Lie", "begin_lie"]

_PARAMETERS = {
    "size": "ATK_SIZE",
    "rate": "ATK_RATE",
    "period": "ATK_PERIOD",
    "delay": "ATK_DELAY",
    "onset": "ATK_ONSET",
    "as": "ATK_AS",
}


class Lie(NamedTuple):
    """What becomes of a request that is accepted."""

    begins: str
    """Text of the event; that of the truth where a lie ends."""
    ends: str = ""
    """Text of the event at its end."""
    until_us: int = FOR_EVER


def begin_lie(view: AutopilotView, instance: int, at_us: int) -> Lie | Answer:
    """Begin, or end, lies of this UAV (`EVERY`), or of what in-neighbour ``instance`` tells it, from ``at_us`` on.

    A lie replaces those of the same records that have begun by then. Returns the answer where that cannot be.
    """
    kind = kind_of(view.attack_sizes["ATK_KIND"])
    senders = [neighbour.uav for neighbour in view.spec.neighbours]
    if instance != EVERY and instance not in senders:
        return _denied(f"UAV {view.spec.uav} does not hear UAV {instance}")
    who = "" if instance == EVERY else f"UAV {instance} "
    if not kind:
        _end(view, OWN if instance == EVERY else senders.index(instance), at_us)
        return Lie(f"{who}tells the truth again")
    attack = _attack(view, kind, instance, at_us)
    if isinstance(attack, Answer):
        return attack
    edge = OWN if attack.sender is None else senders.index(attack.sender)
    end_attacks(view.attacks, view.i, edge, at_us, all_of_them=False)
    if not add_attack(view.attacks, view.i, view.spec, attack, view.scheme, view.now_us):
        return Answer(BUSY, "too many attacks are waiting")
    if kind == "sybil":
        return Lie(f"{who}speaks in the name of UAV {attack.sender}", f"{who}speaks for itself again", attack.until_us)
    given = {name: view.attack_sizes[_PARAMETERS[name]] for name in _given(view, kind)}
    return Lie(f"{who}lies: {attack_text(kind, attack.signals, given)}", f"{who}tells the truth again", attack.until_us)


def _denied(text: str) -> Answer:
    return Answer(DENIED, text)


def _given(view: AutopilotView, kind: str) -> list[str]:
    """Of what a kind needs and takes, what is given; 0 is what a field that it may lack is without it."""
    chosen = KINDS[kind]
    return [*chosen.needs, *(name for name in chosen.takes if view.attack_sizes[_PARAMETERS[name]] != 0.0)]


def _end(view: AutopilotView, edge: int, at_us: int) -> None:
    """End the lies on an in-edge, and those that its sender tells in another's name."""
    end_attacks(view.attacks, view.i, edge, at_us)
    if edge != OWN:
        for other in range(len(view.spec.neighbours)):
            end_attacks(view.attacks, view.i, other, at_us, speaker=edge)


def _attack(view: AutopilotView, kind: str, instance: int, at_us: int) -> Attack | Answer:
    """The attack that the parameters describe, or why there is none."""
    sizes = view.attack_sizes
    until_us = round(sizes["ATK_UNTIL"]) * 1000 or FOR_EVER
    if until_us <= at_us:
        return _denied(f"ATK_UNTIL {sizes['ATK_UNTIL']:.0f} ms: not after the beginning")
    role = view.spec.role if instance == EVERY else _role(view, instance)
    shared = view.scheme.shared.get(role, ())
    if not shared:
        return _denied(f"a {role} of this scheme shares nothing")
    mask = int(sizes["ATK_SIGNALS"])
    if mask >= 1 << len(shared):
        return _denied(f"ATK_SIGNALS {mask}: it shares {', '.join(one.name for one in shared)}")
    signals = tuple(one.name for n, one in enumerate(shared) if mask >> n & 1)
    given = {name: sizes[_PARAMETERS[name]] for name in _given(view, kind)}
    if why := _mistake(view, kind, instance, given):
        return _denied(why)
    names = {"size": given.get("size"), "rate": given.get("rate")}
    size, rate = (values_by_signal(names[name], shared, signals) for name in ("size", "rate"))
    sybil = kind == "sybil"
    return Attack(
        kind=kind,
        at_us=at_us,
        until_us=until_us,
        sender=int(given["as"]) if sybil else None if instance == EVERY else instance,
        speaker=instance if sybil else None,
        role=role,
        signals=signals,
        consistent=sizes["ATK_CONSIST"] == 1.0,
        size=size,
        rate=rate,
        period=given.get("period", 0.0),
        delay=given.get("delay", 0.0),
        onset=given.get("onset", 0.0),
        number=FROM_GROUND,
    )


def _mistake(view: AutopilotView, kind: str, instance: int, given: dict[str, float]) -> str:
    """What is wrong with the sizes of a lie; else empty."""
    exchange = view.setting.timing.exchange_us / 1e6
    if kind == "oscillate" and given["period"] <= 0.0:
        return "ATK_PERIOD 0: an oscillation needs one"
    if kind == "replay" and not exchange <= given["delay"] <= (LONGEST - 1) * exchange:
        return f"ATK_DELAY {given['delay']:g} s: {exchange:g} to {(LONGEST - 1) * exchange:g} s"
    if kind == "replay" and "period" in given and not exchange <= given["period"] <= given["delay"]:
        return f"ATK_PERIOD {given['period']:g} s: {exchange:g} s to the delay"
    return _mistake_of_name(view, instance, int(given["as"])) if kind == "sybil" else ""


def _mistake_of_name(view: AutopilotView, speaker: int, victim: int) -> str:
    if view.spec.authenticated:
        return "the network is authenticated"
    if speaker == EVERY:
        return "sybil: ask those who hear both, for the speaker"
    if victim == speaker or victim not in [neighbour.uav for neighbour in view.spec.neighbours]:
        return f"UAV {view.spec.uav} does not hear UAV {victim} beside UAV {speaker}"
    if _shared(view, speaker) != _shared(view, victim):
        return f"UAV {victim} shares other values than UAV {speaker}"
    return ""


def _shared(view: AutopilotView, uav: int) -> Sequence[Quantity]:
    return view.scheme.shared.get(_role(view, uav), ())


def _role(view: AutopilotView, uav: int) -> str:
    """Role of an in-neighbour."""
    flight = view.spec.flight
    return "leader" if flight is not None and uav in flight.graph.leaders else "follower"
