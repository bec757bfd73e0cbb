"""Our equations of motion against JSBSim: ``python docs/jsbsim_referee.py`` prints the tables and draws the figures.

Needs the extra ``jsbsim``, and a minute. `jsbsim.md` shows what it found; the tests hold it.
"""

from __future__ import annotations

import argparse
import itertools
import math
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from ftcc.groundside.canvas import STYLE, plt  # noqa: E402
from ftcc.groundside.jsbsim import Actuator, write_aircraft  # noqa: E402
from ftcc.groundside.scenario.wind import low_altitude  # noqa: E402
from ftcc.link.actuators import ACTUATORS  # noqa: E402
from ftcc.link.airframe import Airframe  # noqa: E402
from ftcc.sim.linear_modes import modes  # noqa: E402
from ftcc.sim.trim import trim  # noqa: E402
from tests.support import referee, referee_air, referee_trim  # noqa: E402
from tests.support.referee import AIRFRAME, CASES, NAME, SHEET, STILL, Apart, apart  # noqa: E402

PICTURES = Path(__file__).parent / "pictures"
SPEEDS = (18.0, 25.0, 30.0, 35.0)
TURN = next(case for case in CASES if case.name == "turn and climb")
WIND = next(case for case in CASES if case.name.startswith("wind"))
INTEGRATORS = {1: "Euler", 3: "Adams-Bashforth 2", 4: "Adams-Bashforth 3", 5: "Adams-Bashforth 4"}
"""JSBSim's numbers of them."""
STEPS = (0.01, 0.005, 0.002, 0.001, 0.0005)
"""s; at 0.02 s Adams-Bashforth 4 is unstable, for the roll mode of 18 1/s."""
INK = "#3c4650"
"""Of text and axes."""


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table in Markdown."""
    print("| " + " | ".join(heads) + " |")
    print("|" + "---|" * len(heads))
    for row in rows:
        print("| " + " | ".join(row) + " |")
    print()


def number(value: float) -> str:
    """Two digits, small ones with a power of ten."""
    return f"{value:.2g}" if value >= 1e-3 or value == 0.0 else f"{value:.1e}".replace("e-0", "e-")


def in_row(name: str, found: Apart) -> list[str]:
    """After the flight, and the largest distance on the way."""
    end = [number(float(series[-1])) for series in found]
    return [name, *end, number(float(found.position.max())), number(float(found.attitude.max()))]


def flights() -> None:
    """Print how far both are apart after 20 s."""
    heads = ("flight", "position, m", "attitude, deg", "velocity, m/s", "rates, deg/s", "largest m", "largest deg")
    rows = [in_row(case.name, apart(referee.fly_ours(case), referee.fly_jsbsim(case))) for case in CASES]
    table(heads, rows)
    with tempfile.TemporaryDirectory() as place:
        lags = {
            "lag of 20 rad/s, thrust 5 rad/s": (20.0, 5.0, math.inf, math.inf, 0.5),
            "the same, at most 0.6 rad/s, 10 N/s": (20.0, 5.0, 0.6, 10.0, 0.0),
            "rate limits alone": (0.0, 0.0, 0.6, 10.0, 0.0),
        }
        rows = []
        for n, (name, (lag, engine, rate, pull, share)) in enumerate(lags.items()):
            actuators = {one: Actuator(-0.5, 0.5, lag, rate) for one in ACTUATORS}
            actuators["thrust"] = Actuator(0.0, SHEET.T_max, engine, pull)
            folder = Path(place) / str(n)
            write_aircraft(SHEET, NAME, folder, actuators=actuators)
            flown = referee.fly_jsbsim(TURN, folder=folder, actuators=actuators, share=share)
            rows.append(in_row(f"{TURN.name}, {name}", apart(referee.fly_ours(TURN, actuators), flown)))
        referee.write_in_si(Path(place) / "si")
        flown = referee.fly_jsbsim(TURN, folder=Path(place) / "si")
        rows.append(
            in_row(f"{TURN.name}, inertia in KG*M2, thrust by 0.22482 lb/N", apart(referee.fly_ours(TURN), flown))
        )
    flown = referee.fly_jsbsim(TURN, dt=1.0 / 120.0, integrator=None)
    rows.append(
        in_row(f"{TURN.name}, JSBSim's own integrators and step, 1/120 s", apart(referee.fly_ours(TURN), flown))
    )
    table(heads, rows)


def trims_and_modes() -> None:
    """Print trim and modes side by side."""
    rows = []
    for V in SPEEDS:
        mine, theirs = trim(AIRFRAME, V), referee_trim.jsbsim_trim(V)
        off = max(abs(b / a - 1.0) for a, b in zip(mine, theirs, strict=True))
        rows.append(
            [
                f"{V:g}",
                *(f"{value:.7g}" for pair in zip(mine, theirs, strict=True) for value in pair),
                number(100.0 * off),
            ]
        )
    heads = (
        "V, m/s",
        "alpha, rad",
        "JSBSim",
        "elevator, rad",
        "JSBSim",
        "thrust, N",
        "JSBSim",
        "largest difference, %",
    )
    table(heads, rows)
    rows = []
    for V in SPEEDS:
        theirs = [complex(one) for one in np.linalg.eigvals(referee_trim.jsbsim_matrix(V))]
        for mode in modes(AIRFRAME, V):
            near = min(theirs, key=lambda one: abs(one - mode.eigenvalue))
            off = 100.0 * abs(near - mode.eigenvalue) / abs(mode.eigenvalue)
            rows.append([f"{V:g}", mode.name, f"{mode.eigenvalue:.6f}", f"{near:.6f}", number(off)])
    table(("V, m/s", "mode", "ours, 1/s", "JSBSim, 1/s", "difference, %"), rows)


def draw_flight(file: Path) -> None:
    """Draw one flight of both, and the distance between them."""
    mine, theirs = referee.fly_ours(TURN), referee.fly_jsbsim(TURN)
    t = np.arange(len(mine.position)) * referee.SAMPLE
    figure, axes = plt.subplots(2, 2, figsize=(7.2, 4.4), layout="constrained", sharex=True)

    def both(axis: plt.Axes, of: dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]], label: str) -> None:
        for n, (name, (one, other)) in enumerate(of.items()):
            axis.plot(t, one, color=f"C{n}", linewidth=3.0, alpha=0.35, label=f"{name}, ours")
            axis.plot(t, other, color=f"C{n}", linewidth=0.9, linestyle="--", label=f"{name}, JSBSim")
        axis.set_ylabel(label)
        axis.legend(fontsize=6.5, ncols=2)

    ours, their = ((track.attitude.as_euler("ZYX", degrees=True)) for track in (mine, theirs))
    both(
        axes[0, 0], {name: (ours[:, n], their[:, n]) for n, name in ((2, "bank"), (1, "pitch"), (0, "heading"))}, "deg"
    )
    both(
        axes[0, 1],
        {
            "east": (mine.position[:, 1], theirs.position[:, 1]),
            "climb": (mine.position[:, 2] - 1000.0, theirs.position[:, 2] - 1000.0),
        },
        "m",
    )
    found = apart(mine, theirs)
    axes[1, 0].semilogy(t[1:], found.attitude[1:], label="attitude, deg")
    axes[1, 0].semilogy(t[1:], found.rates[1:], label="rates, deg/s")
    axes[1, 1].semilogy(t[1:], found.position[1:], label="position, m")
    axes[1, 1].semilogy(t[1:], found.velocity[1:], label="velocity, m/s")
    for axis in axes[1]:
        axis.set(xlabel="t, s", ylabel="apart")
        axis.legend(fontsize=6.5)
    write(figure, file)


def draw_steps(file: Path) -> None:
    """Draw how the distance falls with JSBSim's step, by integrator; and how one per cent of a parameter shows."""
    figure, axes = plt.subplots(1, 3, figsize=(7.2, 3.6), layout="constrained", width_ratios=(1.0, 1.0, 1.15))
    for axis, case in zip(axes[:2], (TURN, WIND), strict=True):
        mine = referee.fly_ours(case)
        for integrator, name in INTEGRATORS.items():
            found = []
            for dt in STEPS:
                flown = referee.fly_jsbsim(case, dt=dt, integrator=integrator)
                found.append(apart(mine, flown).position.max())
            axis.loglog(STEPS, found, marker=".", label=name)
            print(f"{case.name}, {name}: " + ", ".join(f"{dt:g} s {number(one)} m" for dt, one in zip(STEPS, found)))
        axis.set(xlabel="JSBSim's step, s", title=case.name)
        axis.legend(fontsize=6.5, loc="best" if case is TURN else "lower right")
    axes[0].set_ylabel("apart within 20 s, m")
    print()
    shown = sensitivities()
    names = sorted(shown, key=shown.__getitem__)
    axes[2].barh(names, [shown[name] for name in names], color="C0", height=0.7)
    level = float(apart(referee.fly_ours(TURN), referee.fly_jsbsim(TURN)).position.max())
    axes[2].axvline(level, color="C3", linewidth=1.2)
    axes[2].text(level, len(names) - 0.4, "as it is", color="C3", fontsize=6.5, ha="center", va="bottom")
    axes[2].set(xscale="log", xlabel="apart, m, with 1 % more of", xlim=(level / 3.0, None))
    axes[2].tick_params(axis="y", labelsize=5.5, pad=1)
    axes[2].grid(axis="y", visible=False)
    axes[2].margins(y=0.01)
    write(figure, file)


