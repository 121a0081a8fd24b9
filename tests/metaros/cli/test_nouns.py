"""The table of nouns, and plug-ins that fail."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

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


def metaros(site: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run `metaros` with the plug-ins in reach."""
    code = "import sys; sys.path.insert(0, sys.argv.pop(1)); from metaros.cli.main import main; main()"
    return subprocess.run([sys.executable, "-c", code, str(site), *arguments], capture_output=True, text=True)


def test_a_plug_in_is_a_noun_like_any_other(site: Path) -> None:
    assert metaros(site, "good").stdout == "fine\n"
    page = metaros(site, "--help").stdout
    assert "Plug-ins" in page
    assert "good" in page


@pytest.mark.parametrize(
    ("noun", "reason"),
    [("lame", "it needs the Python module no_such_module"), ("rude", "RuntimeError: I will not")],
)
def test_a_plug_in_that_fails_says_so_in_one_line(site: Path, noun: str, reason: str) -> None:
    done = metaros(site, noun, "--any", "thing")
    assert done.returncode == 2
    assert done.stderr == f"error: metaros {noun} is not available: {reason}\n"


def test_a_failing_plug_in_takes_nothing_else_down(site: Path) -> None:
    assert metaros(site, "interface", "list", "std_srvs/srv/Trigger").stdout == "std_srvs/srv/Trigger\n"


def test_a_missing_extra_is_named() -> None:
    from metaros.cli.nouns import Noun, _reason

    noun = Noun("gateway", "", "", "", "gateway")
    assert _reason(noun, ModuleNotFoundError("No module", name="fastapi")) == (
        "it needs the Python module fastapi; install it with: pip install 'metaros[gateway]'"
    )


def test_require_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    from metaros.cli import extras
    from metaros.errors import ConfigError

    monkeypatch.setitem(extras.EXTRAS, "agent", ("no_such_module", "json"))
    with pytest.raises(ConfigError, match="no_such_module"):
        extras.require("agent", "drivers")
    assert extras.missing_modules("agent") == ["no_such_module"]
