"""Films of recorded flights: a second of three seconds of flight, one of each kind of scheme."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ftcc.groundside.movie import MovieError, write_movie
from ftcc.groundside.movie.film import Film
from ftcc.groundside.movie.labels import spread
from ftcc.groundside.movie.sampling import Sampled
from ftcc.groundside.movie.screen import Screen
from ftcc.groundside.movie.writing import _ffmpeg
from ftcc.groundside.results import Run
from ftcc.groundside.simulation import simulate

SECONDS, FRAMES, SIZE = 3.0, 10, (320, 180)
KINDS = ("containment", "directed_attitude", "fire_monitoring")
"""Scenarios whose aircraft fly in the vertical plane, by attitude, and by position."""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Run]:
    """Three seconds of each kind, with the scenario's first fault after one second."""
    folder = tmp_path_factory.mktemp("runs")
    found = {}
    for name in KINDS:
        fault = {"faults.0.at": 1.0, "faults.0.bias": 0.1, "faults.0.uav": 1}
        run = simulate(name, folder / name, duration=SECONDS, settings=fault)
        assert isinstance(run, Run)
        found[name] = run
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_a_gif_has_every_frame_and_each_shows_something_else(kind: str, runs: dict[str, Run], tmp_path: Path) -> None:
    out = write_movie(runs[kind], tmp_path / "film.gif", seconds=1.0, fps=FRAMES, size=SIZE)
    with Image.open(out) as film:
        assert (film.n_frames, film.size, film.info["duration"]) == (FRAMES, SIZE, 1000 / FRAMES)
        pictures = []
        for k in range(FRAMES):
            film.seek(k)
            pictures.append(film.convert("RGB").tobytes())
    assert len(set(pictures)) == FRAMES
    assert [path.name for path in tmp_path.iterdir()] == ["film.gif"]


@pytest.mark.parametrize("kind", KINDS)
def test_the_caption_tells_of_a_fault_from_its_onset_on(kind: str, runs: dict[str, Run]) -> None:
    film = Film(runs[kind], np.array([0.0, 0.9, 1.0, 3.0]), 25.0, Screen(*SIZE))
    said = []
    for k in range(4):
        film.frame(k)
        said.append(any("UAV 1: " in line and " fault: effectiveness" in line for line in film.caption))
    film.close()
    assert said == [False, False, True, True]
    assert film.caption[0] == "t = 3.0 s"


def test_an_aircraft_counts_as_faulty_from_the_onset_of_its_fault_on(runs: dict[str, Run]) -> None:
    times = np.array([0.9, 1.1, 3.0])
    sampled = Sampled(runs["containment"], (1, 2), times)
    assert sampled.faulty().tolist() == [[False, False], [True, False], [True, False]]


def test_samples_are_the_newest_rows_and_end_with_the_recording(runs: dict[str, Run]) -> None:
    run = runs["containment"]
    sampled = Sampled(run, (1, 99), np.array([0.0, 1.234, 3.0, 4.0]))
    x = sampled.column("x")
    t, recorded = run.column("t", 1), run.column("x", 1)
    assert x[:3, 0].tolist() == [recorded[0], recorded[np.flatnonzero(t <= 1.234)[-1]], recorded[-1]]
    assert np.isnan(x[3, 0])
    assert np.isnan(x[:, 1]).all()


def test_labels_of_a_column_do_not_cover_each_other_and_keep_their_order() -> None:
    places = np.array([[0.0, 0.0], [1.0, 2.0], [0.5, 2.0], [200.0, 2.0], [np.nan, np.nan]])
    heights = spread(places, 10.0)
    assert np.diff(np.sort(heights[:3])).min() >= 10.0
    assert heights[0] == heights[:3].min()
    assert heights[:3].mean() == pytest.approx(places[:3, 1].mean())
    assert heights[3] == 2.0


def test_dark_and_upright_pictures_have_their_size(runs: dict[str, Run]) -> None:
    film = Film(runs["fire_monitoring"], np.array([0.0, 3.0]), 25.0, Screen(180, 321, dark=True))
    picture = film.frame(1)
    film.close()
    assert picture.shape == (321, 180, 4)
    assert np.median(picture[..., :3]) < 64


def test_an_mp4_of_its_length(runs: dict[str, Run], tmp_path: Path) -> None:
    try:
        ffmpeg = _ffmpeg()
    except MovieError as error:
        pytest.skip(str(error))
    out = write_movie(runs["containment"], tmp_path / "film.mp4", seconds=1.0, fps=FRAMES, size=SIZE, begin=0.5)
    decoded = subprocess.run(
        [ffmpeg, "-v", "error", "-i", out, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"], capture_output=True, check=True
    ).stdout
    assert len(decoded) == FRAMES * SIZE[0] * SIZE[1] * 3


def test_without_ffmpeg_the_way_out_is_named_and_nothing_is_left(
    runs: dict[str, Run], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(MovieError, match=r"ftcc-sitl\[movie\].*\.gif"):
        write_movie(runs["containment"], tmp_path / "film.mp4")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"fps": 0.5}, "--fps 0.5: must be from 1 to 60"),
        ({"seconds": float("nan")}, "--seconds nan: must be from"),
        ({"size": (321, 180)}, "must be even"),
        ({"size": (10, 10)}, "from 160 to 4096 pixels"),
        ({"begin": 3.0}, "--from 3: must be from 0 to 3 s"),
        ({"begin": float("nan")}, "--from nan"),
        ({"begin": 2.0, "end": 1.0}, "--to 1: must be after 2 s"),
    ],
)
def test_bad_options_are_named_with_what_would_be_right(
    options: dict[str, object], said: str, runs: dict[str, Run], tmp_path: Path
) -> None:
    with pytest.raises(MovieError, match=said):
        write_movie(runs["containment"], tmp_path / "film.mp4", **options)  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_a_file_is_not_overwritten_and_must_be_a_film_in_a_folder(runs: dict[str, Run], tmp_path: Path) -> None:
    run = runs["containment"]
    (tmp_path / "film.gif").write_bytes(b"mine")
    with pytest.raises(MovieError, match="exists already"):
        write_movie(run, tmp_path / "film.gif")
    assert (tmp_path / "film.gif").read_bytes() == b"mine"
    with pytest.raises(MovieError, match=r"a film is a \.mp4 or a \.gif"):
        write_movie(run, tmp_path / "film.avi")
    with pytest.raises(MovieError, match="there is no folder"):
        write_movie(run, tmp_path / "none" / "film.gif")
