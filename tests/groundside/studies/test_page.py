"""The report of a study: its numbers are those of the answers, and it needs no network."""

from __future__ import annotations

import html
import json
import math
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from ftcc.groundside.cli.app import app
from ftcc.groundside.schema import Claim
from ftcc.groundside.studies import HEADLINE, Outcome, Study, StudyError, percent, plan_study, table_of
from ftcc.groundside.studies.documents import latex_text
from ftcc.groundside.studies.folder import save_plan
from ftcc.groundside.studies.reasons import reasons_in
from ftcc.groundside.studies.rows import write_table
from ftcc.groundside.verdict import AS_IT_SHOULD, FAILED

SAMPLES = 20
NAME = "hull <b>& 50 % of_it</b>"
REFUSED = "faults.0 (effectiveness {}): leaves UAV {} no level trim"


def claim(name: str) -> Claim:
    table = {
        "name": name, "metric": "max_abs", "signal": "z", "window": [0.0, 1.0], "unit": "m", "source": "test",
        "expected": {"flight": 0.0}, "tolerance": "< 0.5",
    }  # fmt: skip
    return Claim.model_validate(table)


def outcome(number: int, drawn: tuple[Any, ...]) -> Outcome:
    """Refused: draws 3 and 7. Off fails where effectiveness is low; flight 10 breaks off."""
    draw, off = divmod(number, 2)
    if draw in (3, 7):
        return Outcome(number, drawn, refused=True, error=REFUSED.format(0.1 * draw, draw))
    if number == 10:
        return Outcome(number, drawn, error="ValueError: <script>alert(1)</script> (law.py:12)")
    value = 0.1 + 0.01 * draw + (0.8 if off and drawn[0] < 0.6 else 0.0)
    good = value < 0.5
    return Outcome(number, drawn, (value,), (good,), verdict=AS_IT_SHOULD if good else FAILED, largest=value)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """A study that nothing has flown."""
    from dataclasses import replace

    folder = tmp_path_factory.mktemp("a study")
    plan = plan_study(
        "containment",
        random=["faults.0.effectiveness=uniform(low=0.3, high=1)", "faults.0.uav=choice(values=[1, 2])"],
        samples=SAMPLES,
        against=["off"],
    )
    plan = replace(plan, question="Does <it> hold & why?", claims=(claim(NAME),))
    save_plan(plan, folder)
    outcomes = [outcome(n, plan.draws.values(plan.trial(n).draw)) for n in range(plan.count)]
    write_table(table_of(plan, outcomes), folder)
    return Study(folder)


@pytest.fixture(scope="module")
def page(study: Study) -> str:
    return study.report().read_text(encoding="utf-8")


