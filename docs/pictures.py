"""Draws the pictures of the README anew: ``python docs/pictures.py``.

Needs Mesa's Vulkan drivers or a graphics card. Flies the scenarios in one process into a temporary folder.
"""

from __future__ import annotations

import io
import os
import socket
import tempfile
import time
from pathlib import Path

from PIL import Image
from rerun.experimental import ViewerClient

from ftcc.groundside.dashboard.replay import draw_run
from ftcc.groundside.dashboard.viewer import viewer_program
from ftcc.groundside.report.curves import Flown
from ftcc.groundside.report.definitions import sheet_of
from ftcc.groundside.report.report import draw_figures
from ftcc.groundside.results.run import Run
from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import resolve
from ftcc.groundside.simulation import simulate

PICTURES = Path(__file__).parent / "pictures"
DASHBOARDS = (
    ("containment", "dashboard", 85.0),
    ("fire_monitoring", "fire", 60.0),
    ("directed_attitude", "attitude", 40.4),
)
"""Scenario, name of the picture, simulated time (s)."""
FIGURES = ("altitude", "altitude_tracking")
"""Of the first scenario."""
WIDTH = 1400
"""Of pictures, in pixels."""


def small(image: Image.Image, path: Path) -> None:
    """Write a picture of at most `WIDTH` pixels in few colours, those of the UAVs among them."""
    if image.width > WIDTH:
        image = image.resize((WIDTH, round(image.height * WIDTH / image.width)), Image.Resampling.LANCZOS)
    image.convert("RGB").quantize(256, kmeans=4, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"{path}: {path.stat().st_size // 1000} kB")


def dashboard(run: Run, folder: Path, path: Path, t: float) -> None:
    """What the dashboard shows of a run at ``t``."""
    recording = draw_run(run, folder / f"{path.stem}.rrd", rate=5.0)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    viewer = ViewerClient.spawn(headless=True, port=port, executable_path=str(viewer_program()))
    try:
        viewer.open(str(recording))
        viewer.set_time("t", duration=t, play_state="paused")
        time.sleep(2.0)  # until all is laid out
        small(Image.open(io.BytesIO(viewer.take_screenshot())), path)
    finally:
        viewer.quit()


def main() -> None:
    """All pictures."""
    os.environ["CI"] = "true"  # Rerun sends no usage statistics
    PICTURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for scenario, picture, t in DASHBOARDS:
            run = simulate(resolve(load(scenario, form="flight", duration=t + 1.0)), folder / scenario)
            dashboard(run, folder, PICTURES / f"{picture}.png", t)
        run = simulate(resolve(load(DASHBOARDS[0][0], form="flight")), folder / "whole")
        mission = run.mission
        sheet = sheet_of(mission)
        few = sheet.model_copy(update={"figures": [figure for figure in sheet.figures if figure.name in FIGURES]})
        event_times = tuple(sorted({event[0] for event in mission.events}))
        for drawn in draw_figures(few, [Flown(mission.case, run, mission, event_times)], folder):
            png = next(file for file in drawn.files if file.suffix == ".png")
            small(Image.open(png), PICTURES / f"{drawn.name}.png")


if __name__ == "__main__":
    main()
