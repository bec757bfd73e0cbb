"""Measures diagnosis on board and draws its figure: ``python docs/diagnosis_figures.py [--flights N] [SCENARIO ...]``.

Flies short flights of the shipped scenarios, each of one fault at a random time of a random UAV, with noise, 30 % loss
of records and coefficients up to 20 % off, and healthy ones. Prints the tables of ``diagnosis-figures.md`` with 95 %
intervals (shares: Clopper and Pearson; quantiles: order statistics), and draws the delay over false alarms an hour.
"""

from __future__ import annotations

import argparse
import collections
import itertools
import math
import multiprocessing
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.diagnosis.beliefs import FAULTY, KINDS, NOT_ACTUATOR, SENSOR, STATES
from ftcc.airside.diagnosis.gains import DiagnosisGains
from ftcc.airside.diagnosis.motion import Motion, aircraft_motion
from ftcc.airside.flight_path import Own
from ftcc.groundside.scenario import HEALTHY, Mission, healthy_changes, healthy_quantities, load, resolve
from ftcc.groundside.schema import StudyFields
from ftcc.groundside.simulation import Flight, fly_in_memory
from ftcc.groundside.statistics import quantile, share
from ftcc.groundside.studies.diagnosed import is_right, known_faults
from ftcc.groundside.studies.engine import compile_law
from ftcc.groundside.studies.plan import StudyPlan
from ftcc.groundside.studies.planning import plan_of_fields
from ftcc.groundside.verdict import SIGMAS, Alarm, FaultFound, columns_diagnosed, false_alarms, faults_found
from ftcc.link.actuators import ELEVATOR, THRUST
from ftcc.sim.plant import TRUTH

PICTURES = Path(__file__).parent / "pictures"
SCENARIOS = (
    "prescribed_performance",
    "nearest_neighbour",
    "containment",
    "finite_time_containment",
    "directed_attitude",
    "attitude_synchronization",
    "fire_monitoring",
    "fire_monitoring_sixdof",
)
NAVIGATION_KINDS: dict[str, dict[str, Any]] = {
    "off": {},
    "stuck": {},
    "slow": {"period": 0.5},
    "intermittent": {"period": 1.0, "duty": 0.5},
}
OFFSETS: dict[str, dict[str, Any]] = {
    "position": {"offset": [10.0, 10.0, 10.0], "rate_offset": [1.0, 1.0, 1.0]},
    "attitude": {"offset": [0.05, 0.05, 0.05], "rate_offset": [0.05, 0.05, 0.05]},
}
DURATION = 22.0
"""s: a fault before 12 s, 5 s after isolation, and some."""
HEALTHY_DURATION = 40.0
"""s."""
TRACED, LUMPED = "elevator", "lumped_hat"
"""Actuator of the figure, and the signal in which the law estimates what acts on it beside the model."""
CALM = (3.0, 5.0)
"""Time in which the baselines learn mean and deviation, s; no fault begins before its end."""
WINDOW = 0.2
"""Of the chi-square test, s."""
PUBLISHED = 0.5
"""Detection of the failure of a motor by its current, s."""


def uniform(low: float, high: float) -> dict[str, Any]:
    """A random quantity of a study."""
    return {"distribution": "uniform", "low": low, "high": high}


def choice(values: Sequence[Any]) -> dict[str, Any]:
    """A random quantity of a study."""
    return {"distribution": "choice", "values": list(values)}


@dataclass(frozen=True)
class Flown:
    """What is kept of a flight."""

    faults: tuple[FaultFound, ...]
    alarms: tuple[Alarm, ...]
    hours: float
    """Of aircraft in flight."""
    determined: float
    """Deviation from which on an effectiveness counts as determined."""
    largest: dict[str, NDArray[np.float64]]
    """By statistic, the largest value of each aircraft without a fault."""
    crossed: dict[str, NDArray[np.float64]]
    """By statistic, that of the faulty actuator since the onset, see `running`."""