def sensitivities() -> dict[str, float]:
    """By parameter, how far both are apart within 20 s if JSBSim's has one per cent more, m."""
    mine, found = referee.fly_ours(TURN), {}
    for name in Airframe._fields:
        value = getattr(SHEET, name)
        if name == "g" or value == 0.0:
            continue
        with tempfile.TemporaryDirectory() as place:
            write_aircraft(SHEET.model_copy(update={name: 1.01 * value}), NAME, Path(place), actuators=STILL)
            found[name] = float(apart(mine, referee.fly_jsbsim(TURN, folder=Path(place))).position.max())
    return found


def draw_turbulence(file: Path, steps: int) -> None:
    """Draw the spectra of both beside those of the specification, and print standard deviations and ratios."""
    dt, altitude, wind = 0.01, 50.0, 10.0
    sizes = low_altitude(wind, altitude)
    series = {
        "ours": referee_air.our_air(steps, dt, *sizes).speed,
        "JSBSim, Tustin": referee_air.jsbsim_air(referee_air.TUSTIN, steps, dt, altitude=altitude, wind=wind).speed,
        "JSBSim, Milspec": referee_air.jsbsim_air(referee_air.MILSPEC, steps, dt, altitude=altitude, wind=wind).speed,
    }
    figure, axes = plt.subplots(2, 3, figsize=(7.2, 4.4), layout="constrained", sharex=True, height_ratios=(1.5, 1.0))
    edges = np.geomspace(0.02, 50.0, 32)
    rows = []
    for n, component in enumerate(("along the wind", "to the right", "up")):
        for k, (name, air) in enumerate(series.items()):
            frequency, found = welch(air[:, n], 1.0 / dt, nperseg=16384)
            exact = referee_air.dryden_spectra(2.0 * np.pi * frequency, *sizes)[n]
            bands = [(frequency >= low) & (frequency < high) for low, high in itertools.pairwise(edges)]
            bands = [band for band in bands if band.any()]
            middle = [frequency[band].mean() for band in bands]
            axes[0, n].loglog(
                middle, [found[band].mean() for band in bands], f"C{k}", marker=".", ms=3, lw=0.0, label=name
            )
            ratio = [float((found[band] / exact[band]).mean()) for band in bands]
            axes[1, n].semilogx(middle, ratio, f"C{k}", marker=".", ms=3, lw=0.7)
            below = [one for at, one in zip(middle, ratio, strict=True) if at < 10.0]
            rows.append(
                [
                    component,
                    name,
                    f"{air[:, n].std():.3f}",
                    f"{sizes[0][n]:.3f}",
                    f"{min(below):.2f}",
                    f"{max(below):.2f}",
                ]
            )
        axes[0, n].loglog(middle, np.interp(middle, frequency, exact), color=INK, lw=0.9, label="MIL-F-8785C", zorder=0)
        axes[0, n].set_title(component)
        axes[1, n].set(xlabel="Hz", ylim=(0.0, 2.0))
        axes[1, n].axhline(1.0, color=INK, lw=0.9, zorder=0)
    axes[0, 0].set_ylabel("(m/s)^2 per Hz")
    axes[1, 0].set_ylabel("over the specification's")
    axes[0, 0].legend(fontsize=6.5)
    table(("component", "filter", "found, m/s", "sigma, m/s", "least ratio below 10 Hz", "largest"), rows)
    write(figure, file)


