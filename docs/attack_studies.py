"""Measures what lying neighbours do and what defences are worth: ``python docs/attack_studies.py [SCHEME ...]``.

Draws random lies (`attacked_swarms.py`), and flies each with and without defences, on graphs that stand the liars and
on one that does not; flies without lies what the defences cost; prints the tables of ``lying-neighbours.md`` with 95 %
intervals (Clopper and Pearson) and draws its figures. What has been flown is in ``--out``, and is not flown again.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import math
import multiprocessing
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from attacked_swarms import ALL, CHAPTERS, LIARS, NO_MSR, NOT_DEFENDED, SINGLE, Cost, Outcome, cost, fly, lies_of
from markdown_tables import table

from ftcc.groundside.simulation import simulate
from ftcc.groundside.statistics import paired, quantile, share

PICTURES = Path(__file__).parent / "pictures"
FIELDS = ("scheme", "graph", "number", "kind", "defence", "worst", "end", "agreed")
GRAPHS = ("F = 1", "F = 2", "sparse")
DEFENCES = (NOT_DEFENDED, "MSR", "hull", "gate", "trust", NO_MSR, ALL)
FEW = (NOT_DEFENDED, "MSR", NO_MSR, ALL)
EACH = 40
"""Draws that are flown with every defence; further ones with those of `FEW`."""


Job = tuple[str, str, int, tuple[str, ...]]
"""Scheme, graph, number of a draw, defences."""


def jobs(schemes: Sequence[str], draws: int, flown: set[tuple[str, str, int, str]]) -> Iterator[Job]:
    """Yield what is still to be flown: so that at any time as many are flown of each chapter and graph."""
    for number, graph, scheme in itertools.product(range(draws), GRAPHS, schemes):
        if graph == "sparse" and number >= EACH:
            continue
        wanted = DEFENCES if number < EACH and graph != "sparse" else FEW
        if missing := tuple(one for one in wanted if (scheme, graph, number, one) not in flown):
            yield scheme, graph, number, missing


def fly_draw(job: Job) -> list[dict[str, Any]]:
    """Fly one draw with each defence."""
    scheme, graph, number, defences = job
    chapter = CHAPTERS[scheme]
    lies = lies_of(chapter, graph, number)
    common = {"scheme": scheme, "graph": graph, "number": number, "kind": lies[0]["kind"]}
    return [{**common, "defence": one, **fly(chapter, graph, one, lies)._asdict()} for one in defences]


def read(file: Path) -> list[dict[str, Any]]:
    """Return what has been flown."""
    if not file.exists():
        return []
    with file.open(newline="") as text:
        return [{**row, "number": int(row["number"]), **{n: float(row[n]) for n in Outcome._fields}}
                for row in csv.DictReader(text)]  # fmt: skip


def fly_all(schemes: Sequence[str], draws: int, minutes: float, workers: int, file: Path) -> None:
    """Fly until there are so many draws of each, or time is over; add rows to ``file``."""
    end = time.monotonic() + 60.0 * minutes
    flown = {(row["scheme"], row["graph"], row["number"], row["defence"]) for row in read(file)}
    new = not file.exists()
    context = multiprocessing.get_context("spawn")
    with file.open("a", newline="") as text, ProcessPoolExecutor(workers, mp_context=context) as pool:
        writer = csv.DictWriter(text, FIELDS)
        if new:
            writer.writeheader()
        waiting = jobs(schemes, draws, flown)
        while (batch := list(itertools.islice(waiting, 5 * workers))) and time.monotonic() < end:
            for rows in pool.map(fly_draw, batch):
                writer.writerows(rows)
            text.flush()


def outcomes(rows: Sequence[dict[str, Any]], defence: str, **chosen: Any) -> dict[Any, dict[str, Any]]:
    """Return the rows of a defence by draw."""
    return {
        (row["scheme"], row["graph"], row["number"]): row
        for row in rows
        if row["defence"] == defence and all(row[name] == value for name, value in chosen.items())
    }


def shares(rows: Sequence[dict[str, Any]], defence: str, what: str = "worst", **chosen: Any) -> str:
    """Return the share of flights in which a honest follower was led astray, with its interval."""
    found = outcomes(rows, defence, **chosen).values()
    if not found:
        return "-"
    one = share(sum(not row[what] <= 1.0 for row in found), len(found))
    return f"{100 * one.value:.0f} % [{100 * one.low:.0f}, {100 * one.high:.0f}]"


def print_tables(rows: Sequence[dict[str, Any]]) -> None:
    """Print what lies do with and without defences."""
    schemes = [one for one in CHAPTERS if any(row["scheme"] == one for row in rows)]
    for what, title in (("worst", "Led astray at any time"), ("end", "Still astray in the last 2 s")):
        body = []
        for graph, scheme in itertools.product(GRAPHS, [*schemes, "all"]):
            chosen = {"graph": graph} | ({} if scheme == "all" else {"scheme": scheme})
            name = "all" if scheme == "all" else f"{CHAPTERS[scheme].number}"
            flown = len(outcomes(rows, NOT_DEFENDED, **chosen))
            if flown:
                body.append([graph, name, str(flown), *(shares(rows, one, what, **chosen) for one in DEFENCES)])
        print(f"## {title}\n\n{table(['graph', 'chapter', 'lies', *DEFENCES], body)}")
    kinds = list(dict.fromkeys([*SINGLE, *(row["kind"] for row in rows)]))
    body = [
        [kind, str(len(outcomes(rows, NOT_DEFENDED, kind=kind, graph=graph))),
         *(shares(rows, one, kind=kind, graph=graph) for one in DEFENCES)]
        for graph in ("F = 1",) for kind in kinds if outcomes(rows, NOT_DEFENDED, kind=kind, graph=graph)
    ]  # fmt: skip
    print(f"## By kind of lie, F = 1\n\n{table(['kind', 'lies', *DEFENCES], body)}")
    body = []
    for scheme in (one for one in schemes if CHAPTERS[one].agreed):
        for graph in GRAPHS[:2]:
            flown = shares(rows, "MSR", "agreed", scheme=scheme, graph=graph)
            body.append([graph, str(CHAPTERS[scheme].number), shares(rows, NOT_DEFENDED, "agreed", scheme=scheme,
                        graph=graph), flown, shares(rows, ALL, "agreed", scheme=scheme, graph=graph)])  # fmt: skip
    print(f"## What they agree on outside the hull\n\n{table(['graph', 'chapter', NOT_DEFENDED, 'MSR', ALL], body)}")
    body = []
    for graph, defence in itertools.product(GRAPHS, DEFENCES[1:]):
        bare, kept = (outcomes(rows, one, graph=graph) for one in (NOT_DEFENDED, defence))
        both = sorted(bare.keys() & kept.keys())
        if both:
            one = paired(
                [not bare[key]["worst"] <= 1.0 for key in both], [not kept[key]["worst"] <= 1.0 for key in both]
            )
            body.append([graph, defence, str(len(both)), str(one.both), str(one.only_first), str(one.only_second),
                         f"{100 * one.difference:.0f} % [{100 * one.low:.0f}, {100 * one.high:.0f}]"])  # fmt: skip
    heads = ["graph", "defence", "lies", "astray with and without", "saved", "harmed by it", "fewer astray"]
    print(f"## The same lies with and without\n\n{table(heads, body)}")


def fly_costs(schemes: Sequence[str], draws: int, workers: int, file: Path) -> list[dict[str, Any]]:
    """Fly what defences cost where nobody lies, or read what was flown; F = 1."""
    names = ("scheme", "defence", "number", *Cost._fields)
    if not file.exists():
        context = multiprocessing.get_context("spawn")
        asked = list(itertools.product(schemes, DEFENCES, range(draws)))
        with file.open("w", newline="") as text, ProcessPoolExecutor(workers, mp_context=context) as pool:
            writer = csv.DictWriter(text, names)
            writer.writeheader()
            for (scheme, defence, number), found in zip(asked, pool.map(fly_cost, asked), strict=True):
                writer.writerow({"scheme": scheme, "defence": defence, "number": number, **found._asdict()})
    with file.open(newline="") as text:
        return [{**row, **{n: float(row[n]) for n in Cost._fields}} for row in csv.DictReader(text)]


def fly_cost(asked: tuple[str, str, int]) -> Cost:
    """Fly one swarm in which nobody lies."""
    scheme, defence, number = asked
    return cost(CHAPTERS[scheme], "F = 1", defence, number)


def print_costs(rows: Sequence[dict[str, Any]]) -> None:
    """Print what defences cost: medians over draws, and the change in per cent with its interval."""
    body = []
    for scheme, defence in dict.fromkeys((row["scheme"], row["defence"]) for row in rows):
        own = [row for row in rows if (row["scheme"], row["defence"]) == (scheme, defence)]
        bare = [row for row in rows if (row["scheme"], row["defence"]) == (scheme, NOT_DEFENDED)]
        cells = [str(CHAPTERS[scheme].number), defence]
        for what, unit in (("error", "m"), ("delay", "s")):
            change = quantile([100.0 * (a[what] / b[what] - 1.0) for a, b in zip(own, bare, strict=True)], 0.5)
            cells.append(f"{np.median([row[what] for row in own]):.3g} {unit}")
            cells.append("" if own is bare or defence == NOT_DEFENDED
                         else f"{change.value:+.1f} % [{change.low:+.1f}, {change.high:+.1f}]")  # fmt: skip
        place = float(np.median([row["place"] for row in own]))
        body.append([*cells, "" if math.isnan(place) else f"{place:.2f} m"])
    heads = [
        "chapter",
        "defence",
        "tracking error",
        "change",
        "time to agree",
        "change",
        "off the place of the weights",
    ]
    print(f"## What it costs where nobody lies, F = 1\n\n{table(heads, body)}")


def draw_shares(rows: Sequence[dict[str, Any]], file: Path) -> None:
    """Draw the share of lies that lead somebody astray, by chapter and defence, with intervals."""
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, 2, figsize=(9.0, 3.8), sharey=True, layout="constrained")
    shown = [one for one in CHAPTERS if any(row["scheme"] == one for row in rows)]
    for axes, graph in zip(panels, GRAPHS, strict=False):
        for place, defence in enumerate(DEFENCES):
            for n, scheme in enumerate(shown):
                found = outcomes(rows, defence, scheme=scheme, graph=graph).values()
                if not found:
                    continue
                one = share(sum(not row["worst"] <= 1.0 for row in found), len(found))
                x = n + (place - 0.5 * (len(DEFENCES) - 1)) * 0.11
                axes.errorbar(x, 100 * one.value, yerr=[[100 * (one.value - one.low)], [100 * (one.high - one.value)]],
                              marker="o", markersize=3.5, linewidth=1.2, color=f"C{place}",
                              label=defence if n == 0 else None)  # fmt: skip
        axes.set_xticks(range(len(shown)), [f"chapter {CHAPTERS[scheme].number}" for scheme in shown])
        axes.set_title(f"graph for {graph}, {LIARS[graph]} lying", fontsize=9)
        axes.axhline(2.0, color="0.6", linestyle=":", linewidth=0.8)
    panels[0].set_ylabel("lies that lead an honest UAV astray, %")
    panels[1].legend(fontsize=7)
    figure.savefig(file)
    print(f"wrote {file}")


def draw_flights(file: Path) -> None:
    """Draw the scenario `liar` undefended and defended: altitudes over time, and the leaders' hull."""
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, 2, figsize=(9.0, 3.8), sharey=True, layout="constrained")
    for axes, variants, title in zip(panels, ([], ["defended"]), ("undefended", "W-MSR, F = 1"), strict=True):
        flight = simulate("liar", form="flight", variants=variants)
        lies, graph = flight.lie_table(), flight.mission.graph
        (liar,) = {int(uav) for uav in lies["uav"]}
        led = np.array([flight.column("z", uav)[::10] for uav in graph.leaders])
        axes.fill_between(flight.t[::10], led.min(axis=0), led.max(axis=0), color="0.85", label="leaders' hull")
        for uav in graph.followers:
            label = "the liar flies" if uav == liar else "honest followers" if uav == 1 else None
            color, width = ("C3", 1.4) if uav == liar else ("C0", 0.9)
            axes.plot(flight.t[::10], flight.column("z", uav)[::10], color=color, linewidth=width, label=label)
        axes.plot(
            lies["t"][::10], lies["told_zhat"][::10], color="C3", linestyle="--", linewidth=1.2, label="the liar tells"
        )
        axes.set(title=title, xlabel="time, s")
    panels[0].set_ylabel("altitude, m")
    panels[0].legend(fontsize=7, loc="upper left")
    figure.savefig(file)
    print(f"wrote {file}")


