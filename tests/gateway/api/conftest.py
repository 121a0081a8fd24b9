"""What all tests of the gateway's doors have in common."""

from __future__ import annotations

import pytest

from gateway.api import rate


@pytest.fixture(autouse=True)
def _refused_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Who asks too often is made to wait for half a second and more: tests of floods see that."""
    monkeypatch.setattr(rate, "PAUSE_S", 0.0)
