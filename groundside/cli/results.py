"""The commands that look at what was recorded: report, compare."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ftcc.groundside.cli.common import Strict, end_by, terminal, warn

__all__ = ["compare", "report"]


def report(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run.")],
    json: Annotated[bool, typer.Option("--json", help="Print verdict and claims as JSON.")] = False,
    csv: Annotated[Path | None, typer.Option(metavar="FILE", help="Export all signals as CSV.")] = None,
    mat: Annotated[Path | None, typer.Option(metavar="FILE", help="Export all signals for MATLAB.")] = None,
    kml: Annotated[Path | None, typer.Option(metavar="FILE", help="Export a track per UAV for Google Earth.")] = None,
    gpx: Annotated[Path | None, typer.Option(metavar="FILE", help="Export a track per UAV as GPX.")] = None,
    ulog: Annotated[Path | None, typer.Option(metavar="DIR", help="Export a PX4 log (ULog) per UAV.")] = None,
    page: Annotated[bool, typer.Option(help="Write RUN/report, a page with all figures.")] = True,
    strict: Strict = False,
) -> None:
    """Show the verdict and the claims of a run, and write a page with its figures; exit code 1 if a claim fails."""
    from ftcc.groundside.claims import failed
    from ftcc.groundside.report import as_json, show, write_report
    from ftcc.groundside.results import NothingRecordedError, Run, RunError, export

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
            written.print(f"wrote {write_report(recorded)}", highlight=False, soft_wrap=True)
        raise typer.Exit(1) from None
    if json:
        print(as_json(recorded, results))
    else:
        show(terminal(), recorded, results)
    for kind, file in exports.items():
        if file is not None:
            try:
                made = export(recorded, kind, file)
            except OSError as error:
                raise RunError(f"--{kind} {file}: cannot be written: {error.strerror or error}") from None
            written.print(f"wrote {', '.join(map(str, made))}", highlight=False, soft_wrap=True)
    if page and not json:
        written.print(f"wrote {write_report(recorded)}", highlight=False, soft_wrap=True)
    if strict:
        end_by(recorded.verdict)
    if failed(results):
        raise typer.Exit(1)


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
