"""What the READMEs and docs tell to type works: every command, every program, every piece of TOML in them."""

from __future__ import annotations

import itertools
import os
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import tomli_w
import typer

from ftcc.groundside import load, resolve
from ftcc.groundside.cli import main
from ftcc.groundside.cli.app import app
from ftcc.groundside.nodes import read_plan
from ftcc.groundside.scenario.loading import read, shipped
from ftcc.groundside.swarm.registry import ask_swarm, find_swarm
from ftcc.link.compiled import SCHEME_ENTRY_POINTS
from tests.sitl.conftest import FTCC, Flight
from tests.support.guests import EXAMPLE, forget_schemes, install
from tests.support.ports import free_port

REPOSITORY = Path(__file__).parents[2]
FOLDERS = ("airside", "docs", "groundside", "link", "sim", "tests")
PAGES = sorted([*REPOSITORY.glob("*.md"), *(page for name in FOLDERS for page in (REPOSITORY / name).rglob("*.md"))])
LAW = "airside/schemes/README.md"
"""Its programs are excerpts of the example's law."""

SHORTER = {
    "simulate": ["--duration", "2"],
    "fly": ["--duration", "1", "--viewer", "none", "--mavlink", "none", "--pack", "auto"],
    "verify": ["--case", "flight"],
    "study": ["--duration", "1", "--jobs", "1"],
    "movie": ["--seconds", "0.2", "--size", "320x180"],
    "search": ["--jobs", "1", "--budget", "12"],
    "map": ["--duration", "1", "--jobs", "1", "--x", "faults.0.effectiveness=0.5:1:2", "--y", "faults.0.bias=0:0.1:2"],
}
"""What is added to commands, so that they end soon and open nothing; of an option given twice the last one counts."""

NEEDS_SWARM = {
    "vehicles": "demo", "fault": "demo", "repair": "demo", "link": "demo", "ftc": "demo", "leader": "demo",
    "mode": "demo", "param": "demo", "attitude": "directed_attitude", "attack": "demo",
}  # fmt: skip
"""Commands to a flying swarm, and the scenario that it flies."""

NOT_RUN = {
    "python3 -m venv": "sets up an environment from a network",
    "pip install": "installs; the tests put the example on the path themselves",
    "pytest": "is these tests",
    "python docs/build.py": "builds the site: tests/test_site.py",
    "ftcc doctor": "flies for a quarter of a minute: tests/groundside/swarm/test_doctor.py",
    "ftcc vehicle ": "waits for an autopilot: tests/groundside/doors/test_doors.py",
    "ftcc fly attitude_synchronization --variant healthy --px4": "needs a PX4: tests/groundside/doors/test_doors.py",
    "PX4_SIM_MODEL": "needs a PX4",
    "arduplane": "needs an ArduPilot",
    "docs/autopilots.md drawing": "is a file for PX4 or ArduPilot",
    "ftcc search liar": "flies a hundred times; tests/groundside/studies/test_search.py searches",
    "ftcc calibrate": "writes beside a shipped scenario: tests/groundside/studies/test_calibration.py",
    "ftcc study containment --set diagnosis.on=true": "compiles two minutes; tests/groundside/studies has such studies",
    "ftcc replay": "shows a viewer until Ctrl-C: tests/sitl/test_viewing.py",
    "ftcc new ten.toml --scheme my_law": "needs the package installed: tests/groundside/test_new_law.py",
    "ftcc simulate my_law": "needs the package installed: tests/groundside/test_new_law.py",
    "ftcc check my_law": "needs the package installed: tests/groundside/test_new_law.py",
    "ftcc verify my_law": "needs the package installed: tests/groundside/test_new_law.py",
    "docs/tutorials/own-law.md drawing": "is a line of a law, or what is printed",
    "mavtogpx.py": "is pymavlink's: tests/sitl/test_log.py",
    "mavlogdump.py": "is pymavlink's: tests/sitl/test_log.py",
    "ftcc fly tests/example_scheme": "compiles a package for its own cache: tests/test_example_scheme.py",
    "ftcc simulate tests/example_scheme": "likewise",
    "ftcc fly jsbsim_containment": "compiles as long for what tests/sitl/test_schemes.py flies",
    "ftcc map attitude_synchronization": "compiles a law; the other map of the page shows the same command",
    "ftcc fly jsbsim_attitude": "compiles a minute for what tests/sitl/test_schemes.py shows on another law",
    "ftcc simulate jsbsim_fire": "likewise; tests/groundside/scenario/test_jsbsim.py checks the scenario",
    "jsbsim --root=. --script=": "is JSBSim's: tests/groundside/jsbsim/test_referee.py",
    "ftcc keys mesh mesh-keys --swarm twelve": "makes keys for what follows: tests/hosts/test_swarm.py",
    "ftcc keys mesh mesh-keys --bundle of-a --uavs 1-2,8": "likewise",
    "ftcc keys mesh mesh-keys --bundle of-b --uavs 3-6": "likewise",
    "ftcc fly twelve.toml --nodes": "needs two other computers: tests/hosts/test_swarm.py",
    "ftcc node --join": "needs a computer that leads: tests/hosts/test_swarm.py",
    "docs/several-computers.md drawing": "is a drawing, or the configuration of a router",
    "docker": "needs a container engine",
    "ssh": "needs another computer",
    "scp": "needs another computer",
    "ftcc fly demo --mavlink 192": "needs another computer",
    "ruff": "is a linter: .ci/run calls it",
    "dask": "runs until Ctrl-C: tests/groundside/studies/test_cluster.py",
    "OMP_NUM_THREADS=1 dask": "runs until Ctrl-C: tests/groundside/studies/test_cluster.py",
    "ftcc study containment --cluster tcp:": "needs that cluster: tests/groundside/studies/test_cluster.py",
    "mypy": "is a type checker: .ci/run calls it",
    "python -m tests.typings": "is called by .ci/run: tests/test_packages.py",
    "docs/architecture.md drawing": "is no text to type",
    "docs/compiled.md drawing": "is no text to type",
    "docs/encrypted-mesh.md drawing": "is no text to type",
    "docs/mesh.md drawing": "is no text to type",
    "docs/tick.md drawing": "is no text to type",
}
"""What begins like that is not run, and why."""


