"""`--robot`: types that only a node of a remote robot knows, by name alone, over a real agent and gateway."""

from __future__ import annotations

import asyncio
import json
from collections import OrderedDict
from pathlib import Path
from typing import Any

import pytest

import metaros
from edge_agent.config.settings import Settings
from edge_agent.main import run_agent
from gateway.fleet.ros.shapes import shape_of
from metaros.cli.remote.interfaces import catalogue_of_shape
from metaros.errors import MetarosError
from metaros.idl import default_catalogue, known, type_hash
from tests.gateway.harness import OPERATOR_KEY, client, running_gateway
from tests.support.nodes.typed_peer import catalogue_with
from tests.support.processes.command_line import Done, ask_metaros
from tests.support.robots.custom_types_robot import custom_types_robot
from tests.support.waiting import wait_until_async


async def test_an_unknown_type_at_a_gateways_other_end(
    zenoh_router: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    heard: list[str] = []
    with (
        custom_types_robot(zenoh_router, tmp_path / "log", namespace="/afar"),
        metaros.Context(connect=zenoh_router) as context,
        metaros.Node("ear", context=context) as node,
    ):
        node.create_subscription(str, "/afar/squeezed", heard.append, dedicated=True)
        async with running_gateway(tmp_path) as ready, client(ready) as http:
            agent = Settings(
                name="afar",
                namespace="/afar",
                gateway=f"grpc://127.0.0.1:{ready.grpc_port}",
                zenoh_port=int(zenoh_router.rpartition(":")[2]),
                host_metrics=False,
                state_dir=tmp_path / "agent",
            )
            task = asyncio.create_task(run_agent(agent))
            try:
                await known_types(http, "msg/Hand", "srv/Wave", "action/Reach", "msg/Squeeze")

                async def far(*words: str) -> Done:
                    monkeypatch.setattr(known, "_known", OrderedDict())  # what the agent knows in this process
                    environ = {"METAROS_KEY": OPERATOR_KEY, "METAROS_GATEWAY_URL": ready.url}
                    done = await ask_metaros(*words, "--robot", "afar", **environ)
                    assert done.err == "", words
                    return done

                assert "grip: soft" in (await far("topic", "echo", "hand", "--once", "--timeout", "60")).out
                assert (await far("service", "call", "wave", "{times: 3}")).out == "done: true\nangle: 1.5\n"
                goal = (await far("action", "send_goal", "reach", "{path: [{name: a}]}", "-f")).out
                assert "error: 0.5" in goal
                assert "name: a" in goal
                squeeze = ("topic", "pub", "squeeze", "far_robot/Squeeze", "{joint: {name: x}}", "--once")
                assert "force=5" in (await far(*squeeze)).out
                await wait_until_async(lambda: heard == ["x 5"])
                shown = (await far("interface", "show", "far_robot/Reach")).out.splitlines()
                assert shown[1] == "# told by robot afar"
                assert "# told by" not in (await far("interface", "show", "std_msgs/String")).out
                # as a program or the dashboard's form would
                body = {"type": "", "request": {"times": 2}}
                answer = await http.post("/api/v1/robots/afar/services/call", json={"service": "/afar/wave", **body})
                assert answer.json()["response"] == {"done": True, "angle": 1.0}
                message = {"topic": "/afar/squeeze", "message": {"joint": {"name": "y"}}}
                assert (await http.post("/api/v1/robots/afar/publish", json=message)).status_code < 300
                await wait_until_async(lambda: heard == ["x 5", "y 5"])
            finally:
                task.cancel()
                await asyncio.gather(task, return_exceptions=True)


async def known_types(http: Any, *names: str) -> None:
    """Once the gateway tells what they are made of."""
    async with asyncio.timeout(60):
        for name in names:
            await until_told(http, name)


async def until_told(http: Any, name: str) -> None:
    """By asking again: nothing tells when a gateway learns a type."""
    while True:
        if (await http.get(f"/api/v1/robots/afar/types/far_robot/{name}")).status_code == 200:
            return
        await asyncio.sleep(0.02)


def test_what_a_gateway_tells_has_to_have_its_hash() -> None:
    catalogue = catalogue_with(
        {
            "a_msgs/msg/In": 'float64[<=2] x [1.5]\nstring<=3 y "q"\nuint8 ONE=1\n',
            "a_msgs/action/Do": "In[3] a\nstd_msgs/Header h\n---\n---\nbool b\n",
        }
    )
    for name in ("a_msgs/msg/In", "a_msgs/action/Do"):
        shape = json.loads(json.dumps(shape_of(name, catalogue)))
        made = catalogue_of_shape(shape)
        assert made.get(name) == catalogue.get(name)
        assert made.get("a_msgs/msg/In") == catalogue.get("a_msgs/msg/In")
        assert type_hash(name, made) == shape["type_hash"]
        with pytest.raises(MetarosError, match="has the hash"):
            catalogue_of_shape({**shape, "type_hash": "RIHS01_" + "0" * 64})
    inner = shape["definitions"]["a_msgs/msg/In"]["fields"][0]
    inner["name"] = "x; import os"
    with pytest.raises(MetarosError):
        catalogue_of_shape(shape)
    shipped = shape_of("std_srvs/srv/Trigger", default_catalogue())
    assert catalogue_of_shape(shipped).home("std_srvs/srv/Trigger") is default_catalogue()