def draw_turning(file: Path, steps: int) -> None:
    """Draw the spectra of p_g, q_g and r_g beside those of the specification, and print deviations and ratios."""
    dt, altitude, wind = 0.01, 50.0, 10.0
    sizes = low_altitude(wind, altitude)
    theirs = referee_air.jsbsim_air(referee_air.TUSTIN, steps, dt, altitude=altitude, wind=wind)
    series = {"ours": referee_air.our_air(steps, dt, *sizes), "JSBSim, Tustin": theirs}
    figure, axes = plt.subplots(1, 3, figsize=(7.2, 2.8), layout="constrained", sharex=True, sharey=True)
    edges = np.geomspace(0.02, 50.0, 32)
    rows = []
    for n, name in enumerate(("p_g", "q_g", "r_g")):
        for k, (side, air) in enumerate(series.items()):
            frequency, found = welch(air.turning[:, n], 1.0 / dt, nperseg=16384)
            exact = referee_air.turning_spectra(2.0 * np.pi * frequency, *sizes)[n]
            bands = [(frequency >= low) & (frequency < high) for low, high in itertools.pairwise(edges)]
            bands = [band for band in bands if band.any()]
            middle = [frequency[band].mean() for band in bands]
            density = [float(found[band].mean()) for band in bands]
            axes[n].loglog(middle, density, f"C{k}", marker=".", ms=3, lw=0.0, label=side)
            ratio = [float((found[band] / exact[band]).mean()) for band in bands]
            below = [one for at, one in zip(middle, ratio, strict=True) if at < 10.0]
            # Air that turns as a body turns nose up where it rises faster ahead, and nose right where it goes right.
            gust = {"q_g": air.speed[:, 2], "r_g": air.speed[:, 1]}.get(name)
            with_gust = "" if gust is None else f"{np.corrcoef(np.diff(gust), air.turning[1:, n])[0, 1]:+.2f}"
            deviation = np.degrees(air.turning[:, n].std())
            rows.append([name, side, f"{deviation:.2f}", f"{min(below):.2f}", f"{max(below):.2f}", with_gust])
        axes[n].loglog(middle, np.interp(middle, frequency, exact), color=INK, lw=0.9, label="MIL-F-8785C", zorder=0)
        axes[n].set(title=name, xlabel="Hz")
    axes[0].set(ylabel="(rad/s)^2 per Hz", ylim=(1e-7, None))
    axes[0].legend(fontsize=6.5)
    heads = ("rate", "filter", "found, deg/s", "least ratio below 10 Hz", "largest", "correlation with its gust's rate")
    table(heads, rows)
    write(figure, file)