def plan_of(name: str, samples: int, *, fault: Mapping[str, Any], random: Mapping[str, Any], excited: bool = False,
            limits: bool = True, duration: float = DURATION) -> StudyPlan:  # fmt: skip
    """The study of a fault; without ``fault`` of healthy flights; without ``limits`` none is reached."""
    scenario = load(name, changes=HEALTHY, duration=duration)
    mission = resolve(scenario)
    changes: dict[str, Any] = healthy_changes(scenario, mission)
    quantities = dict(healthy_quantities(scenario, mission))
    if fault:
        changes["faults"] = [{"at": 5.0, "uav": scenario.plan.uavs.followers[0], **fault}]
        quantities["faults.0.at"] = uniform(5.0, 12.0)
        quantities["faults.0.uav"] = choice(scenario.plan.uavs.followers)
        quantities |= {f"faults.0.{key}": value for key, value in random.items()}
    if excited:
        changes["diagnosis"] = {**HEALTHY["diagnosis"], "gains": {"dither": DITHER}}
    if not limits:
        names = mission.autopilots[0].diagnosis.actuators
        gains = {f"limit_{one}": UNREACHED * limit for one, limit in limits_of(mission).items() if one in names}
        changes["diagnosis"] = {**HEALTHY["diagnosis"], "gains": gains}
    fields = StudyFields(changes=changes, random=quantities, samples=samples, design="random", redraw=True)
    plan = plan_of_fields(name, fields, duration=duration)
    return replace(plan, claims=())


DITHER = 0.05
"""Share of the travel by which what needs excitation is excited."""
UNREACHED = 1e4
"""Factor of a limit that is never reached."""


def limits_of(mission: Mission) -> dict[str, float]:
    """By actuator, the limit of its test."""
    gains = DiagnosisGains(*mission.autopilots[0].diagnosis.gains)
    return {name: getattr(gains, f"limit_{name}") for name in mission.autopilots[0].diagnosis.actuators}


def fly(plan: StudyPlan, number: int, traced: bool) -> Flown | None:
    """One flight of a study; None if it cannot fly. ``traced``: the statistics of `TRACED` too."""
    _, mission, _ = plan.drawn(plan.trial(number))
    if mission is None:
        return None
    more = {*TRUTH, LUMPED, *(f"{name}_command" for name in ("elevator", "thrust"))} if traced else {"V"}
    flight = fly_in_memory(mission, columns=columns_diagnosed(mission) | more)
    spec = mission.autopilots[0].diagnosis
    faults, alarms = faults_found(flight), false_alarms(flight)
    largest: dict[str, list[float]] = collections.defaultdict(list)
    since: dict[str, NDArray[np.float64]] = {}
    followers = [one.uav for one in mission.autopilots if one.diagnosis.on and one.role == "follower"]
    for uav in followers if traced else ():
        t, own = flight.column("t", uav), [fault for fault in faults if fault.uav == uav]
        for kind, trace in statistics_of(flight, uav).items():
            if own:
                later = t >= own[0].onset
                since[kind] = running(t[later] - own[0].onset, trace[later])
            else:
                largest[kind].append(float(trace[t >= CALM[1]].max(initial=0.0)))
    hours = sum(len(flight.column("V", uav)) for uav in followers) * float(flight.t[1] - flight.t[0]) / 3600.0
    determined = DiagnosisGains(*spec.gains).determined
    tops = {kind: np.array(values) for kind, values in largest.items()}
    return Flown(faults, alarms, hours, determined, tops, since)


def statistics_of(flight: Flight, uav: int) -> dict[str, NDArray[np.float64]]:
    """The statistic of `TRACED` and those of two baselines, in order of time."""
    t = flight.column("t", uav)
    calm = (t >= CALM[0]) & (t < CALM[1])
    own = flight.column(LUMPED, uav)
    nu = innovations(flight, uav)
    squares = ((nu - nu[calm].mean()) / nu[calm].std()) ** 2
    window = max(round(WINDOW / float(t[1] - t[0])), 1)
    return {
        "cumulative sum": UNREACHED * flight.column(f"evidence_{TRACED}", uav),
        "threshold on the law's own estimate": np.abs(own - own[calm].mean()),
        f"chi-square of innovations in {WINDOW:g} s": np.convolve(squares, np.ones(window))[: len(t)],
    }


