"""Single keys from a terminal, and none without one."""

from __future__ import annotations

import os
import sys

import pytest

from metaros.cli.shared.keys import keyboard
from tests.support.waiting import wait_until


def test_without_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    with open(os.devnull) as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        with keyboard() as key:
            assert key is None


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
def test_with_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    import pty
    import termios

    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "r+b", buffering=0) as raw:
        terminal = open(raw.fileno(), closefd=False)  # noqa: SIM115
        monkeypatch.setattr(sys, "stdin", terminal)
        monkeypatch.setattr(sys, "stdout", terminal)
        before = termios.tcgetattr(ours)
        pressed: list[str] = []
        with keyboard() as key:
            assert key is not None
            assert key() == ""
            os.write(ours, b" ")
            wait_until(lambda: pressed.append(key()) or pressed[-1])
        assert pressed[-1] == " "
        assert termios.tcgetattr(ours) == before
        terminal.close()
    os.close(ours)
