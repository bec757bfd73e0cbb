"""Write a film as MP4 or GIF."""

from __future__ import annotations

import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ftcc.groundside.canvas import plt
from ftcc.groundside.errors import UserError
from ftcc.groundside.movie.film import Film
from ftcc.groundside.movie.screen import Screen

if TYPE_CHECKING:
    from ftcc.groundside.results import Run

__all__ = ["MovieError", "write_movie"]

_MOST_FRAMES = 15000
"""Ten minutes at 25 frames per second."""
_SMALLEST, _LARGEST = 160, 4096
"""Width and height, pixels."""


class MovieError(UserError):
    """A film that cannot be made."""


def write_movie(
    run: Run,
    out: Path | None = None,
    *,
    seconds: float = 20.0,
    fps: float = 25.0,
    size: tuple[int, int] = (1280, 720),
    begin: float | None = None,
    end: float | None = None,
    dark: bool = False,
) -> Path:
    """Write a film of a recorded flight, and return its file.

    Parameters
    ----------
    run : Run
    out : Path, optional
        File, .mp4 or .gif; default: ``movie.mp4`` in the run's folder.
    seconds : float
        Length of the film, s.
    fps : float
        Frames per second.
    size : (int, int)
        Width and height, pixels; of a .mp4 even.
    begin, end : float, optional
        First and last simulated time, s; default: the whole flight.
    dark : bool
        Whether letters are light on dark.

    Raises
    ------
    MovieError
        If the file exists, an option is out of its range, or there is no ffmpeg for a .mp4.
    RunError
        If nothing was recorded.
    """
    out = run.path / "movie.mp4" if out is None else out
    kind = out.suffix.lower()
    if kind not in (".mp4", ".gif"):
        raise MovieError(f"{out}: a film is a .mp4 or a .gif")
    if out.exists():
        raise MovieError(f"{out}: exists already; name another file, or remove it")
    frames = _checked_frames(seconds, fps)
    screen = Screen(*_checked_size(size, kind), dark)
    first, last = _checked_times(begin, end, run.end)
    encoder = _ffmpeg() if kind == ".mp4" else None
    with _new_file(out) as unfinished:
        film = Film(run, np.linspace(first, last, frames), fps, screen)
        try:
            if encoder is None:
                _write_gif(film, unfinished, fps)
            else:
                _write_mp4(film, unfinished, fps, encoder)
        finally:
            film.close()
    return out


def _checked_frames(seconds: float, fps: float) -> int:
    if not 1.0 <= fps <= 60.0:
        raise MovieError(f"--fps {fps:g}: must be from 1 to 60")
    if not (math.isfinite(seconds) and seconds > 0.0 and 2 <= round(seconds * fps) <= _MOST_FRAMES):
        least, most = 2.0 / fps, _MOST_FRAMES / fps
        raise MovieError(f"--seconds {seconds:g}: must be from {least:.3g} to {most:.4g} at {fps:g} frames per second")
    return round(seconds * fps)


def _checked_size(size: tuple[int, int], kind: str) -> tuple[int, int]:
    width, height = size
    if not (_SMALLEST <= width <= _LARGEST and _SMALLEST <= height <= _LARGEST):
        raise MovieError(f"--size {width}x{height}: width and height must be from {_SMALLEST} to {_LARGEST} pixels")
    if kind == ".mp4" and (width % 2 or height % 2):
        raise MovieError(f"--size {width}x{height}: width and height of a .mp4 must be even")
    return width, height


def _checked_times(begin: float | None, end: float | None, flown: float) -> tuple[float, float]:
    first = 0.0 if begin is None else begin
    last = flown if end is None else end
    if not 0.0 <= first < flown:
        raise MovieError(f"--from {first:g}: must be from 0 to {flown:g} s, the end of the recording")
    if not first < last <= flown + 1e-6:
        raise MovieError(f"--to {last:g}: must be after {first:g} s and at most {flown:g} s, the end of the recording")
    return first, min(last, flown)


def _ffmpeg() -> str:
    """Return the program that encodes: the one of ``imageio-ffmpeg``, or the system's."""
    try:
        import imageio_ffmpeg
    except ModuleNotFoundError:
        found = shutil.which("ffmpeg")
        if found is None:
            raise MovieError(
                'no ffmpeg, which a .mp4 needs: pip install "ftcc-sitl[movie]", or name a .gif instead'
            ) from None
        return found
    try:
        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except RuntimeError as error:
        raise MovieError(f"no ffmpeg, which a .mp4 needs: {error}; or name a .gif instead") from None


@contextmanager
def _new_file(out: Path) -> Iterator[Path]:
    """Give a file to write beside ``out`` that becomes it at the end, if nothing went wrong.

    Raises
    ------
    MovieError
        If ``out`` has come into being meanwhile.
    """
    try:
        with tempfile.TemporaryDirectory(dir=out.parent, prefix=f".{out.name}.") as folder:
            unfinished = Path(folder) / out.name
            yield unfinished
            os.link(unfinished, out)
    except FileExistsError:
        raise MovieError(f"{out}: exists already; name another file, or remove it") from None
    except (FileNotFoundError, NotADirectoryError):
        raise MovieError(f"{out}: there is no folder {out.parent}") from None


def _write_gif(film: Film, file: Path, fps: float) -> None:
    """Write a GIF that repeats, in one palette, from the last frame, which has all colours."""
    from PIL import Image

    def picture(k: int) -> Any:
        return Image.fromarray(film.frame(k)).convert("RGB")

    palette = picture(len(film) - 1).quantize(256, Image.Quantize.MEDIANCUT)
    pictures = (picture(k).quantize(palette=palette, dither=Image.Dither.NONE) for k in range(len(film)))
    next(pictures).save(
        file, save_all=True, append_images=pictures, duration=round(1000.0 / fps), loop=0, optimize=False
    )


@contextmanager
def _ffmpeg_errors(name: str) -> Iterator[None]:
    """Turn the end of an encoder that gave up into an error to read."""
    try:
        yield
    except (BrokenPipeError, subprocess.CalledProcessError) as error:
        raise MovieError(f"{name}: ffmpeg could not write it ({error}); a .gif does without ffmpeg") from None


def _write_mp4(film: Film, file: Path, fps: float, ffmpeg: str) -> None:
    from matplotlib.animation import FFMpegWriter

    class Writer(FFMpegWriter):
        """Takes the pixels that are drawn, where matplotlib's own would draw the whole figure again."""

        def grab_frame(self, **_: Any) -> None:
            self._proc.stdin.write(film.canvas.buffer_rgba())  # type: ignore[attr-defined]

    with plt.rc_context({"animation.ffmpeg_path": ffmpeg}), _ffmpeg_errors(file.name):
        options = ["-preset", "veryfast", "-crf", "20", "-movflags", "faststart"]
        writer = Writer(fps=fps, codec="h264", extra_args=options)  # type: ignore[arg-type]  # fps may be any number
        with writer.saving(film.figure, str(file), film.figure.dpi):
            for _ in film.frames():
                writer.grab_frame()