class Cells(HTMLParser):
    """Texts of the cells of each table of a page, by its class."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tables: dict[str, list[list[str]]] = {}
        self._rows: list[list[str]] = []
        self._inside = False
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "table":
            self._rows = self.tables.setdefault(str(dict(attrs)["class"]), [])
        elif tag == "tr":
            self._rows.append([])
        elif tag == "td":
            self._rows[-1].append("")
        self._inside = tag == "td" or (self._inside and tag == "span")

    def handle_data(self, data: str) -> None:
        if self._inside:
            self._rows[-1][-1] += data

    def handle_endtag(self, tag: str) -> None:
        self._inside = self._inside and tag == "span"


def test_the_numbers_are_those_of_the_answers(study: Study, page: str) -> None:
    answers, tables = study.answers, Cells(page).tables
    on, off = answers.share(HEADLINE, 0), answers.share(HEADLINE, 1)
    assert (on.count, on.of) == (17, 18)
    assert off.of == 18
    assert off.count < 18
    shares = {row[0]: row[1:] for row in tables["answer"][1:]}
    assert list(shares) == answers.titles
    for title, cells in shares.items():
        found = [answers.share(title, n) for n in (0, 1)]
        assert cells == [f"{percent(one)} ({one.count} of {one.of})" for one in found]
    both = answers.paired(HEADLINE, 1)
    row = next(row for row in tables["differences"] if row and row[0] == HEADLINE)
    assert [int(cell) for cell in row[2:6]] == [both.both, both.only_first, both.only_second, both.neither]
    assert row[7] == f"{both.p:.2g}"
    for sentence in answers.sentences():
        assert html.escape(sentence, quote=False) in page.replace("&#39;", "'")


def test_failed_flights_stand_with_their_values_and_the_command(study: Study, page: str) -> None:
    rows = Cells(page).tables["failed"][1:]
    assert [int(row[0]) for row in rows] == study.answers.failed()
    assert 10 in study.answers.failed()
    table = {row["flight"]: row for row in study.table.to_pylist()}
    for row in rows:
        flight = table[int(row[0])]
        assert float(row[2]) == pytest.approx(flight["faults.0.effectiveness"], rel=1e-5)
        assert int(row[3]) == flight["faults.0.uav"]
        assert row[-1] == f"ftcc simulate '{study.folder}' --row {flight['flight']}"


def test_refused_draws_are_counted_by_kind(study: Study, page: str) -> None:
    (row,) = Cells(page).tables["refused"][1:]
    assert row[:2] == ["4", REFUSED.format("…", "…")]
    assert Cells(page).tables["errors"][1][0] == "1"


def test_names_are_escaped_and_nothing_comes_from_a_network(page: str, study: Study) -> None:
    assert NAME not in page
    assert html.escape(NAME) in page
    assert "<script" not in page
    assert "Does &lt;it&gt; hold &amp; why?" in page
    loaded = re.findall(r"""(?:src|href)\s*=\s*["']([^"']+)""", page)
    assert {link.partition(":")[0] for link in loaded if not link.startswith("#")} <= {
        path.name for path in (study.folder / "report").iterdir()
    }
    assert "@import" not in page
    assert not re.search(r"url\((?!#)", page)


def test_the_design_says_what_the_intervals_are(study: Study, page: str) -> None:
    from dataclasses import replace

    from ftcc.groundside.studies import Answers
    from ftcc.groundside.studies.documents import interval_kind

    assert "conservative" in interval_kind(study.answers)
    assert "not proven" in page
    independent = replace(study.plan, draws=replace(study.plan.draws, design="random"))
    assert interval_kind(Answers(independent, study.table)).startswith("exact")


def test_figures_are_the_same_every_time(study: Study, page: str, tmp_path: Path) -> None:
    files = study.draw(tmp_path)
    assert {file.suffix for file in files} == {".svg", ".pdf", ".png"}
    assert {file.stem for file in files} == {"study", "shares", "influences"}
    for file in files:
        assert file.read_bytes() == (study.folder / "report" / file.name).read_bytes(), file.name
        assert f'href="{file.name}"' in page
    with pytest.raises(StudyError, match="nothing to draw"):
        study.figure("sensitivities")
    with pytest.raises(StudyError, match="must be one of study, shares"):
        study.figure("hares")


def test_the_table_for_latex_is_balanced_and_escaped(study: Study) -> None:
    text = study.latex()
    bare = re.sub(r"\\[{}]", "", text)
    assert bare.count("{") == bare.count("}")
    assert text.count(r"\begin") == text.count(r"\end") == 2
    assert len(re.findall(r"(?<!\\)\$", text)) % 2 == 0
    rows = [line for line in text.splitlines() if line.endswith(r"\\")]
    assert {len(re.findall(r"(?<!\\)&", row)) for row in rows} == {2}
    on = study.answers.share(HEADLINE, 0)
    assert f"all of it & {100 * on.value:.1f} [{100 * on.low:.1f}, {100 * on.high:.1f}] &" in text
    assert r"hull \textless{}b\textgreater{}\& 50 \% of\_it" in text
    assert f"{SAMPLES} draws (sobol, seed" in text


def test_text_for_latex() -> None:
    assert latex_text(r"a\b_{c}^2 ~ #1 $ 5 %") == (
        r"a\textbackslash{}b\_\{c\}\textasciicircum{}2 \textasciitilde{} \#1 \$ 5 \%"
    )
    assert latex_text("δ Λ λ ±30°") == r"$\delta$ $\Lambda$ $\lambda$ $\pm$30\textdegree{}"


def test_texts_that_differ_in_numbers_are_one_kind() -> None:
    texts = ["faults.0 (bias -0.2 rad): UAV 3, k11 at 30 m/s", "faults.0 (bias 1e-05 rad): UAV 4, k11 at 30 m/s"]
    other = ["faults.1 (bias 0.2 rad): UAV 3, k11 at 30 m/s", "x (law.py:1)", "x (law.py:2)"]
    found = reasons_in([other[0], *texts, *other[1:]])
    assert [(one.count, one.text) for one in found] == [
        (2, "faults.0 (bias … rad): UAV …, k11 at 30 m/s"),
        *((1, text) for text in other),
    ]
    assert found[0].line == f"2 x {found[0].text}, for example: {texts[0]}"
    assert found[1].line == f"1 x {other[0]}"


def test_the_command(study: Study, tmp_path: Path) -> None:
    run = CliRunner()
    found = run.invoke(app, ["report", str(study.folder), "--json"])
    assert found.exit_code == 0, found.output
    document = json.loads(found.stdout)
    on = study.answers.share(HEADLINE, 0)
    assert document["shares"][0] == {
        "claim": HEADLINE, "combination": 0, "holds": on.count, "of": on.of,
        "share": on.value, "low": on.low, "high": on.high,
    }  # fmt: skip
    assert document["failed"] == study.answers.failed()
    assert document["refused"][0]["count"] == 4
    quantiles = [one for one in document["quantiles"] if one["combination"] == 0]
    assert quantiles[0]["0.05"]["low"] is None
    assert math.isfinite(quantiles[0]["0.5"]["low"])

    file = tmp_path / "table.tex"
    found = run.invoke(app, ["report", str(study.folder), "--latex", str(file), "--no-page"])
    assert found.exit_code == 0, found.output
    assert file.read_text() == study.latex()
    assert "4 x faults.0 (effectiveness …)" in found.stdout
    assert run.invoke(app, ["report", str(study.folder), "--latex", "-"]).stdout == study.latex()


def test_options_of_runs_are_refused(study: Study) -> None:
    for option in (["--csv", "x.csv"], ["--strict"], ["--json", "--latex", "-"]):
        assert CliRunner().invoke(app, ["report", str(study.folder), *option]).exit_code == 2


def test_a_notebook_shows_the_answers(study: Study) -> None:
    shown = study._repr_html_()
    assert html.escape(NAME) in shown
    assert NAME not in shown
    assert percent(study.answers.share(HEADLINE, 1)) in shown
