"""What tests of Foxglove's sockets have in common."""

from __future__ import annotations

import pytest

from gateway.api.foxglove import session


@pytest.fixture(autouse=True)
def _looks_often(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a session looks at from time to time it looks at without letting a test wait for it."""
    monkeypatch.setattr(session, "REFRESH_S", 0.02)
    monkeypatch.setattr(session, "POLL_S", 0.05)