def innovations(flight: Flight, uav: int) -> NDArray[np.float64]:
    """Innovations of a Kalman filter of the pitch rate in rad of elevator, from the truth with noise of its own."""
    mission = flight.mission
    at = mission.uavs.index(uav)
    autopilot, vehicle = mission.autopilots[at], mission.vehicles[at]
    gains, model = DiagnosisGains(*autopilot.diagnosis.gains), autopilot.model
    t = flight.column("t", uav)
    random = np.random.default_rng([mission.timing.seed, uav])
    deviations = dict(zip(TRUTH, vehicle.noise, strict=True))
    measured = {name: flight.column(name, uav) + deviations[name] * random.standard_normal(len(t)) for name in TRUTH}
    measured["alpha"] = measured["theta"] - measured["gamma"]
    command = {name: flight.column(f"{name}_command", uav) for name in ("elevator", "thrust")}
    still = np.zeros(len(t))
    columns = [(measured | command | {"t": t}).get(name, still) for name in Own._fields]
    rows = [Own(*map(float, row)) for row in zip(*columns, strict=True)]
    dt, motion, positions = float(t[1] - t[0]), np.zeros((4, len(Motion._fields))), np.zeros(4)
    found, nu = np.zeros(len(t)), 0.0
    positions[ELEVATOR], positions[THRUST] = rows[0].elevator, rows[0].thrust
    for n, (past, own) in enumerate(itertools.pairwise(rows), 1):
        for slot, target in ((ELEVATOR, past.elevator), (THRUST, past.thrust)):
            lag = autopilot.diagnosis.lag[slot]
            positions[slot] += (1.0 - math.exp(-lag * dt) if lag else 1.0) * (target - positions[slot])
        turn = aircraft_motion(own, past, positions, model, gains, dt, 0, motion)
        row = Motion(*motion[ELEVATOR])
        noise, spread = row.noise**2 + (row.air * gains.sd_angle) ** 2, gains.spread_elevator**2 * dt
        variance = 0.5 * spread + math.sqrt(0.25 * spread * spread + spread * noise)  # of the steady filter
        kept = noise / (variance + noise)
        nu = kept * nu + row.step - row.air * turn - dt * (row.drift + positions[ELEVATOR])
        found[n] = nu
    return found


def running(after: NDArray[np.float64], trace: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2, n): time since the onset and largest value of the statistic until then, where it grows."""
    top = np.maximum.accumulate(trace)
    grows = np.flatnonzero(np.diff(top, prepend=-1.0) > 0.0)
    return np.array([after[grows], top[grows]])


def fly_all(plan: StudyPlan, pool: ProcessPoolExecutor, traced: bool = False) -> list[Flown]:
    """All flights of a study."""
    compile_law(plan)
    landed = [pool.submit(fly, plan, number, traced) for number in range(plan.count)]
    return [found for one in landed if (found := one.result()) is not None]


def shares(count: int, of: int) -> str:
    """A share with its interval."""
    if not of:
        return "-"
    found = share(count, of)
    return f"{100 * found.value:.1f} % [{100 * found.low:.1f}, {100 * found.high:.1f}] of {of}"


def delays(values: Sequence[float]) -> str:
    """Median and 95 % quantile with intervals; what was not found is infinite."""
    numbers = [math.inf if math.isnan(value) else value for value in values]
    if not numbers:
        return "-"
    parts = []
    for q in (0.5, 0.95):
        found = quantile(numbers, q)
        parts.append(f"{found.value:.2f} [{found.low:.2f}, {found.high:.2f}]")
    return "; ".join(parts)


def row(title: str, flown: Iterable[Flown]) -> list[str]:
    """A line of the table of faults."""
    flights = list(flown)
    faults = [(fault, one) for one in flights for fault in one.faults]
    found = [(fault, one) for fault, one in faults if math.isfinite(fault.detected)]
    known = [fault for one in flights for fault in known_faults(one.faults, one.determined)]
    return [
        title,
        str(len(faults)),
        delays([fault.detection_delay for fault, _ in faults]),
        delays([fault.isolation_delay for fault, _ in faults]),
        shares(sum(is_right(fault, one.alarms) for fault, one in found), len(found)),
        shares(sum(abs(fault.effectiveness_error) <= 0.05 for fault in known), len(known)),
        shares(sum(fault.effectiveness_covered for fault in known), len(known)),
    ]


HEADS = ("fault", "flights", "detection, s: median; 95 %", "isolation, s: median; 95 %", "right kind and actuator",
         "effectiveness within 0.05", f"band of {SIGMAS:g} deviations covers")  # fmt: skip


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table in Markdown."""
    print("| " + " | ".join(heads) + " |")
    print("|" + "---|" * len(heads))
    for one in rows:
        print("| " + " | ".join(one) + " |", flush=True)
    print()


