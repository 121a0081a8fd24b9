"""The parameters example, set from outside as a user would set it."""

from __future__ import annotations

from pathlib import Path

import metaros
from metaros.node.parameters import SetResult
from tests.examples.test_examples import running
from tests.support.waiting import wait_until


def test_parameters_example_obeys_and_refuses(zenoh_router: str, tmp_path: Path) -> None:
    log = tmp_path / "log"
    with running(["examples/parameters.py"], zenoh_router.rsplit(":", 1)[1], log):
        with metaros.Context(connect=zenoh_router) as context, metaros.Node("asker", context=context) as node:
            client = node.create_parameter_client("/cruise")
            assert client.wait(60)
            wait_until(lambda: "gains" in client.list())
            assert client.set({"speed": 0.8})["speed"]
            wait_until(lambda: "speed is 0.8 now" in log.read_text())
            refused = client.set_atomically({"direction": "backward"})
            assert refused == SetResult(False, "backward goes at most at 0.3")
            assert client.set_atomically({"direction": "backward", "speed": 0.2})
            assert client.dump() == {"use_sim_time": False, "speed": 0.2, "direction": "backward", "gains": [1.0, 0.1]}
