"""Zenoh routers in a test's process: each an island of its own, which costs a few milliseconds."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import zenoh

from tests.support.ports import free_port

__all__ = ["zenoh_router"]


@contextmanager
def zenoh_router() -> Iterator[str]:
    """A router on a free loopback port; the endpoint to connect to."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    config = zenoh.Config()
    config.insert_json5("mode", '"router"')
    config.insert_json5("listen/endpoints", f'["{endpoint}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("scouting/delay", "0")  # nobody to wait for: half a second saved in every test
    config.insert_json5("timestamping/enabled", "true")
    session = zenoh.open(config)
    try:
        yield endpoint
    finally:
        session.close()  # type: ignore[no-untyped-call]