COMPILED_ONLY = {
    "import SLURMCluster": "Slurm is not here",
    "import KubeCluster": "Kubernetes is not here",
    "from mavsdk": "needs a swarm of its own: tests/clients/test_mavsdk.py runs it",
}
"""What stands in programs that are not run, and why."""


@dataclass(frozen=True)
class Block:
    """A piece of a page that is set apart."""

    page: str
    line: int
    language: str
    """"console", "python", "toml" or "drawing"."""
    text: str

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


_LANGUAGES = {"python": "python", "toml": "toml", "bash": "console", "console": "console", "sh": "console"}


def language_of(text: str) -> str:
    """Of a block that does not say it."""
    if re.match(r"(ftcc|python3?|pip|\.venv/bin/\w+) ", text):
        return "console"
    return "toml" if text.startswith("[") else "python"


def blocks_of(page: Path) -> Iterator[Block]:
    """The fenced and the indented blocks of a page."""
    name, lines = str(page.relative_to(REPOSITORY)), page.read_text(encoding="utf-8").splitlines()
    at = 0
    while at < len(lines):
        begin = at
        if fence := re.match(r"```(\w*)", lines[at]):
            at += 1
            while not lines[at].startswith("```"):
                at += 1
            text = "\n".join(lines[begin + 1 : at])
            yield Block(name, begin + 1, _LANGUAGES[fence[1]] if fence[1] else "drawing", text)
        elif lines[at].startswith("    ") and (at == 0 or not lines[at - 1].strip()):
            while at < len(lines) and (lines[at].startswith("    ") or not lines[at].strip()):
                at += 1
            text = "\n".join(line[4:] for line in lines[begin:at]).strip()
            yield Block(name, begin + 1, language_of(text), text)
            continue
        at += 1


BLOCKS = [block for page in PAGES for block in blocks_of(page)]


def commands_of(block: Block) -> Iterator[tuple[str, str]]:
    """The commands of a block, without comments: where it stands, and the command."""
    for n, line in enumerate(block.text.replace("\\\n", " ").splitlines()):
        for command in re.split(r"\s;\s|\s&&\s", re.sub(r"\s#.*", "", line)):
            if command.strip():
                yield f"{block.page}:{block.line + n}", command.strip().removeprefix(".venv/bin/")


