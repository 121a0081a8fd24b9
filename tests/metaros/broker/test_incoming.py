"""From ZeroMQ's frames to routes: what is bounded, what is left out, and how a guess settles."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import metaros
from metaros.broker.faults import Faults
from metaros.broker.incoming import Incoming
from metaros.broker.type_inference import TypeTable
from metaros.broker.types import Types
from metaros.idl.globs import Glob
from metaros.limits import LIMITS


@pytest.fixture
def node(zenoh_router: str) -> Iterator[metaros.Node]:
    """The broker's own."""
    with metaros.Context(domain_id=0, connect=zenoh_router) as context:
        with metaros.Node("zmq_broker", context=context) as made:
            yield made


def incoming(node: metaros.Node, *, only: tuple[Glob, ...] = ()) -> Incoming:
    faults = Faults(node)
    types = Types(node, changed=lambda: None, faults=faults)
    return Incoming(node, table=TypeTable(), types=types, only=only, faults=faults)


def test_what_waits_is_bounded_and_the_rest_is_counted(node: metaros.Node) -> None:
    routes = incoming(node)
    for number in range(LIMITS.broker_queue_messages + 500):
        routes.take([b"/fast %d" % number])
    routes.take([b"/slow 1"])
    assert [(row.topic, row.dropped) for row in routes.rows()] == [("/fast", 500), ("/slow", 0)]
    while routes.work(1.0):
        pass
    rows = routes.rows()
    assert [row.bridged for row in rows] == [LIMITS.broker_queue_messages, 1]
    assert [row.messages for row in rows] == [LIMITS.broker_queue_messages + 500, 1]
    routes.close()


def test_topics_are_bounded(node: metaros.Node, capsys: pytest.CaptureFixture[str]) -> None:
    routes = incoming(node)
    for number in range(LIMITS.broker_topics + 200):
        routes.take([b"/topic_%d 1" % number])
    assert (len(routes.rows()), routes.unreadable) == (LIMITS.broker_topics, 200)
    assert 0 < capsys.readouterr().err.count("more than") <= 20


def test_only_some_topics(node: metaros.Node) -> None:
    routes = incoming(node, only=(Glob("/sensors/**"),))
    routes.take([b"/sensors/imu 1"])
    routes.take([b"sensors/imu 1"])
    routes.take([b"/cmd_vel 1"])
    assert [(row.topic, row.messages) for row in routes.rows()] == [("/sensors/imu", 2)]
    assert routes.unreadable == 0


def test_a_guess_settles(node: metaros.Node) -> None:
    """A topic that says one thing and another: after some turns it keeps its type, and counts what does not fit."""
    routes = incoming(node)
    for number in range(20):
        routes.take([b"/odd", b'{"data": true}' if number % 2 else b'{"data": 1.5}'])
        routes.work(1.0)
    (row,) = routes.rows()
    assert row.malformed + row.bridged == 20
    assert row.malformed > 5
    assert len({route.type for route in routes.rows()}) == 1
    routes.close()
