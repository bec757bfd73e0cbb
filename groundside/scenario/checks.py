"""Checks of a scenario as a whole: scheme and plant, time grid, graph, actuator limits."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from types import ModuleType

from ftcc.airside.scheme import Scheme, SchemeError
from ftcc.airside.schemes import find as find_scheme
from ftcc.groundside.claims import check_expression
from ftcc.groundside.scenario.columns import LEADING
from ftcc.groundside.scenario.loading import Scenario
from ftcc.groundside.schema import Plan, Rates, Start
from ftcc.link.actuators import ACTUATORS, SLOT
from ftcc.link.graph import Graph, GraphError
from ftcc.link.timing import Timing
from ftcc.sim import plants

__all__ = [
    "IDEAL",
    "Findings",
    "check_delays",
    "check_tracking",
    "graph_of",
    "limits_of",
    "plant_of",
    "require_followers",
    "scheme_of",
    "timing_of",
]

IDEAL = "monograph"
"""The form with ideal exchange; it flies only in one process."""

_NEGLIGIBLE = 1e-6
"""An edge whose weight is below this share of the largest weight has no practical effect."""
_OFF_GRID = 0.01
"""Largest distance of a period from whole microseconds, us; rates are decimal numbers."""
_MOST_PERIODS = 30
"""Largest sum of latency, delay and jitter, in exchange periods: inbox and mesh keep that many records."""


class Findings:
    """Collects errors and warnings, so that a user sees all of them at once."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.refused: list[str] = []
        self.warned: list[str] = []

    def refuse(self, text: str) -> None:
        self.refused.append(text)

    def warn(self, text: str) -> None:
        self.warned.append(text)

    def stop_if_refused(self) -> None:
        if self.refused:
            raise self.scenario.error(list(dict.fromkeys(self.refused)))


def scheme_of(scenario: Scenario, findings: Findings) -> Scheme:
    """Find the scheme. Refuse a form that it lacks, and signals named like other recorded columns."""
    try:
        scheme = find_scheme(scenario.plan.scheme)
    except (LookupError, SchemeError) as error:
        findings.refuse(f"scheme = {scenario.plan.scheme!r}: {error.args[0]}")
        findings.stop_if_refused()
        raise
    if scenario.form not in scheme.forms:
        findings.refuse(
            f"form = {scenario.form!r}: scheme {scheme.name} has no such form; it has {', '.join(scheme.forms)}"
        )
    taken = [signal.name for signal in scheme.signals if signal.name in LEADING]
    if taken:
        findings.refuse(
            f"scheme = {scheme.name!r}: signals {', '.join(taken)}: every recording has columns of these names already"
        )
    findings.stop_if_refused()
    return scheme


def check_tracking(scheme: Scheme, columns: Sequence[str], findings: Findings) -> None:
    """Refuse tracking errors and bounds that are not arithmetic over recorded columns."""
    expressions = [("TRACKING", error.name) for error in scheme.tracking]
    expressions += [("TRACKING", error.bound) for error in scheme.tracking if isinstance(error.bound, str)]
    expressions += [("SIGNALS", signal.bound) for signal in scheme.signals if isinstance(signal.bound, str)]
    for where, expression in expressions:
        try:
            check_expression(expression, columns)
        except ValueError as problem:
            findings.refuse(f"scheme = {scheme.name!r}: {where}: {problem}")


def plant_of(plan: Plan, scheme: Scheme, findings: Findings) -> ModuleType:
    """Find the plant. Refuse one that the scheme cannot fly."""
    name = plan.plant.model or scheme.plant
    if name == JSBSIM and scheme.plant in plants.find(GUIDED_JSBSIM).SERVES:
        name = GUIDED_JSBSIM
    serving = [one for one in plants.names() if scheme.plant in plants.find(one).SERVES]
    if name not in serving:
        where = f"plant.model = {name!r}" if plan.plant.model else f"scheme = {scheme.name!r}"
        findings.refuse(f"{where}: no plant that scheme {scheme.name} can fly; there are {', '.join(serving)}")
        findings.stop_if_refused()
    return plants.find(name)


JSBSIM, GUIDED_JSBSIM = "jsbsim", "jsbsim_guided"
"""The plants that JSBSim flies: by surfaces, and under our inner loop. To a scenario both are ``model = "jsbsim"``."""


