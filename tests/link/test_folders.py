"""Folders of the user: where the environment says, and elsewhere, with a word, where that cannot be written."""

from __future__ import annotations

import os
import tempfile
import warnings
from pathlib import Path

import pytest

from ftcc.link import folders
from ftcc.link.folders import NoFolderError, cache_folder, config_folder, matplotlib_folder, runtime_folder
from ftcc.link.signing import KeyFileError, default_key_file, new_key_file

VARIABLES = ("FTCC_CACHE_DIR", "FTCC_RUNTIME_DIR", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_RUNTIME_DIR")


@pytest.fixture(autouse=True)
def temporary(tmp_path, monkeypatch):
    """The system's temporary directory, a home, and no variable."""
    for name in (*VARIABLES, "MPLCONFIGDIR"):
        monkeypatch.setenv(name, "")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(folders, "_warned", set())
    warnings.simplefilter("error")
    return tmp_path


@pytest.fixture
def unwritable(tmp_path):
    """No folder can be made below a file; also root's cannot."""
    (tmp_path / "file").write_text("")
    return tmp_path / "file" / "home"


def own(temporary: Path) -> Path:
    return temporary / f"ftcc-{os.geteuid()}"


def test_the_environment_names_the_folders(tmp_path, monkeypatch):
    home = tmp_path / "home"
    assert cache_folder("x") == home / ".cache/ftcc/x"
    assert config_folder() == home / ".config/ftcc"
    assert runtime_folder() == own(tmp_path)
    for name in VARIABLES[2:]:
        monkeypatch.setenv(name, str(tmp_path / name))
    assert cache_folder("x") == tmp_path / "XDG_CACHE_HOME/ftcc/x"
    assert default_key_file() == tmp_path / "XDG_CONFIG_HOME/ftcc/mavlink.key"
    assert runtime_folder() == tmp_path / "XDG_RUNTIME_DIR/ftcc"
    for name in VARIABLES[:2]:
        monkeypatch.setenv(name, str(tmp_path / name))
    assert cache_folder("x") == tmp_path / "FTCC_CACHE_DIR/x"
    assert runtime_folder() == tmp_path / "FTCC_RUNTIME_DIR/ftcc"
    monkeypatch.setenv("FTCC_CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert cache_folder("x") == home / ".cache/ftcc/x"


@pytest.mark.parametrize("home", ["unwritable", "", None])
def test_without_a_home_that_can_be_written_a_private_folder_stands_in(tmp_path, unwritable, monkeypatch, home):
    if home is None:
        monkeypatch.delenv("HOME")
        monkeypatch.setattr(Path, "home", lambda: (_ for _ in ()).throw(RuntimeError("no home")))
    else:
        monkeypatch.setenv("HOME", home and str(unwritable))
    with pytest.warns(RuntimeWarning, match=r"is used instead \(set FTCC_CACHE_DIR") as told:
        found = cache_folder("x")
    assert len(told) == 1
    assert found == own(tmp_path) / "cache" / "x"
    assert own(tmp_path).stat().st_mode & 0o777 == 0o700
    assert os.environ["FTCC_CACHE_DIR"] == str(found.parent), "children are told"
    assert cache_folder("x") == found, "and nobody warns again"
    matplotlib_folder()
    assert os.environ["MPLCONFIGDIR"] == str(own(tmp_path) / "cache" / "matplotlib")


def test_a_runtime_folder_that_cannot_be_written_is_replaced_by_the_one_without_a_variable(
    tmp_path, unwritable, monkeypatch
):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(unwritable))
    with pytest.warns(RuntimeWarning, match="set FTCC_RUNTIME_DIR"):
        assert runtime_folder() == own(tmp_path)
    assert runtime_folder() == own(tmp_path)


def test_what_an_installation_holds_that_can_only_be_read_is_the_beginning(tmp_path, monkeypatch):
    held = tmp_path / "installed" / "x"
    held.mkdir(parents=True)
    (held / "code").write_text("compiled")
    monkeypatch.setenv("FTCC_CACHE_DIR", str(held.parent))
    access = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != held and access(path, mode))
    with pytest.warns(RuntimeWarning, match="Permission denied"):
        assert (cache_folder("x") / "code").read_text() == "compiled"


@pytest.mark.parametrize("kind", ["strangers", "link", "file"])
def test_a_folder_that_somebody_else_has_put_there_is_refused(tmp_path, monkeypatch, kind):
    if kind == "strangers":
        stranger = os.geteuid() + 1
        monkeypatch.setattr(os, "geteuid", lambda: stranger)
        own(tmp_path).mkdir()
    elif kind == "link":
        (tmp_path / "elsewhere").mkdir()
        own(tmp_path).symlink_to(tmp_path / "elsewhere")
    else:
        own(tmp_path).write_text("")
    with pytest.raises(NoFolderError, match=r"ftcc-\d+: cannot be written .*; set FTCC_RUNTIME_DIR"):
        runtime_folder()


def test_a_private_folder_that_others_may_enter_is_closed(tmp_path):
    own(tmp_path).mkdir(mode=0o755)
    assert runtime_folder().stat().st_mode & 0o777 == 0o700


def test_a_key_has_no_temporary_place(tmp_path, unwritable, monkeypatch):
    monkeypatch.setenv("HOME", "")
    with pytest.raises(NoFolderError, match="give a FILE, or set XDG_CONFIG_HOME"):
        default_key_file()
    with pytest.raises(KeyFileError, match="give another FILE"):
        new_key_file(unwritable / "key")


def test_half_a_key_is_not_left_behind(tmp_path, monkeypatch):
    class Full:
        def __enter__(self):
            return self

        def __exit__(self, *_):
            return None

        def write(self, _):
            raise OSError(28, "No space left on device")

    def full(descriptor, _mode):
        os.close(descriptor)
        return Full()

    monkeypatch.setattr(os, "fdopen", full)
    with pytest.raises(KeyFileError, match="No space left"):
        new_key_file(tmp_path / "key")
    assert not (tmp_path / "key").exists()
