"""Which Zenoh session an agent opens: protected for an enrolled robot whose router is, and never quietly open again."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from edge_agent.config.settings import Settings
from edge_agent.ros.zenoh_profile import session_environ
from metaros.errors import ConfigError
from metaros.wire.profile import make_profile

URI = "ZENOH_SESSION_CONFIG_URI"


def chosen(folder: Path, profile: str, *, enrolled: bool) -> str:
    """The session file's name; "" for an open session."""
    settings = Settings(name="arm", zenoh_profile=profile, zenoh_credentials=folder)  # type: ignore[arg-type]
    environ = session_environ(settings, enrolled=enrolled)
    return "" if environ is os.environ else Path(environ[URI]).name


def test_an_enrolled_robot_takes_the_protected_session_that_there_is(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "zenoh"
    assert chosen(folder, "auto", enrolled=False) == ""
    assert caplog.text == ""
    assert chosen(folder, "auto", enrolled=True) == ""
    assert "metaros router --zenoh-profile protected" in caplog.text
    make_profile(folder, "tcp/127.0.0.1:1")
    assert chosen(folder, "auto", enrolled=True) == "agent.json5"
    assert chosen(folder, "auto", enrolled=False) == ""
    assert chosen(folder, "open", enrolled=True) == ""
    assert chosen(folder, "protected", enrolled=False) == "agent.json5"


def test_what_was_asked_for_and_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="metaros router --zenoh-profile protected"):
        chosen(tmp_path, "protected", enrolled=True)