def timing_of(plan: Plan, wire: bool, findings: Findings) -> Timing:
    """Return the time grid. Between processes (``wire``) the control period must be at least 1 ms."""
    rates = plan.rates
    period, step = 1e6 / rates.control_rate, rates.plant_step * 1e6
    _check_grid(rates, period, step, wire, findings)
    exchange = 1e6 / rates.exchange_rate if rates.exchange_rate else period
    latency = 0.0
    if wire:
        latency = rates.latency * 1e6 if rates.latency is not None else exchange
        if not _is_whole(exchange / period):
            findings.refuse(
                f"rates.exchange_rate = {rates.exchange_rate:g}: a period of {exchange / 1e3:g} ms; "
                f"must be a multiple of the control period of {period / 1e3:g} ms"
            )
        if latency < period * (1.0 - 1e-9):
            findings.refuse(
                f"rates.latency = {latency / 1e6:g}: must be at least one control period, {period / 1e6:g} s"
            )
        if latency > _MOST_PERIODS * exchange * (1.0 + 1e-9):
            findings.refuse(
                f"rates.latency = {latency / 1e6:g}: must be at most {_MOST_PERIODS} exchange periods, "
                f"{_MOST_PERIODS * exchange / 1e6:g} s"
            )
    else:
        if not math.isclose(exchange, period):
            findings.refuse(
                f"rates.exchange_rate = {rates.exchange_rate:g}: form {IDEAL} exchanges at every tick; "
                f"leave it out, or use form flight"
            )
        if rates.latency:
            findings.refuse(f"rates.latency = {rates.latency:g}: form {IDEAL} has no latency; leave it out")
    every = rates.control_rate / plan.record_rate
    if not _is_whole(every) or every < 1.0 - 1e-9:
        findings.refuse(
            f"record_rate = {plan.record_rate:g}: control_rate = {rates.control_rate:g} must be a whole multiple of it"
        )
    period_us = max(1, round(period))
    return Timing(
        period_us=period_us,
        exchange_us=max(1, round(exchange / period)) * period_us,
        latency_us=round(latency),
        step_us=max(1, round(step)),
        ticks=int(plan.duration * 1e6 / period_us + 1e-6),
        record_every=max(1, round(every)),
        seed=plan.seed,
    )


def _check_grid(rates: Rates, period: float, step: float, wire: bool, findings: Findings) -> None:
    """Refuse a control period or a plant step (us) that is not on the grid of simulated time."""
    where = f"rates.control_rate = {rates.control_rate:g}: a period of {period / 1e3:.9g} ms; "
    least = 1000.0 if wire else 500.0
    if abs(period - round(period)) > _OFF_GRID:
        near = max(round(period / step), 1) * step
        findings.refuse(
            f"{where}must be whole microseconds, the grid of simulated time; near it is {1e6 / near:.6g} Hz, "
            f"a period of {near / 1e3:g} ms"
        )
    elif period < least - _OFF_GRID:
        why = ", because MAVLink stamps ticks in whole ms" if wire else ""
        findings.refuse(f"{where}must be at least {least / 1e3:g} ms{why}")
    if abs(step - round(step)) > _OFF_GRID:
        findings.refuse(f"rates.plant_step = {rates.plant_step:g}: must be whole microseconds")
    elif not _is_whole(period / step):
        findings.refuse(
            f"rates.plant_step = {rates.plant_step:g}: must divide the control period of {period / 1e3:g} ms "
            f"into whole steps"
        )


def check_delays(plan: Plan, timing: Timing, findings: Findings) -> None:
    """Refuse links so slow that records in transit would overflow the buffers."""
    most = _MOST_PERIODS * timing.exchange_us / 1e6
    base = plan.channel
    asked = [("channel", base.delay, base.jitter)]
    for n, event in enumerate(plan.link_events):
        delay = base.delay if event.delay is None else event.delay
        asked.append((f"link_events.{n}", delay, base.jitter if event.jitter is None else event.jitter))
    for where, delay, jitter in asked:
        if timing.latency_us / 1e6 + delay + jitter > most * (1.0 + 1e-9):
            findings.refuse(
                f"{where}: latency {timing.latency_us / 1e6:g} + delay {delay:g} + jitter {jitter:g} s "
                f"must be at most {_MOST_PERIODS} exchange periods, {most:g} s"
            )


def graph_of(plan: Plan, scheme: Scheme, findings: Findings) -> Graph:
    """Return the communication graph. Refuse one that does not satisfy the scheme's assumption."""
    followers, leaders = tuple(plan.uavs.followers), tuple(plan.uavs.leaders)
    uavs = followers + leaders
    twice = sorted({uav for uav in uavs if uavs.count(uav) > 1})
    if twice:
        findings.refuse(f"uavs: UAV {', '.join(map(str, twice))} is listed twice")
    if set(plan.leaders) != set(leaders):
        findings.refuse(f"leaders: tables for UAVs {sorted(plan.leaders)}, but uavs.leaders = {sorted(leaders)}")
    weights: dict[tuple[int, int], float] = {}
    for n, edge in enumerate(plan.graph.edges):
        for receiver, sender in edge.directed:
            for uav in (receiver, sender):
                if uav not in uavs:
                    findings.refuse(f"graph.edges.{n}: there is no UAV {uav}; UAVs are {', '.join(map(str, uavs))}")
            if (receiver, sender) in weights:
                findings.refuse(f"graph.edges.{n}: edge {sender} -> {receiver} is listed twice")
            weights[receiver, sender] = edge.weight
    known_weights = {pair: weight for pair, weight in weights.items() if set(pair) <= set(uavs)}
    findings.stop_if_refused()
    try:
        graph = Graph(followers, leaders, known_weights)
        graph.require(scheme.graph)
    except GraphError as error:
        findings.refuse(f"graph.edges: {error}")
        findings.stop_if_refused()
        raise
    _warn_of_ineffective_edges(graph, findings)
    return graph


