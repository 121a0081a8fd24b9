"""Attacks on viewers' endpoints: foreign pages, robots that send too much, clients that ask for too much."""

from __future__ import annotations

import asyncio
import json
import threading
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from gateway.api import open_connections
from gateway.api.foxglove import session
from gateway.domain.principal import Role
from metaros._proto import link_pb2
from metaros.limits import LIMITS
from tests.gateway.api.foxglove.viewer import viewing
from tests.gateway.harness import CONTROL, ScriptedAgent, channel, client, open_socket, running_gateway, say
from tests.support.gateways.memory_authenticator import KeyRing, bearer

pytestmark = pytest.mark.integration

ENDPOINTS = ("/foxglove", "/foxglove/sim_1", "/rosbridge", "/rosbridge/sim_1", "/api/v1/stream")
SPOKEN: Any = ["foxglove.sdk.v1", "metaros.v1"]


LIKE_TOKEN = ("tokens=x", "x=token", "%74oken=x", "drive=token&robot=sim_1")


async def test_a_word_like_token_opens_nothing_to_a_foreign_page(tmp_path: Path) -> None:
    """The wall lets a page of anybody in that was given a token: not one that only writes the word."""
    ring = KeyRing()
    cookie, _ = ring.sign_in(role=Role.OPERATOR, name="eve's victim")
    async with running_gateway(tmp_path, authenticator=ring) as ready, ScriptedAgent(ready):
        for endpoint, query, headers in product(ENDPOINTS, LIKE_TOKEN, ({}, {"Cookie": f"metaros_session={cookie}"})):
            url = f"{ready.url.replace('http', 'ws', 1)}{endpoint}?{query}"
            origin: Any = "http://evil.example"
            with pytest.raises(InvalidStatus) as caught:
                await connect(url, origin=origin, additional_headers=headers, subprotocols=SPOKEN, proxy=None)
            assert caught.value.response.status_code == 403, (endpoint, query, headers)
            assert json.loads(caught.value.response.body)["code"] == "origin_not_allowed"


SECRET = "chassis_of_the_other_one"
UNKNOWN = "no robot 'sim_2' has ever connected"  # what is said of any name that is no robot's
LISTS = (
    "/api/v1/robots",
    "/api/v1/robots?q=sim&fields=robot",
    "/api/v1/robots?selector=robot",
    "/api/v1/graph",
    "/api/v1/groups",
    "/api/v1/events?limit=1000",
    "/api/v1/traces",
    "/api/v1/traces?robot=sim_2",
    "/api/v1/events?robot=sim_2",
    "/api/v1/gateway",
    "/metrics",
    "/api/v1/debug",
)
ROSAPI = (
    "topics",
    "topics_and_raw_types",
    "services",
    "nodes",
    "action_servers",
    "get_param_names",
    "services_for_type",
    "topics_for_type",
    "publishers",
    "node_details",
    "service_providers",
)


def graph(robot: str, base: str) -> link_pb2.GraphReport:
    """A node that publishes, and serves something."""
    kinds = (link_pb2.ENDPOINT_KIND_PUBLISHER, link_pb2.ENDPOINT_KIND_SERVER)
    types = ("std_msgs/msg/String", "std_srvs/srv/Trigger")
    ends = [
        link_pb2.GraphEndpoint(number=n, kind=kind, name=f"/{robot}/{base}", node=f"/{robot}/{base}", type_name=name)
        for n, (kind, name) in enumerate(zip(kinds, types, strict=True), 1)
    ]
    return link_pb2.GraphReport(anew=True, revision=1, nodes=[f"/{robot}/{base}"], endpoints=ends)


