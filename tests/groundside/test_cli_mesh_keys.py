"""`ftcc keys mesh`: what it makes, keeps, renews, copies and lists, and what it refuses before it touches anything."""

from __future__ import annotations

import datetime
import stat
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from ftcc.groundside.cli import main
from ftcc.link.mesh_keys import MeshKeysError, load_certificate, names_in
from ftcc.link.mesh_security import Credentials

Outcome = tuple[int, str, str]


@pytest.fixture
def mesh(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Callable[..., Outcome]:
    """Run `ftcc keys mesh` in an empty folder: exit code, standard output, standard error."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["ftcc", "keys", "mesh", *arguments])
        code = 0
        try:
            main()
        except SystemExit as end:
            code = int(end.code or 0)
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_the_first_call_makes_an_authority_and_a_certificate_for_each(mesh):
    code, out, _ = mesh("keys", "--swarm", "demo", "--uavs", "1-3,7", "--node", "a", "--days", "10")
    assert code == 0
    assert "uav-1 to uav-3, uav-7, node-a, lead" in out
    folder = Path("keys")
    assert names_in(folder) == ["uav-1", "uav-2", "uav-3", "uav-7", "lead", "node-a"]
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert {stat.S_IMODE(path.stat().st_mode) for path in folder.iterdir()} == {0o600}
    for name in names_in(folder):
        credentials = Credentials(folder, name, "demo")
        left = credentials.end - datetime.datetime.now(datetime.UTC)
        assert left / datetime.timedelta(days=1) == pytest.approx(10.0, abs=0.01)


def test_more_can_be_made_later_and_nothing_is_overwritten(mesh):
    mesh("keys", "--swarm", "demo", "--uavs", "1-2")
    before = contents(Path("keys"))
    code, out, _ = mesh("keys", "--uavs", "1-4", "--node", "b")
    assert code == 0
    assert "uav-3 to uav-4, node-b" in out
    assert "kept those of uav-1 to uav-2" in out
    after = contents(Path("keys"))
    assert before == {name: after[name] for name in before}
    assert Credentials(Path("keys"), "uav-4", "demo")
    code, _, err = mesh("keys", "--uavs", "1-4")
    assert (code, contents(Path("keys"))) == (2, after)
    assert "uav-1 to uav-4 have certificates already; --renew" in err


def test_renewed_keys_are_new_and_those_alone_that_are_named(mesh):
    mesh("keys", "--swarm", "demo", "--uavs", "1-2", "--days", "1")
    before = contents(Path("keys"))
    assert mesh("keys", "--renew", "--uavs", "2")[0] == 0
    after = contents(Path("keys"))
    assert {name for name in before if before[name] != after[name]} == {"uav-2.crt", "uav-2.key"}
    assert mesh("keys", "--renew")[0] == 0
    last = contents(Path("keys"))
    assert {name for name in after if after[name] == last[name]} == {"authority.crt", "authority.key"}
    assert Credentials(Path("keys"), "lead").end > datetime.datetime.now(datetime.UTC) + datetime.timedelta(days=300)


def test_a_bundle_is_what_one_computer_needs_and_cannot_make_more(mesh):
    mesh("keys", "--swarm", "demo", "--uavs", "1-4", "--node", "a", "--node", "b")
    assert mesh("keys", "--bundle", "of-a", "--uavs", "1-2", "--node", "a")[0] == 0
    bundle = Path("of-a")
    assert set(contents(bundle)) == {
        "authority.crt", "uav-1.crt", "uav-1.key", "uav-2.crt", "uav-2.key", "node-a.crt", "node-a.key",
    }  # fmt: skip
    assert Credentials(bundle, "uav-2", "demo").end == load_certificate(Path("keys"), "uav-2").not_valid_after_utc
    with pytest.raises(MeshKeysError, match=r"uav-3\.crt: is missing"):
        Credentials(bundle, "uav-3")
    code, _, err = mesh("of-a", "--uavs", "3")
    assert code == 2
    assert "holds the authority's key" in err


def test_a_folder_is_listed(mesh):
    mesh("keys", "--swarm", "demo", "--uavs", "1-2")
    code, out, _ = mesh("keys")
    assert code == 0
    assert all(word in out for word in ("swarm demo", "uav-1", "uav-2", "lead", "can make more"))


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (["new"], "new: holds no keys; --swarm NAME"),
        (["new", "--uavs", "1"], "new: holds no keys; --swarm NAME"),
        (["new", "--swarm", "a b", "--uavs", "1"], "'a b' will not do as a swarm"),
        (["new", "--swarm", "a", "--node", "../x"], "'../x' will not do as a node"),
        (["new", "--swarm", "a", "--uavs", "4-1"], "'4-1': must be ids of UAVs such as 1-6, 8"),
        (["new", "--swarm", "a", "--uavs", "0"], "'0': UAVs are from 1 to 65535"),
        (["new", "--swarm", "a", "--uavs", "one"], "'one': must be ids of UAVs such as 1-6, 8"),
        (["new", "--swarm", "a", "--days", "0"], "--days 0: must be positive"),
        (["keys", "--swarm", "other", "--uavs", "3"], "keys is of swarm 'demo'"),
        (["keys", "--days", "3"], "--days: is for making certificates"),
        (["keys", "--bundle", "new"], "say for whom"),
        (["keys", "--bundle", "new", "--uavs", "9"], "uav-9.crt: is missing; certificates there: uav-1, uav-2"),
        (["keys", "--bundle", "new", "--uavs", "1", "--renew"], "--renew: is for making certificates"),
        (["keys", "--bundle", "keys", "--uavs", "1"], "keys: is not empty; keys are never overwritten"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line_and_nothing_is_written(mesh, arguments, error):
    mesh("keys", "--swarm", "demo", "--uavs", "1-2")
    before = contents(Path("keys"))
    code, out, err = mesh(*arguments)
    assert (code, out) == (2, "")
    assert error in " ".join(err.split())
    assert contents(Path("keys")) == before
    assert not Path("new").exists()


def test_a_folder_of_other_things_is_left_alone(mesh):
    Path("home").mkdir()
    Path("home/thesis.tex").write_text("x")
    code, _, err = mesh("home", "--swarm", "demo", "--uavs", "1")
    assert code == 2
    assert "home: is not empty" in err
    assert set(contents(Path("home"))) == {"thesis.tex"}
