"""The file of gateways by name."""

from __future__ import annotations

from pathlib import Path

import pytest

from metaros.access import contexts
from metaros.errors import ConfigError


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A home of one's own, and no context chosen by the environment."""
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    monkeypatch.delenv("METAROS_CONTEXT", raising=False)
    return tmp_path


def _add_and_forget(added: str, forgotten: str) -> None:
    with contexts.change() as found:
        found.add(added, "http://fleet.example")
        found.remove(forgotten)


def test_what_is_changed_is_read_again_and_a_failed_change_is_none() -> None:
    with contexts.change() as found:
        found.add("lab", "http://lab.example")
        found.current = "lab"
    assert contexts.current_gateway() == "http://lab.example"
    with pytest.raises(ConfigError, match="no context"):
        _add_and_forget("fleet", "nobody")
    assert set(contexts.read().gateways) == {"lab"}


def test_the_environment_names_another_one(monkeypatch: pytest.MonkeyPatch) -> None:
    with contexts.change() as found:
        found.add("lab", "http://lab.example")
        found.add("fleet", "http://fleet.example")
        found.current = "lab"
    monkeypatch.setenv("METAROS_CONTEXT", "fleet")
    assert contexts.current_gateway() == "http://fleet.example"
    monkeypatch.setenv("METAROS_CONTEXT", "nobody")
    with pytest.raises(ConfigError, match="known: fleet, lab"):
        contexts.current_gateway()


def test_a_damaged_file_is_reported() -> None:
    path = contexts.contexts_file()
    path.parent.mkdir(parents=True)
    path.write_text('{"current": 1}')
    with pytest.raises(ConfigError, match="damaged"):
        contexts.read()