async def test_what_is_out_of_scope_is_in_no_answer_of_any_endpoint(tmp_path: Path) -> None:
    """An operator of sim_1 looks everywhere: sim_2, which is there, is not, and neither are its names."""
    ring = KeyRing()
    key = ring.add(role=Role.OPERATOR, robots=("sim_1",))
    async with (
        running_gateway(tmp_path, authenticator=ring) as ready,
        ScriptedAgent(ready) as mine,
        ScriptedAgent(ready, "sim_2", session=b"t" * 16) as other,
        client(ready, key=key) as http,
    ):
        for agent, base in ((other, SECRET), (mine, "base")):
            await agent.announce(channel(1, f"/{agent.robot}/{base}", "std_msgs/msg/String"))
            await agent.send(CONTROL, graph=graph(agent.robot, base))
        everybody = bearer(ring.add(role=Role.OPERATOR))
        async with asyncio.timeout(60):
            while True:  # until both have told
                reported = (await http.get("/api/v1/graph", headers=everybody)).text
                if SECRET in reported and "/sim_1/base" in reported:
                    break
                await asyncio.sleep(0.01)
        received = [(await http.get(path)).text for path in LISTS]
        for path in ("/foxglove/", "/rosbridge/", "/foxglove?robot=", "/rosbridge?robot="):
            refusals = []
            for robot in ("sim_2", "sim_9"):
                with pytest.raises(InvalidStatus) as caught:
                    await open_socket(ready, path + robot, key=key, subprotocols=SPOKEN)
                refused = caught.value.response
                refusals.append((refused.status_code, bytes(refused.body or b"").replace(robot.encode(), b"")))
            assert refusals[0] == refusals[1], path
        async with open_socket(ready, "/rosbridge", key=key) as socket:
            for number, name in enumerate(ROSAPI):
                asked = f"/sim_2/{SECRET}"
                args = {"type": "std_msgs/msg/String", "topic": asked, "node": asked, "service": asked}
                await say(socket, op="call_service", id=str(number), service=f"/rosapi/{name}", args=args)
            await say(socket, op="subscribe", topic="/sim_2/x", id="last")
            while True:
                said = json.loads(await socket.recv())
                if said["op"] == "status":
                    break
                received.append(json.dumps(said).replace(asked, "").replace(UNKNOWN, ""))
        async with viewing(ready, "/foxglove", key=key) as viewer:
            await viewer.say("subscribeConnectionGraph")
            received += [json.dumps(await viewer.hear("connectionGraphUpdate"))]
            await viewer.say("getParameters", parameterNames=[], id="p")
            received += [json.dumps(await viewer.hear("parameterValues")), str(viewer.channels), str(viewer.services)]
    assert any("/sim_1/base" in text for text in received)
    for text in received:
        assert SECRET not in text, text
        assert "sim_2" not in text, text


async def test_files_that_a_viewer_asks_for_are_in_memory_one_at_a_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each has up to 32 MiB, and a client may have dozens of requests under way."""
    both, together = threading.Barrier(2), list[str]()

    def read(_folder: Path | None, uri: str) -> bytes:
        if uri.endswith(("0.stl", "1.stl")):
            try:
                both.wait(0.2)
                together.append(uri)
            except threading.BrokenBarrierError:
                pass
        return b"solid"

    monkeypatch.setattr(session, "read_asset", read)
    async with running_gateway(tmp_path) as ready, viewing(ready, "/foxglove", key="") as viewer:
        for number in range(8):
            await viewer.say("fetchAsset", uri=f"asset:///{number}.stl", requestId=number)
        answers = [await viewer.binary(4) for _ in range(8)]
    assert sorted(answer[0] for answer in answers) == list(range(8))
    assert not together


async def test_whose_key_is_revoked_serves_and_publishes_nothing_any_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(open_connections, "LIMITS", replace(LIMITS, credential_check_s=0.02))
    ring = KeyRing()
    key = ring.add(role=Role.OPERATOR, robots=("sim_1",))
    async with (
        running_gateway(tmp_path, authenticator=ring) as ready,
        ScriptedAgent(ready) as agent,
        connect(f"ws://127.0.0.1:{ready.rosbridge_port}/sim_1?token={key}", proxy=None) as socket,
    ):
        await say(socket, op="advertise_service", service="/sim_1/serve", type="std_srvs/srv/Trigger", id="a")
        offers = (await agent.next("offers")).offers
        state = link_pb2.OfferState(number=offers.offers[0].number)
        await agent.send(CONTROL, offer_states=link_pb2.OfferStates(states=[state]))
        ring.revoke(key)
        await asyncio.wait_for(socket.wait_closed(), 60)
        assert socket.close_code == 4401
        assert not (await agent.next("offers")).offers.offers
