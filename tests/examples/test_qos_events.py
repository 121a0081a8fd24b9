"""examples/qos_events.py: everybody is told what they should be."""

from __future__ import annotations

from pathlib import Path

from tests.examples.test_examples import finish, start
from tests.support.waiting import wait_until


def test_the_watchdog_notices(zenoh_router: str, tmp_path: Path) -> None:
    log = tmp_path / "log"
    process = start(["examples/qos_events.py"], zenoh_router.rsplit(":", 1)[1], log)
    try:
        wait_until(lambda: "/body missed 2 beats" in log.read_text(), timeout_s=20)
    finally:
        assert finish(process) in (0, 130)
    text = log.read_text()
    assert "/body is here: 1 match" in text
    assert "/body does not fit: deadline" in text
    assert "[body]: qos_mismatch: /heartbeat: publisher /body and subscription /watchdog: deadline" in text
    assert "I know that I am late: 1" in text