def faults_of(mission: Mission) -> Iterator[tuple[str, dict[str, Any], dict[str, Any], bool]]:
    """Title, fault, what is drawn of it, and whether something excites it."""
    actuators = mission.autopilots[0].diagnosis.actuators
    pitch = "load_factor" if "load_factor" in actuators else "elevator"
    angles = [one for one in actuators if one not in ("thrust", "load_factor")]
    least = {"actuator": pitch, "without_trim": True}
    one = {"actuator": choice(actuators)}
    yield "total loss", {**least, "kind": "off"}, one, False
    yield "30 % loss of pitch, excited", {**least, "effectiveness": 0.7}, {}, True
    if angles:
        yield (
            "bias of 0.1 rad",
            {**least, "actuator": angles[0]},
            {"actuator": choice(angles), "bias": choice([-0.1, 0.1])},
            False,
        )
    yield "loss", {**least, "effectiveness": 0.5}, {"effectiveness": uniform(0.3, 0.7)}, True
    if angles:
        angle = {"actuator": choice(angles)}
        yield "bias", {**least, "actuator": angles[0]}, {**angle, "bias": uniform(0.1, 0.25)}, True
        both = {**angle, "effectiveness": uniform(0.3, 0.7), "bias": uniform(0.1, 0.25)}
        yield "loss and bias", {**least, "actuator": angles[0]}, both, True
    yield "stuck", {**least, "kind": "stuck"}, {}, True
    yield "floating", {**least, "kind": "off"}, {}, True
    yield "slow", {**least, "kind": "slow", "slew": 0.05}, {"slew": uniform(0.02, 0.1)}, True


def navigation_faults() -> Iterator[tuple[str, dict[str, Any]]]:
    """Title and fault."""
    for part, offsets in OFFSETS.items():
        yield f"{part} wrong", {"navigation": part, **offsets}
        for kind, fields in NAVIGATION_KINDS.items():
            yield f"{part} {kind}", {"navigation": part, "kind": kind, **fields}


def is_an_actuators(alarm: Alarm) -> bool:
    """Whether an alarm came to name a fault of an actuator."""
    return alarm.state == STATES[FAULTY] and alarm.kind not in (KINDS[SENSOR], KINDS[NOT_ACTUATOR])


def confusion(flown: Mapping[str, list[Flown]]) -> None:
    """Print which kinds were found of which faults, in flights."""
    counts = collections.Counter(
        (fault.true_kind, fault.kind if math.isfinite(fault.detected) else "not detected")
        for flights in flown.values()
        for one in flights
        for fault in one.faults
    )
    kinds = list(dict.fromkeys([kind for kind, _ in counts] + [kind for _, kind in counts]))
    found = [kind for kind in (*KINDS, "not detected") if any((true, kind) in counts for true in kinds)]
    rows = [
        [true, *(str(counts[true, kind]) for kind in found)] for true in KINDS if any(counts[true, k] for k in found)
    ]
    table(["true kind", *("detected, not isolated" if kind == KINDS[0] else kind for kind in found)], rows)


def draw_roc(healthy: Sequence[Flown], faulty: Sequence[Flown], file: Path) -> None:
    """Draw the median delay over false alarms an hour, a curve per statistic."""
    import matplotlib.pyplot as plt

    hours = sum(one.hours for one in healthy)
    figure, axes = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
    for kind in dict.fromkeys(name for one in healthy for name in one.largest):
        tops = np.concatenate([one.largest[kind] for one in healthy if kind in one.largest])
        traces = [one.crossed[kind] for one in faulty if kind in one.crossed]
        if not traces:
            continue
        limits = (
            np.quantile(tops, np.linspace(0.0, 1.0, 41)).tolist() + (tops.max() * np.array([1.1, 1.3, 2.0])).tolist()
        )
        points = []
        for limit in sorted({*limits} - {0.0}):
            first = [trace[0][trace[1] >= limit] for trace in traces]
            delay = float(np.median([one[0] if len(one) else math.inf for one in first]))
            points.append(((tops >= limit).sum() / hours, delay))
        rate, delay = np.array([one for one in points if math.isfinite(one[1])]).T
        # No alarm in so many hours: less than 3 / hours with 95 % confidence.
        axes.plot(np.maximum(rate, 3.0 / hours), delay, marker=".", label=kind)
    axes.axhline(PUBLISHED, color="0.5", linestyle=":", linewidth=0.9, label="published, a motor by its current")
    axes.axvline(3.0 / hours, color="0.5", linewidth=0.6)
    axes.set(xscale="log", yscale="log", xlabel=f"aircraft with a false alarm, 1/h (left end: none in {hours:.3g} h)",
             ylabel="median delay of detection, s")  # fmt: skip
    axes.legend(fontsize=8)
    figure.savefig(file)
    print(f"wrote {file}")


