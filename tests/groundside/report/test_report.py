"""Reports: what stands on the page of a run, complete or not, and what the figures of a scheme are made of."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from pydantic import ValidationError

from ftcc.airside import schemes
from ftcc.groundside.claims import check_expression
from ftcc.groundside.errors import UserError
from ftcc.groundside.report.comparison import Comparison, labels_of
from ftcc.groundside.report.curves import Flown
from ftcc.groundside.report.definitions import Panel, Sheet, main_panels, plain_sheet, read_sheet, sheet_of
from ftcc.groundside.report.drawing import draw
from ftcc.groundside.report.readings import compare
from ftcc.groundside.report.report import write_report
from ftcc.groundside.results import Run, RunError
from ftcc.groundside.scenario.loading import forms_and_variants, load, read, shipped
from ftcc.groundside.scenario.mission import Mission, resolve
from ftcc.groundside.simulation import fly_in_memory, simulate

SHEETS = sorted((Path(__file__).parents[3] / "groundside" / "report" / "figures").glob("*.toml"))


def unknown_columns(sheet: Sheet, columns: Sequence[str]) -> list[str]:
    """Return the errors in a sheet's expressions, given the columns of a recording."""
    wrong = []
    summary = sheet.figures[0].model_copy(update={"name": "summary", "panels": main_panels(sheet), "readings": []})
    for figure in (summary, *sheet.figures):
        expressions = [*(panel.y for panel in figure.panels), *(reading.y for reading in figure.readings)]
        expressions += [e for p in figure.panels for e in (p.x, p.bound, p.true, p.reference) if e is not None]
        for expression in dict.fromkeys(expressions):
            try:
                check_expression(expression, ["t", *columns])
            except ValueError as error:
                wrong.append(f"figure {figure.name}: {error}")
    return wrong


