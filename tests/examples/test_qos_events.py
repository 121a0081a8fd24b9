"""examples/qos_events.py: everybody is told what they should be."""

from __future__ import annotations

from pathlib import Path

from tests.examples.test_examples import running
from tests.support.waiting import wait_until


def test_the_watchdog_notices(zenoh_router: str, tmp_path: Path) -> None:
    log = tmp_path / "log"
    words = (
        "/body missed 2 beats",
        "/body is here: 1 match",
        "/body does not fit: deadline",
        "[body]: qos_mismatch: /heartbeat: publisher /body and subscription /watchdog: deadline",
        "I know that I am late: 1",
    )
    with running(["examples/qos_events.py"], zenoh_router.rsplit(":", 1)[1], log):
        wait_until(lambda: all(word in log.read_text() for word in words), timeout_s=60)