def rates_in_turbulence(flights: int) -> None:
    """Print root mean squares of body rates in turbulence, with controls fixed, of both."""
    place = {"altitude": 50.0, "wind": 10.0}
    kinds = {"JSBSim, Tustin": referee_air.TUSTIN, "JSBSim, Milspec": referee_air.MILSPEC}
    ours: dict[str, dict[str, Any]] = {
        "ours, before: `turning` off": {},
        "ours, mended: `turning` on": {"turning": referee_air.our_turning},
        "ours, with JSBSim's p_g and its sign of q_g": {"turning": referee_air.jsbsims_turning, "reversed_pitch": True},
    }
    found = {
        name: [referee_air.our_rates(seed, 10.0, **place, **how) for seed in range(1, flights + 1)]
        for name, how in ours.items()
    }
    for name, kind in kinds.items():
        found[name] = [referee_air.rates_of_jsbsim(kind, seed, 10.0, **place) for seed in range(1, flights + 1)]
    with tempfile.TemporaryDirectory() as folder:
        referee_air.write_for_air_that_does_not_turn(Path(folder))
        found["JSBSim, Tustin, without turning air"] = [
            referee_air.rates_of_jsbsim(referee_air.TUSTIN, seed, 10.0, **place, folder=Path(folder))
            for seed in range(1, flights + 1)
        ]
    turning = referee_air.jsbsim_air(referee_air.TUSTIN, 100_000, 0.01, **place).turning.std(axis=0)
    mine = referee_air.our_air(100_000, 0.01, *low_altitude(place["wind"], place["altitude"])).turning.std(axis=0)
    rows = [
        [name, *(f"{one:.2f}" for one in np.degrees(air))]
        for name, air in (("p_g, q_g, r_g, ours", mine), ("p_g, q_g, r_g, JSBSim", turning))
    ]
    for name, flown in found.items():
        squares = np.array([(one[200:] ** 2).mean(axis=0) for one in flown])
        middle, spread = np.sqrt(squares.mean(axis=0)), np.sqrt(squares).std(axis=0) / math.sqrt(flights)
        rows.append([name, *(f"{a:.2f} +- {2.0 * b:.2f}" for a, b in zip(np.degrees(middle), np.degrees(spread)))])
    table(("root mean square, deg/s", "p", "q", "r"), rows)


def write(figure: plt.Figure, file: Path) -> None:
    """Write a figure."""
    figure.savefig(file, metadata={"Date": None})
    plt.close(figure)
    print(f"wrote {file}\n")


def main() -> None:
    """Compare, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--steps", type=int, default=3_000_000, help="of 10 ms, of turbulence")
    parser.add_argument("--out", type=Path, default=PICTURES, help="folder of the figures")
    given = parser.parse_args()
    if given.steps < 16384:
        parser.error("--steps must be at least 16384")
    style = {key: (INK if value == STYLE["text.color"] else value) for key, value in STYLE.items()}
    with plt.rc_context(style | {"savefig.transparent": False}):
        flights()
        trims_and_modes()
        draw_flight(given.out / "jsbsim_flight.svg")
        draw_steps(given.out / "jsbsim_steps.svg")
        rates_in_turbulence(40)
        draw_turning(given.out / "jsbsim_turning.svg", given.steps)
        draw_turbulence(given.out / "jsbsim_turbulence.svg", given.steps)


if __name__ == "__main__":
    main()