@pytest.fixture(scope="module")
def report(demo_run: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of the demo."""
    return write_report(demo_run, tmp_path_factory.mktemp("report"))


@pytest.fixture
def copied(demo_run: Run, tmp_path: Path) -> Callable[..., Path]:
    """A copy of the demo's run without some of its files."""

    def copy(*without: str) -> Path:
        folder = tmp_path / "copy"
        shutil.copytree(demo_run.path, folder, ignore=shutil.ignore_patterns(*without, "report"))
        return folder

    return copy


@pytest.fixture
def few_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports with one figure, for tests that are not about figures."""

    def first(mission: Mission) -> Sheet:
        sheet = sheet_of(mission)
        return sheet.model_copy(update={"figures": sheet.figures[1:2]})

    for module in ("report", "comparison"):
        monkeypatch.setattr(f"ftcc.groundside.report.{module}.sheet_of", first)
    monkeypatch.setattr("ftcc.groundside.report.report.figure_of_claims", lambda *_: None)


def words(page: Path) -> str:
    """The text of a page, without its figures."""
    html = re.sub(r"<(svg|style)\b.*?</\1>", "", page.read_text(), flags=re.S)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", html))


def test_the_page_needs_nothing_but_itself(report: Path) -> None:
    html = report.read_text()
    assert not re.search(r'(src|href|url)\s*[=(]\s*["\']?\s*(https?:|//|[\w./]+\.(png|svg|css|js))', html)
    assert "<script" not in html
    assert html.count("<svg") >= 10
    assert "prefers-color-scheme: dark" in html
    assert "@media print" in html


def test_the_page_has_claims_events_links_versions_and_seed(report: Path, demo_run: Run) -> None:
    text = words(report)
    assert "verdict as it should be" in text
    assert "altitude off its place between the leaders, z - z_d" in text
    assert "8 of 8 claims hold" in text
    assert "altitude tracking of UAV 1 at its fault" in text
    assert "elevator fault: effectiveness 0.7, bias 0.35 rad" in text
    assert "link 8 - 4 cut" in text
    assert "seed 1" in text
    assert "flown 120 of 120 s" in text
    flown = demo_run.scenario.plan.flown
    assert flown is not None
    assert f"numpy {flown.versions['numpy']}" in text


def test_the_cut_link_lost_what_was_sent_while_it_was_cut(report: Path) -> None:
    row = re.search(r"UAV 8 UAV 4 (\d+) (\d+) (\d+) \(([\d.]+) %\) (\d+) ([\d.]+) ([\d.]+)", words(report))
    assert row is not None
    sent, received, lost, share, missing, _, oldest = (float(number) for number in row.groups())
    # 20 records a second; those of the last latency of 0.05 s are still under way. Cut from 76 to 84 s.
    assert sent == 20 * 120
    assert (lost, missing) == (20 * 8, 0)
    assert received == sent - lost
    assert share == pytest.approx(100.0 * lost / sent, abs=0.1)
    assert oldest == pytest.approx(8.1, abs=0.06)


def test_figures_come_as_svg_pdf_and_png(report: Path) -> None:
    names = {path.stem for path in report.parent.glob("*.svg")}
    assert {"altitude", "elevator", "estimates", "links", "timeline"} <= names
    for name in names:
        ElementTree.parse(report.parent / f"{name}.svg")
        assert (report.parent / f"{name}.pdf").read_bytes().startswith(b"%PDF")
        assert (report.parent / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_every_id_on_the_page_is_there_once(report: Path) -> None:
    ids = re.findall(r'\bid="([^"]+)"', report.read_text())
    assert len(ids) == len(set(ids))


def test_a_scenario_of_ones_own_is_not_held_against_the_monograph(report: Path) -> None:
    assert "Compared with the monograph" not in words(report)


def test_a_picture_at_the_top_shows_verdict_and_faults(report: Path) -> None:
    picture = re.search(r'<figure id="summary">.*?</figure>', report.read_text(), flags=re.S)
    assert picture is not None
    assert 'id="summary-panel0"' in picture[0]
    assert "verdict: as it should be; 8 of 8 claims hold" in picture[0]
    assert "fault, UAV 1" in picture[0]
    assert report.read_text().index('id="summary"') < report.read_text().index('id="verdict"')


def test_every_claim_leads_to_the_panel_and_the_time_that_show_it(report: Path, demo_run: Run) -> None:
    html = report.read_text()
    table = re.search(r'<table class="claims">.*?</table>', html, flags=re.S)
    assert table is not None
    links = re.findall(r'<a href="#([^"]+)">([^<]+)</a>', table[0])
    assert len(links) == len(demo_run.mission.claims) == 8
    assert [anchor for anchor, _ in links if f'id="{anchor}"' not in html] == []
    for (_, text), claim in zip(links, demo_run.mission.claims, strict=True):
        assert text.endswith(f", {claim.window[0]:g} - {claim.window[1]:g} s")
    # The closest view of the signal: the panel of the fault's two seconds.
    at_fault = next(anchor for anchor, text in links if "40 - 42 s" in text)
    drawn = ElementTree.parse(report.parent / f"{at_fault.partition('-')[0]}.svg")
    panel = next(g for g in drawn.iter("{http://www.w3.org/2000/svg}g") if g.get("id") == at_fault.partition("-")[2])
    ticks = [
        float(e.text or "nan")
        for e in panel.iter("{http://www.w3.org/2000/svg}text")
        if (e.text or "")[:2] in ("40", "41", "42")
    ]
    assert {40.0, 41.0, 42.0} <= set(ticks)


@pytest.mark.usefixtures("few_figures")
def test_figures_come_in_the_size_and_type_of_a_journal(demo_run: Run, tmp_path: Path) -> None:
    page = write_report(demo_run, tmp_path, "ieee")
    pdf = (tmp_path / "ieee" / "altitude.pdf").read_bytes()
    box = re.search(rb"/MediaBox \[ 0 0 ([\d.]+) ", pdf)
    assert box is not None
    assert float(box[1]) == pytest.approx(3.5 * 72.0)
    assert b"/FontFile2" in pdf
    assert b"/Type3" not in pdf
    assert set(re.findall(r"font-size: ([\d.]+)px", (tmp_path / "ieee" / "altitude.svg").read_text())) == {"8"}
    latex = (tmp_path / "ieee" / "altitude.tex").read_text()
    assert latex == (
        "\\begin{figure}\n  \\centering\n  \\includegraphics[width=\\columnwidth]{altitude.pdf}\n"
        "  \\caption{Altitudes between those of the leaders (scenario demo, flight).}\n"
        "  \\label{fig:altitude}\n\\end{figure}\n"
    )
    assert latex.rstrip() in page.read_text()
    assert "ieee/altitude.pdf" in words(page)
    wide = (tmp_path / "altitude.tex").read_text()
    assert "\\begin{figure*}" in wide
    with pytest.raises(UserError, match=r"style 'acm': there is wide, ieee, ieee-wide, springer, springer-wide"):
        write_report(demo_run, tmp_path, "acm")


# --- runs that are not whole ------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("few_figures")
def test_a_run_that_was_killed_half_way_is_reported_as_far_as_it_goes(copied: Callable[..., Path]) -> None:
    folder = copied("signals.parquet")
    shutil.rmtree(folder / "parts", ignore_errors=True)
    run = simulate(resolve(load("demo", duration=30.0)), folder.parent / "short")
    shutil.copy(run.path / "signals.parquet", folder / "signals.parquet")
    (folder / "logs").mkdir()
    page = words(write_report(Run(folder)))
    assert "The flight ended at 30 s of 120 s and did not end normally" in page
    assert "2 of 8 claims hold, 6 not flown" in page
    assert "late ticks not known" in page


@pytest.mark.usefixtures("few_figures")
def test_the_report_of_an_empty_recording_says_so(copied: Callable[..., Path]) -> None:
    page = words(write_report(Run(copied("signals.parquet", "links.parquet"))))
    assert "nothing was recorded" in page
    assert "0 of 8 claims hold, 8 not flown" in page
    assert "elevator fault" in page
    assert "The run recorded no links" in page


def test_a_damaged_recording_is_named(copied: Callable[..., Path]) -> None:
    folder = copied()
    whole = (folder / "signals.parquet").read_bytes()
    (folder / "signals.parquet").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(RunError, match=r"signals\.parquet.*cannot be read"):
        write_report(Run(folder))


@pytest.mark.parametrize("kind", ["empty folder", "file", "nothing"])
def test_what_is_no_run_is_refused(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "run"
    if kind == "empty folder":
        path.mkdir()
    elif kind == "file":
        path.write_text("no run")
    with pytest.raises(RunError, match="is not the folder of a run"):
        Run(path)


# --- figures as data --------------------------------------------------------------------------------------------------


def shipped_mission(scheme: str) -> Mission:
    """A shipped scenario that flies a scheme."""
    for path in shipped().values():
        document = read(path)
        if document["scheme"] == scheme:
            return resolve(load(str(path), form=forms_and_variants(document)[0][0], duration=0.2))
    pytest.skip(f"no shipped scenario flies {scheme}")


@pytest.mark.parametrize("path", SHEETS, ids=lambda path: path.stem)
def test_a_sheet_draws_what_its_scheme_records(path: Path) -> None:
    sheet = read_sheet(path)
    assert path.stem in schemes.names()
    mission = shipped_mission(path.stem)
    assert sheet.scenarios
    assert set(sheet.scenarios) <= set(shipped())
    flight = fly_in_memory(mission)
    assert unknown_columns(sheet, flight.names) == []
    assert draw(main_panels(sheet), [Flown("flight", flight, mission)], 2) is not None
    whole = [panel for figure in sheet.figures for panel in figure.panels if panel.window is None]
    made = draw(whole, [Flown("flight", flight, mission)])
    blocks = [block for axes in made.axes for block in axes.collections]
    assert len(blocks) == len(mission.obstacles)
    explained = {text.get_text() for text in made.legends[0].get_texts()}
    assert ("obstacle" in explained) == bool(mission.obstacles)
    assert ("fire, first" in explained) == (mission.fire is not None)


def test_a_scheme_without_a_sheet_has_figures_of_what_it_declares() -> None:
    mission = shipped_mission("containment")
    sheet = plain_sheet(mission)
    assert [figure.name for figure in sheet.figures] == ["motion", "errors", "estimates", "commands"]
    assert {panel.y for panel in sheet.figures[1].panels} == {"S1", "S5"}
    assert unknown_columns(sheet, fly_in_memory(mission).names) == []


def test_a_sheet_that_is_wrong_names_file_field_and_value(tmp_path: Path) -> None:
    path = tmp_path / "sheet.toml"
    path.write_text('figures = [{ name = "a", title = "A", panels = [{ y = "z", label = "z", colour = "red" }] }]')
    with pytest.raises(UserError, match=r"sheet\.toml:\n  figures\.0\.panels\.0\.colour = 'red'"):
        read_sheet(path)


def test_readings_tell_what_agrees_and_by_how_much_others_differ() -> None:
    mission = resolve(load("containment", form="flight", duration=2.0))
    flight = Flown("flight", fly_in_memory(mission), mission)
    base = {"what": "airspeed", "y": "V", "unit": "m/s", "window": (0.0, 2.0)}
    readings = [
        base | {"monograph": (29.9, 30.1), "kind": "within"},
        base | {"monograph": (30.5, 31.0), "kind": "within"},
        base | {"y": "V * 0 + 3", "monograph": (2.0, 3.0), "kind": "extremes"},
        base | {"window": (0.0, 50.0), "monograph": (29.9, 30.1)},
        base | {"y": "nothing", "monograph": (0.0, 1.0)},
    ]
    sheet = sheet_of(mission)
    figure = sheet.figures[0].model_validate(
        {"name": "x", "title": "X", "panels": [{"y": "V", "label": "V"}], "readings": readings}
    )
    one, two, three, four, five = compare(sheet.model_copy(update={"figures": [figure]}), flight)
    assert (one.agrees, one.difference) == (True, "")
    assert two.agrees is False
    assert "beyond" in two.difference
    assert (three.measured, three.agrees, three.difference) == ("3", False, "the lowest value differs by +1 m/s")
    assert (four.agrees, four.difference) == (None, "not flown")
    assert (five.agrees, five.difference) == (None, "not recorded")


def test_only_an_angle_is_drawn_without_jumps_of_a_turn() -> None:
    assert Panel(y="degrees(mu)", label="bank", unit="deg", unwrap=True).turn == 360.0
    assert Panel(y="mu", label="bank", unit="rad").turn is None
    with pytest.raises(ValidationError, match="unit = 'm' is not that of an angle"):
        Panel(y="z", label="altitude", unit="m", unwrap=True)


def test_thinned_curves_keep_their_extremes() -> None:
    mission = shipped_mission("containment")
    flight = fly_in_memory(resolve(load("containment", form="monograph", duration=60.0)))
    made = draw([Panel(y="V", label="V", uavs=[1])], [Flown("flight", flight, mission)])
    (line,) = (line for line in made.axes[0].lines if len(line.get_xdata()) > 10)
    drawn, recorded = np.asarray(line.get_ydata()), flight.column("V", 1)
    assert len(drawn) < len(recorded)
    assert (drawn.min(), drawn.max()) == (recorded.min(), recorded.max())


# --- runs compared ----------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("few_figures")
def test_runs_are_compared_by_case_claim_by_claim(tmp_path: Path) -> None:
    runs = [
        simulate(
            resolve(load("containment", variants=variants, duration=52.0)), tmp_path / "-".join(["run", *variants])
        )
        for variants in ((), ("off",))
    ]
    assert labels_of(runs) == ["flight", "flight+off"]
    heads, rows = (comparison := Comparison(runs)).rows()
    assert [head.text for head in heads] == ["claim", "window, s", "flight", "flight+off"]
    on, off = next(row for row in rows if row[0].text == "altitude tracking when the disturbances set in")[2:]
    assert (on.mark, off.mark) == ("holds", "holds")
    assert float(on.text.split()[0]) < 0.5 * float(off.text.split()[0])
    page = comparison.write(tmp_path / "compared")
    assert "flight+off" in words(page)
    assert (tmp_path / "compared" / "altitude.pdf").exists()


def test_runs_of_one_case_are_distinguished_by_their_folders(demo_run: Run) -> None:
    assert len(set(labels_of([demo_run, Run(demo_run.path)]))) == 1  # the very same folder
    assert demo_run.path.name in labels_of([demo_run, Run(demo_run.path)])[0]


def test_json_of_the_claims_holds_no_nan(demo_run: Run) -> None:
    from ftcc.groundside.report import as_json

    assert json.loads(as_json(demo_run, demo_run.claims()))["claims"]
