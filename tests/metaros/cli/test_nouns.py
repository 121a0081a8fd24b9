"""The table of nouns, and plug-ins that fail."""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from metaros.cli.nouns import NOUNS, plug_ins
from tests.support.processes.command_line import call_metaros
from tests.support.processes.processes import END_S, started

PLUGIN = """
[metaros.cli]
good = good_plugin:register
lame = lame_plugin:register
rude = rude_plugin:register
"""


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A directory with a distribution that brings three nouns: one works, one lacks a module, one raises."""
    info = tmp_path / "plugins-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: plugins\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(PLUGIN)
    (tmp_path / "good_plugin.py").write_text(
        "import typer\ndef register(app):\n    @app.command('good')\n    def good(): typer.echo('fine')\n"
    )
    (tmp_path / "lame_plugin.py").write_text("import no_such_module\n")
    (tmp_path / "rude_plugin.py").write_text("raise RuntimeError('I will not')\n")
    return tmp_path


@pytest.fixture
def plugged_in(site: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The plug-ins are in reach of this process."""
    monkeypatch.syspath_prepend(site)
    plug_ins.cache_clear()
    yield
    plug_ins.cache_clear()
    for name in ("good_plugin", "lame_plugin", "rude_plugin"):
        sys.modules.pop(name, None)


def test_a_plug_in_is_a_noun_like_any_other(site: Path) -> None:
    code = "import sys; sys.path.insert(0, sys.argv.pop(1)); from metaros.cli.main import main; main()"
    with started([sys.executable, "-c", code, str(site), "good"]) as process:
        assert process.communicate(timeout=END_S) == ("fine\n", "")


@pytest.mark.usefixtures("plugged_in")
def test_plug_ins_are_in_the_help() -> None:
    page = call_metaros("--help").out
    assert "Plug-ins" in page
    assert all(noun in page for noun in ("good", "lame", "rude"))


@pytest.mark.usefixtures("plugged_in")
def test_a_plug_in_that_fails_says_so_in_one_line_and_takes_nothing_else_down() -> None:
    reasons = {"lame": "it needs the Python module no_such_module", "rude": "RuntimeError: I will not"}
    for noun, reason in reasons.items():
        done = call_metaros(noun, "--any", "thing")
        assert (done.code, done.err) == (2, f"error: metaros {noun} is not available: {reason}\n")
    assert call_metaros("good").out == "fine\n"
    assert call_metaros("interface", "list", "std_srvs/srv/Trigger").out == "std_srvs/srv/Trigger\n"


def test_our_own_nouns_are_no_plug_ins() -> None:
    project = tomllib.loads((Path(__file__).resolve().parents[3] / "pyproject.toml").read_text())["project"]
    ours = {noun.name for noun in NOUNS}
    assert [name for name in project["entry-points"]["metaros.cli"] if name not in ours] == []
    assert [noun.name for noun in NOUNS if not noun.summary] == []
    page = call_metaros("--help").out
    assert "command      send, list, show, cancel" in page.split("Robots and data")[1].split("Plug-ins")[0]


def test_a_missing_extra_is_named() -> None:
    from metaros.cli.nouns import Noun, _reason

    noun = Noun("gateway", "", "", "", "gateway")
    assert _reason(noun, ModuleNotFoundError("No module", name="fastapi")) == (
        "it needs the Python module fastapi; install it with: pip install 'metaros[gateway]'"
    )


def test_require_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    from metaros.cli.shared import extras
    from metaros.errors import ConfigError

    monkeypatch.setitem(extras.EXTRAS, "agent", ("no_such_module", "json"))
    with pytest.raises(ConfigError, match="no_such_module"):
        extras.require("agent", "drivers")
    assert extras.missing_modules("agent") == ["no_such_module"]