def main() -> None:
    """Fly, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("schemes", nargs="*", default=list(CHAPTERS), metavar="SCHEME")
    parser.add_argument("--draws", type=int, default=100, help="lies of each chapter and graph")
    parser.add_argument("--costs", type=int, default=12, help="flights without lies of each chapter and defence")
    parser.add_argument("--minutes", type=float, default=60.0, help="after which no more lies are flown")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--out", type=Path, default=Path("studies/attacks"), help="folder of what was flown")
    parser.add_argument("--pictures", type=Path, default=PICTURES, help="folder of the figures")
    given = parser.parse_args()
    if unknown := [name for name in given.schemes if name not in CHAPTERS]:
        parser.error(f"{', '.join(unknown)}: choose from {', '.join(CHAPTERS)}")
    if min(given.draws, given.costs, given.jobs) < 1 or not given.minutes >= 0.0:
        parser.error("--draws, --costs and --jobs must be at least 1, --minutes not negative")
    given.out.mkdir(parents=True, exist_ok=True)
    fly_all(given.schemes, given.draws, given.minutes, given.jobs, given.out / "lies.csv")
    rows = [row for row in read(given.out / "lies.csv") if row["scheme"] in given.schemes]
    print_tables(rows)
    print_costs(fly_costs(given.schemes, given.costs, given.jobs, given.out / "costs.csv"))
    draw_shares(rows, given.pictures / "lying_shares.svg")
    draw_flights(given.pictures / "lying_altitudes.svg")


if __name__ == "__main__":
    main()
