"""The commands that look at what was recorded: report, compare, export."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ftcc.groundside.cli.common import Strict, end_by, fail, terminal, warn

if TYPE_CHECKING:
    from ftcc.groundside.results import Run

__all__ = ["compare", "export", "report"]


def report(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run, or of a study.")],
    json: Annotated[
        bool, typer.Option("--json", help="Print verdict and claims, or a study's answers, as JSON.")
    ] = False,
    latex: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Of a study: export the answers as a table for LaTeX; -: print it."),
    ] = None,
    csv: Annotated[Path | None, typer.Option(metavar="FILE", help="Export all signals as CSV.")] = None,
    mat: Annotated[Path | None, typer.Option(metavar="FILE", help="Export all signals for MATLAB.")] = None,
    kml: Annotated[Path | None, typer.Option(metavar="FILE", help="Export a track per UAV for Google Earth.")] = None,
    gpx: Annotated[Path | None, typer.Option(metavar="FILE", help="Export a track per UAV as GPX.")] = None,
    ulog: Annotated[Path | None, typer.Option(metavar="DIR", help="Export a PX4 log (ULog) per UAV.")] = None,
    page: Annotated[bool, typer.Option(help="Write RUN/report, a page with all figures.")] = True,
    style: Annotated[
        str | None,
        typer.Option(
            metavar="STYLE",
            help="Write the figures also in this style, into RUN/report/STYLE: ieee or springer for one column, "
            "ieee-wide or springer-wide for both; default: only wide, as on the page.",
        ),
    ] = None,
    strict: Strict = False,
) -> None:
    """Show the verdict and the claims of a run, and write a page with its figures; exit code 1 if a claim fails.

    Of a study: show how often its claims hold, and write a page with intervals, figures and failed flights.
    """
    from ftcc.groundside.claims import failed
    from ftcc.groundside.report import as_json, look_of, show, write_report
    from ftcc.groundside.results import NothingRecordedError, Run
    from ftcc.groundside.studies import is_study

    if is_study(run):
        files = {"--csv": csv, "--mat": mat, "--kml": kml, "--gpx": gpx, "--ulog": ulog}
        given: dict[str, object] = {**files, "--style": style, "--strict": strict}
        for option in (option for option, value in given.items() if value):
            fail(f"{option}: is for a run; {run} is a study, whose table is study.parquet")
        _report_study(run, json, latex, page)
        return
    if latex is not None:
        fail(f"--latex: is for a study; {run} is none")
    if style is not None:
        look_of(style)  # before anything is shown
        if json or not page:
            fail("--style: is of figures, which are written with the page: leave out --json and --no-page")
    recorded = Run(run)
    exports = {"csv": csv, "mat": mat, "kml": kml, "gpx": gpx, "ulog": ulog}
    written = terminal(stderr=True)
    try:
        results = recorded.claims()
    except NothingRecordedError as error:
        if json or any(exports.values()):
            raise
        warn(str(error))
        if page:
            written.print(f"wrote {write_report(recorded, style=style)}", highlight=False, soft_wrap=True)
        raise typer.Exit(1) from None
    if json:
        print(as_json(recorded, results))
    else:
        show(terminal(), recorded, results)
    for kind, file in exports.items():
        if file is not None:
            _export(recorded, kind, file, f"--{kind} {file}")
    if page and not json:
        written.print(f"wrote {write_report(recorded, style=style)}", highlight=False, soft_wrap=True)
    if strict:
        end_by(recorded.verdict)
    if failed(results):
        raise typer.Exit(1)


def _report_study(folder: Path, json: bool, latex: Path | None, page: bool) -> None:
    """Show the answers of a study, and write what is asked for."""
    from ftcc.groundside.studies import Study, StudyError, as_json, show

    study = Study(folder)
    if not study.answers.draws:
        raise StudyError(f"{folder}: no flight is finished yet; to go on: ftcc study {folder} --resume")
    printed = latex == Path("-")
    if json and printed:
        fail("--json and --latex -: both print; give one, or --latex a file")
    written = terminal(stderr=True)
    if json:
        print(as_json(study.answers))
    elif printed:
        print(study.latex(), end="")
    else:
        show(terminal(), study.answers)
    if latex is not None and not printed:
        try:
            latex.write_text(study.latex(), encoding="utf-8")
        except OSError as error:
            raise StudyError(f"--latex {latex}: cannot be written: {error.strerror or error}") from None
        written.print(f"wrote {latex}", highlight=False, soft_wrap=True)
    if page and not json and not printed:
        written.print(f"wrote {study.report()}", markup=False, highlight=False, soft_wrap=True)


def export(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run.")],
    format: Annotated[
        str, typer.Option("--format", metavar="FORMAT", help="csv, parquet, mat, ulog, mcap, rosbag2, kml or gpx.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(metavar="PATH", help="File, or folder for ulog and rosbag2; default: in RUN/export."),
    ] = None,
) -> None:
    """Export the recording of a run for other programs: tables, logs of PX4, Foxglove and ROS, tracks for maps."""
    from ftcc.groundside.results import Run
    from ftcc.groundside.studies import is_study

    if is_study(run):
        fail(f"{run}: is a study, whose table is study.parquet; export one of its flights")
    _export(Run(run), format, out, f"--out {out}" if out else str(run / "export"))


def _export(run: Run, format: str, target: Path | None, what: str) -> None:
    """Export a run and print the files; ``what`` names the place in the message if it cannot be written."""
    from ftcc.groundside.results import RunError
    from ftcc.groundside.results import export as write

    try:
        made = write(run, format, target)
    except OSError as error:
        raise RunError(f"{what}: cannot be written: {error.strerror or error}") from None
    terminal(stderr=True).print(f"wrote {', '.join(map(str, made))}", markup=False, highlight=False, soft_wrap=True)


def compare(
    runs: Annotated[
        list[Path], typer.Argument(metavar="RUN RUN...", help="Folders of two or more runs of one scheme.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for the page and its figures.")] = Path("runs/compared"),
) -> None:
    """Compare runs: the same figures with a colour per run, and one table of claims."""
    from rich.table import Table
    from rich.text import Text

    from ftcc.groundside.report import Comparison
    from ftcc.groundside.results import Run, RunError

    if len(runs) < 2:
        raise RunError("compare: needs at least two runs")
    comparison = Comparison([Run(path) for path in runs])
    heads, rows = comparison.rows()
    table = Table(header_style="bold", pad_edge=False)
    for head in heads:
        table.add_column(head.text, justify="right" if head.number else "left", overflow="fold")
    styles = {"holds": "green", "fails": "bold red", "open": "dim"}
    for row in rows:
        table.add_row(*(Text(cell.text, styles.get(cell.mark, "")) for cell in row))
    terminal().print(table)
    try:
        page = comparison.write(out)
    except OSError as error:
        raise RunError(f"--out {out}: cannot be written: {error.strerror or error}") from None
    terminal(stderr=True).print(f"wrote {page}", highlight=False, soft_wrap=True)
