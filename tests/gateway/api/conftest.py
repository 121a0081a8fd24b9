"""What all tests of the gateway's endpoints have in common."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gateway.api import open_connections
from gateway.api.grpc import stream_authorization
from gateway.api.middleware import bodies, rate
from metaros.limits import LIMITS


@pytest.fixture(autouse=True)
def _refused_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Who asks too often is made to wait for half a second and more: tests of floods see that."""
    for module in (rate, bodies):
        monkeypatch.setattr(module, "PAUSE_S", 0.0)


@pytest.fixture
def attentive(monkeypatch: pytest.MonkeyPatch) -> None:
    """For the gateways that the test starts: whether who is connected may still be there is asked all the time."""
    monkeypatch.setattr(open_connections, "LIMITS", replace(LIMITS, credential_check_s=0.02))
    monkeypatch.setattr(stream_authorization, "RECHECK_S", 0.02)
    monkeypatch.setattr(stream_authorization, "POLL_S", 0.02)