COMMANDS = [one for block in BLOCKS if block.language == "console" for one in commands_of(block)]
PROGRAMS = [block for block in BLOCKS if block.language == "python"]
FRAGMENTS = [block for block in BLOCKS if block.language == "toml"]


def not_run(command: str) -> bool:
    return any(command.startswith(one) for one in NOT_RUN)


def is_ftcc(command: str) -> bool:
    return command.startswith("ftcc ") and not not_run(command)


def swarm_for(command: str) -> str | None:
    return NEEDS_SWARM.get(shlex.split(command)[1])


ALONE = [one for one in COMMANDS if is_ftcc(one[1]) and swarm_for(one[1]) is None]
COMMANDING = [one for one in COMMANDS if is_ftcc(one[1]) and swarm_for(one[1])]

# The first start compiles.
pytestmark = pytest.mark.timeout(600)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with a short recorded flight of containment and a small study."""
    folder = tmp_path_factory.mktemp("place")
    (folder / "tests").mkdir()
    (folder / "tests" / "example_scheme").symlink_to(EXAMPLE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FTCC_RUNTIME_DIR", str(folder / "runtime"))
        patch.setenv("COLUMNS", "200")
        patch.chdir(folder)
        asked = "containment --duration 2 --out"
        study = "containment --vary channel.loss=0,.3 --duration 1 --jobs 1 --out"
        for command in (f"simulate {asked} {folder}/runs/recorded", f"study {study} {folder}/studies/flown"):
            assert typed(command.split()) == 0
        yield folder


@contextmanager
def example_installed(site: Path) -> Iterator[None]:
    """The example's package is on the path of this process: others would compile for a cache of their own."""
    install(EXAMPLE, site)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(site))
        forget_schemes()
        yield
    forget_schemes()


_OUT = itertools.count()
"""Folders of what commands record."""


