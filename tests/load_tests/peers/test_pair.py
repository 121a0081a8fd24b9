"""A pair of processes: what goes wrong in one is the pair's result."""

from __future__ import annotations

import json
import sys

import pytest

from load_tests.peers import pair
from load_tests.peers.process import PeerFailed, PeerProcess


def job(**more: object) -> dict[str, object]:
    """Of a peer that may not exist."""
    return {"python": sys.executable, "module": "no_such_peer", "mode": "", "size": 64, "seconds": 0.1, **more}


@pytest.mark.parametrize("phase", ["flood", "ping"])
def test_an_error_of_a_peer_is_the_result(
    phase: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pair, "own_network", lambda: False)  # it would be this very process's
    assert pair.main([json.dumps(job(phase=phase, pings=1, ping_s=0.1))]) == 0
    error = json.loads(capsys.readouterr().out)["error"]
    assert "ModuleNotFoundError" in error
    assert "no_such_peer" in error


def test_a_process_that_ends_is_reported_with_its_last_words(tmp_path: object) -> None:
    broken = {"module": "raw_zenoh", "role": "no_such_role", "scratch": str(tmp_path)}
    with PeerProcess(sys.executable, broken) as process:
        with pytest.raises(PeerFailed, match="KeyError"):
            process.answer()
        with pytest.raises(PeerFailed, match=r"raw_zenoh no_such_role ended: KeyError: .no_such_role"):
            process.answer()


def test_a_silent_process_is_not_waited_for(tmp_path: object) -> None:
    silent = {
        "module": "raw_zenoh",
        "mode": "bare",
        "role": "subscriber",
        "subscriptions": 1,
        "size": 64,
        "ports": [0],
        "scratch": str(tmp_path),
    }
    with PeerProcess(sys.executable, silent) as process:
        assert process.answer() == "ready"
        with pytest.raises(PeerFailed, match="said nothing for"):
            process.answer(timeout_s=0.05)
        assert process.ask()["count"] == 0