def main() -> None:
    """Fly, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scenarios", nargs="*", default=SCENARIOS, metavar="SCENARIO")
    parser.add_argument("--flights", type=int, default=100, help="of each fault and scenario")
    parser.add_argument("--hours", type=float, default=12.5, help="of healthy aircraft, of each scenario")
    parser.add_argument("--out", type=Path, default=PICTURES, help="folder of the figure")
    given = parser.parse_args()
    if given.flights < 1 or not given.hours > 0.0:
        parser.error("--flights and --hours must be positive")
    if unknown := [name for name in given.scenarios if name not in SCENARIOS]:
        parser.error(f"{', '.join(unknown)}: choose from {', '.join(SCENARIOS)}")
    by_fault: dict[str, list[Flown]] = collections.defaultdict(list)
    by_navigation: dict[str, list[Flown]] = collections.defaultdict(list)
    healthy: dict[str, list[Flown]] = {}
    traces: list[Flown] = []
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(mp_context=context) as pool:
        for name in given.scenarios:
            mission = resolve(load(name, changes=HEALTHY))
            aircraft = sum(spec.role == "follower" for spec in mission.autopilots)
            rows = []
            for title, fault, random, excited in faults_of(mission):
                plan = plan_of(name, given.flights, fault=fault, random=random, excited=excited)
                flown = fly_all(plan, pool)
                by_fault[title] += flown
                rows.append(row(title, flown))
            print(f"## {name}\n")
            table(HEADS, rows)
            if mission.plant != "position":
                for title, fault in navigation_faults():
                    by_navigation[title] += fly_all(plan_of(name, given.flights, fault=fault, random={}), pool)
            flights = math.ceil(given.hours * 3600.0 / (HEALTHY_DURATION * aircraft))
            healthy[name] = fly_all(plan_of(name, flights, fault={}, random={}, duration=HEALTHY_DURATION), pool)
            if name == "containment":
                off = {"actuator": "elevator", "kind": "off", "without_trim": True}
                calm = fly_all(
                    plan_of(name, flights, fault={}, random={}, duration=HEALTHY_DURATION, limits=False),
                    pool,
                    traced=True,
                )
                traces = fly_all(plan_of(name, given.flights, fault=off, random={}, limits=False), pool, traced=True)
                draw_roc(calm, traces, given.out / "diagnosis_roc.svg")
    print("## All\n")
    table(HEADS, [row(title, flown) for title, flown in by_fault.items()])
    confusion({title: flown for title, flown in by_fault.items() if title in KINDS})
    rows = []
    for title, flown in by_navigation.items():
        taken = sum(any(map(is_an_actuators, one.alarms)) for one in flown)
        rows.append([title, shares(taken, len(flown)), shares(sum(bool(one.alarms) for one in flown), len(flown))])
    table(["navigation fault", "taken for one of an actuator", "any alarm"], rows)
    rows = []
    everything = [one for flown in healthy.values() for one in flown]
    for name, quiet in {**healthy, "all": everything}.items():
        hours, alarms = sum(one.hours for one in quiet), sum(len(one.alarms) for one in quiet)
        rows.append([name, f"{hours:.1f}", str(alarms), f"{alarms / hours:.2g}" if alarms else f"< {3.0 / hours:.2g}"])
    table(["healthy", "hours", "alarms", "1/h"], rows)


if __name__ == "__main__":
    main()