def typed(arguments: list[str]) -> int:
    """Exit code of a command, in this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["ftcc", *arguments])
        try:
            main()
        except SystemExit as end:
            return int(end.code or 0)
    return 0


def meant(text: str) -> str:
    """``text`` with the run and the study of `place` where it leaves out a name."""
    return re.sub(r"runs/[\w-]*\.\.\.", "runs/recorded", text.replace("studies/.../", "studies/flown/"))


def arguments_of(command: str) -> list[str]:
    """What is typed for a command of a page."""
    words = shlex.split(meant(command))[1:]
    more = SHORTER.get(words[0], [])
    if words[0] == "study":  # a draw has a seed of its own: one option or the other
        more = [*more, "--samples" if "--samples" in words or "--seeds" not in words else "--seeds", "2"]
    if "--port" in words:
        more = [*more, "--port", str(free_port())]  # that of the page may be another swarm's
    out = ["--out", f"out/{next(_OUT)}"] if words[0] in ("simulate", "fly", "study", "map", "search") else []
    return [*words, *more, *out]


@pytest.mark.parametrize(("where", "command"), ALONE, ids=[" ".join(one) for one in ALONE])
def test_a_command_that_needs_no_swarm_ends_well(
    where: str, command: str, place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = arguments_of(command)
    if arguments[0] == "new":
        # Pages make the same: each in a folder of its own. Its scenario is there for what follows.
        with monkeypatch.context() as patch:
            patch.chdir(tmp_path)
            assert typed(arguments) == 0
        for scenario in tmp_path.glob("*.toml"):
            scenario.replace(place / scenario.name)
        return
    if where.startswith(LAW):
        with example_installed(tmp_path):
            assert typed(arguments) == 0
        return
    if arguments[0] == "fly":
        flown = subprocess.run([*FTCC, *arguments], cwd=place, capture_output=True, text=True, timeout=300, check=False)
        assert flown.returncode == 0, flown.stdout + flown.stderr
    else:
        assert typed(arguments) == 0


@contextmanager
def flying(scenario: str, folder: Path) -> Iterator[Flight]:
    """A swarm that flies."""
    flight = Flight([scenario, "--mavlink", "none", "--pack", "auto"], folder, dict(os.environ))
    try:
        flight.wait_until(under_way, 300.0)
        yield flight
    finally:
        if flight.process.poll() is None:
            flight.interrupt()
            flight.wait(60.0)


@pytest.mark.parametrize("scenario", sorted({*NEEDS_SWARM.values()}))
def test_a_swarm_takes_every_command_that_the_pages_give_it(
    scenario: str, place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    refused = {}
    with flying(scenario, place / scenario):
        for where, command in COMMANDING:
            if swarm_for(command) == scenario and (code := typed(arguments_of(command))):
                refused[f"{where}: {command}"] = (code, capsys.readouterr().err)
        for block in PROGRAMS:
            if "Station()" in block.text and scenario == "demo":
                executed(block)
    assert refused == {}


def under_way() -> bool:
    """Whether the swarm answers, and has left the ground of t = 0."""
    try:
        return float(ask_swarm(find_swarm(None), "status")["t"]) > 0.0
    except (LookupError, OSError, RuntimeError):
        return False


def executed(block: Block) -> dict[str, Any]:
    """The names that a program has set."""
    names: dict[str, Any] = {}
    exec(compile(meant(block.text), str(block), "exec"), names)
    return names


@pytest.mark.parametrize("block", [one for one in PROGRAMS if one.page != LAW and "Station()" not in one.text], ids=str)
def test_a_program_runs(block: Block, place: Path) -> None:
    if any(name in block.text for name in COMPILED_ONLY):
        compile(block.text, str(block), "exec")
    else:
        executed(block)


@pytest.mark.parametrize("block", [one for one in PROGRAMS if one.page == LAW], ids=str)
def test_an_excerpt_of_the_law_stands_in_the_law(block: Block) -> None:
    law = {line.strip() for line in (EXAMPLE / "altitude_consensus.py").read_text().splitlines()}
    assert [line for line in block.text.splitlines() if line.strip() not in law] == []


@pytest.mark.parametrize("block", FRAGMENTS, ids=str)
def test_a_piece_of_toml_is_taken(block: Block, tmp_path: Path) -> None:
    """A piece of a scenario replaces its like in a shipped one of chapter 5; one of a package names its schemes."""
    said = tomllib.loads(block.text)
    if "project" in said:
        offered = said["project"]["entry-points"]
        assert [*offered] == [SCHEME_ENTRY_POINTS]
        assert all(isinstance(module, str) for module in offered[SCHEME_ENTRY_POINTS].values())
        if block.page == LAW:
            assert offered == tomllib.loads((EXAMPLE / "pyproject.toml").read_text())["project"]["entry-points"]
        return
    if "listen" in said:
        plan = tmp_path / "nodes.toml"
        plan.write_text(block.text)
        assert [node.name for node in read_plan(plan).nodes] == ["b", "c"]
        return
    scenario = tmp_path / "scenario.toml"
    like = "liar" if "defence" in said else "containment"
    if said.get("plant", {}).get("model") == "jsbsim":
        like = "jsbsim_containment"
    scenario.write_text(tomli_w.dumps(read(shipped()[like]) | said))
    assert resolve(load(scenario)).warnings == resolve(load(like)).warnings


def inline() -> list[tuple[str, str]]:
    """Commands within sentences."""
    return [
        (str(page.relative_to(REPOSITORY)), command)
        for page in PAGES
        for command in re.findall(r"`ftcc (\w[^`]*)`", page.read_text(encoding="utf-8"))
    ]


@pytest.mark.parametrize(("page", "command"), inline(), ids=[" ".join(one) for one in inline()])
def test_a_command_within_a_sentence_exists_with_its_options(page: str, command: str) -> None:
    words: list[str] = shlex.split(command)
    known: Any = typer.main.get_command(app)
    for word in words:
        if not hasattr(known, "commands"):
            break
        assert word in known.commands, f"{page}: ftcc {command}"
        known = known.commands[word]
    options = {name for parameter in known.params for name in (*parameter.opts, *parameter.secondary_opts)}
    assert {word.partition("=")[0] for word in words if word.startswith("--")} <= options


def test_what_is_not_run_is_listed_and_what_is_listed_is_there() -> None:
    assert [command for _, command in COMMANDS if not is_ftcc(command) and not not_run(command)] == []
    drawings = [f"{block.page} drawing" for block in BLOCKS if block.language == "drawing"]
    assert [drawing for drawing in drawings if drawing not in NOT_RUN] == []
    typed_somewhere = [command for _, command in COMMANDS] + drawings
    for listed in NOT_RUN:
        assert any(one.startswith(listed) for one in typed_somewhere), listed
