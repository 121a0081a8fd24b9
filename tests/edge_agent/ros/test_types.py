"""A type that a gateway would not read is not told: the agent says that its services are called in CDR only."""

from __future__ import annotations

import logging
from typing import cast

import pytest

from edge_agent.ros import types
from edge_agent.ros.graph_snapshot import GraphEndpoint
from edge_agent.ros.types import GraphTypeDiscovery
from metaros._proto import link_pb2
from metaros.idl import Catalogue, default_catalogue, parse_definition
from metaros.node import Node
from tests.support.waiting import wait_until_async


def catalogue(fields: int) -> Catalogue:
    text = "".join(f"int32 field_{field}\n" for field in range(fields)) + "---\n"
    made = Catalogue(base=default_catalogue())
    made.add(parse_definition(text, f"p/srv/Fields{fields}"))
    return made


async def test_a_type_is_learned_unless_it_is_too_large(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async def fetch(node: Node, name: str, type_hash: str) -> Catalogue:
        return catalogue(int(name.removeprefix("p/srv/Fields")))

    monkeypatch.setattr(types, "fetch_type_async", fetch)
    learner = GraphTypeDiscovery(cast("Node", None), lambda: None)
    with caplog.at_level(logging.WARNING):
        learner.look(
            GraphEndpoint(link_pb2.ENDPOINT_KIND_SERVER, "/r/n", "/r/s", f"p/srv/Fields{count}", "x", "")
            for count in (1000, 400)
        )
        await wait_until_async(lambda: bool(learner.texts) and bool(caplog.records))
    await learner.close()
    assert list(learner.texts) == [("p/srv/Fields400", "x")]
    assert "p/srv/Fields1000 can only be used remotely in CDR: its definition is too large" in caplog.text
