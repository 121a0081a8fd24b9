"""Where each peer's Python comes from."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from load_tests.peers import venvs
from load_tests.peers.venvs import Home, HomeFailed, python_of


def test_ours_is_this_one() -> None:
    assert python_of("ours") == sys.executable


def test_every_requirement_is_pinned() -> None:
    assert [text for home in venvs.HOMES.values() for text in home.requirements if "==" not in text] == []


def test_a_module_that_the_system_lacks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(venvs.HOMES, "rospy", Home(module="no_such_module", missing="not installed (Debian: x)"))
    with pytest.raises(HomeFailed, match=r"not installed \(Debian: x\)"):
        python_of("rospy")


def test_an_environment_is_made_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    steps: list[list[str]] = []

    def run(step: list[str]) -> None:
        steps.append(step)
        python = tmp_path / "peers" / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
        python.parent.mkdir(parents=True, exist_ok=True)
        python.touch()

    monkeypatch.setattr(venvs, "_run", run)
    first = python_of("peers", folder=tmp_path)
    assert len(steps) == 2
    assert "cyclonedds==11.0.1" in steps[1]
    assert python_of("peers", folder=tmp_path) == first
    assert len(steps) == 2
    monkeypatch.setitem(venvs.HOMES, "peers", Home(requirements=("pyzmq==1",)))
    python_of("peers", folder=tmp_path)
    assert len(steps) == 4


def test_what_the_installer_said_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(venvs.shutil, "which", lambda *_, **__: sys.executable)  # an "uv" that knows no "venv"
    with pytest.raises(HomeFailed, match=r"not installed: .*venv"):
        python_of("peers", folder=tmp_path)