def _warn_of_ineffective_edges(graph: Graph, findings: Findings) -> None:
    """Warn of edges and leaders that have no effect."""
    for (receiver, sender), weight in graph.weights.items():
        if receiver in graph.leaders and sender in graph.followers:
            findings.warn(f"graph.edges: {sender} -> {receiver} has no effect: leaders do not receive from followers")
        elif weight < _NEGLIGIBLE * max(graph.weights.values()):
            findings.warn(
                f"graph.edges: {sender} -> {receiver} has weight {weight:g}, which is negligible beside the others"
            )
    for leader in graph.leaders:
        if not graph.receivers(leader):
            findings.warn(f"graph.edges: no UAV receives from leader {leader}")


def require_followers(where: str, uavs: Iterable[int], plan: Plan, findings: Findings) -> None:
    for uav in uavs:
        if uav not in plan.uavs.followers:
            findings.refuse(
                f"{where}: UAV {uav} is not a follower; followers are {', '.join(map(str, plan.uavs.followers))}"
            )


def limits_of(
    plan: Plan, plant: ModuleType, lacking: Sequence[str], findings: Findings
) -> tuple[tuple[float, float], ...]:
    """Return [lowest, highest] of each actuator, by slot; (0, 0) for one that the plant, or its aircraft, lacks.

    Refuse any other field about an actuator that the plant lacks.
    """
    limits = [(0.0, 0.0)] * len(ACTUATORS)
    actuators = plant.ACTUATORS
    for name, slot in SLOT.items():
        given = getattr(plan.plant.limits, name)
        if name in actuators:
            if given is None and name not in lacking:
                findings.refuse(f"plant.limits.{name}: is missing")
            limits[slot] = given or (0.0, 0.0)
        elif given or getattr(plan.plant.lag, name) > 0.0 or getattr(plan.plant.rate_limits, name) < math.inf:
            findings.refuse(f"plant: has no {name}; its actuators are {', '.join(actuators)}")
    for n, fault in enumerate(plan.faults):
        if fault.actuator is not None and fault.actuator not in actuators:
            findings.refuse(
                f"faults.{n}.actuator = {fault.actuator!r}: the plant has no such actuator; "
                f"it has {', '.join(actuators)}"
            )
        if fault.uav not in plan.uavs.followers:
            findings.refuse(
                f"faults.{n}.uav = {fault.uav}: is not a follower; "
                f"followers are {', '.join(map(str, plan.uavs.followers))}"
            )
    for n, disturbance in enumerate(plan.disturbances):
        require_followers(f"disturbances.{n}.uavs", disturbance.uavs or (), plan, findings)
    for n, command in enumerate(plan.attitude.commands if plan.attitude is not None else ()):
        require_followers(f"attitude.commands.{n}.uavs", command.uavs or (), plan, findings)
    require_followers("start.uav", plan.start.uav, plan, findings)
    if isinstance(plan.plant.initial_actuators, dict):
        for name in plan.plant.initial_actuators:
            if name not in actuators:
                findings.refuse(f"plant.initial_actuators.{name}: the plant has no such actuator")
    _check_names(plan, plant, findings)
    return tuple(limits)


def _check_names(plan: Plan, plant: ModuleType, findings: Findings) -> None:
    """Refuse initial states, noise and disturbances that the plant lacks."""
    starts = [("start", plan.start), *((f"start.uav.{uav}", start) for uav, start in plan.start.uav.items())]
    for where, start in starts:
        for name in Start.model_fields:
            if name not in plant.START and getattr(start, name) is not None:
                findings.refuse(f"{where}.{name}: the plant has no such state; it has {', '.join(plant.START)}")
    deviations = plan.noise.deviations
    for name in plant.COMPLETED:
        # Either the pitch angle or the angle of attack is measured.
        instead = name == "alpha" and deviations["theta"] == 0.0
        if deviations[name] > 0.0 and not instead:
            findings.refuse(f"noise.{name}: is computed from other measured channels; give their noise instead")
    channels = [name for name, _ in plant.DISTURBANCES]
    for n, disturbance in enumerate(plan.disturbances):
        for name in disturbance.values:
            if name not in channels:
                findings.refuse(
                    f"disturbances.{n}.{name}: the plant has no such disturbance; it has {', '.join(channels)}"
                )


def _is_whole(value: float, tolerance: float = 1e-6) -> bool:
    """Whether a positive number is whole but for rounding."""
    return math.isfinite(value) and abs(value - round(value)) <= tolerance * max(1.0, abs(value))
