"""Draws a picture of each scheme for the first page of the site: ``python docs/gallery.py [SCHEME ...]``.

Flies the shipped scenario of each scheme in its flight form and draws one figure of its report.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from pictures import PICTURES, small
from PIL import Image

from ftcc.groundside.report.curves import Flown
from ftcc.groundside.report.definitions import sheet_of
from ftcc.groundside.report.report import draw_figures
from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import resolve
from ftcc.groundside.simulation import simulate

FIGURES = {
    "prescribed_performance": "altitude_error",
    "nearest_neighbour": "altitude_error",
    "containment": "altitude",
    "finite_time_containment": "paths",
    "attitude_synchronization": "bank_synchronization",
    "directed_attitude": "synchronization",
    "fire_monitoring": "ellipse",
}
"""By scheme, the figure that shows what it does."""


def main() -> None:
    """All pictures of the gallery."""
    folder = PICTURES / "gallery"
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        for scheme in sys.argv[1:] or FIGURES:
            figure = FIGURES[scheme]
            run = simulate(resolve(load(scheme, form="flight")), Path(name) / scheme)
            mission = run.mission
            sheet = sheet_of(mission)
            (wanted,) = (one for one in sheet.figures if one.name == figure)
            times = tuple(sorted({event[0] for event in mission.events}))
            flown = [Flown(mission.case, run, mission, times)]
            (drawn,) = draw_figures(sheet.model_copy(update={"figures": [wanted]}), flown, Path(name))
            png = next(file for file in drawn.files if file.suffix == ".png")
            small(Image.open(png), folder / f"{scheme}.png")


if __name__ == "__main__":
    main()
