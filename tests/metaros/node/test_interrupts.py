"""Ctrl-C while Zenoh calls back on the main thread: raised once Zenoh has returned, and what came has arrived."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
import zenoh

import metaros
from metaros.executor import SingleThreadedExecutor
from metaros.interfaces.std_msgs.msg import String
from metaros.interfaces.std_srvs.srv import Trigger
from metaros.wire import Durability, QoSProfile
from tests.support.nodes.interrupts import interrupt_inside
from tests.support.waiting import wait_until

KEPT = QoSProfile(depth=10, durability=Durability.TRANSIENT_LOCAL)


@pytest.fixture
def context(zenoh_router: str) -> Iterator[metaros.Context]:
    with metaros.Context(domain_id=0, connect=zenoh_router) as context:
        yield context


def spin_until(node: metaros.Node, condition: Callable[[], bool]) -> None:
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    wait_until(lambda: condition() or (executor.spin_once(0.1) and condition()), timeout_s=60)
    executor.shutdown()


def test_a_token_declared_here(context: metaros.Context, capfd: pytest.CaptureFixture[str]) -> None:
    """Zenoh reports it to the graph on this thread; that is how `metaros driver run` once ran on after SIGTERM."""
    declare = context.session.check_open().liveliness().declare_token
    kept: list[object] = []
    for number in range(5):
        with pytest.raises(KeyboardInterrupt):
            interrupt_inside(lambda n=number: kept.extend(map(declare, (f"@ros2_lv/0/abc/{n}/{n}/NN/%/%/n{n}",))))  # type: ignore[misc]
    assert "callback error" not in capfd.readouterr().err
    wait_until(lambda: len(context.graph.nodes()) == 5, timeout_s=60)


def test_a_sample_for_a_subscription_of_this_program(
    context: metaros.Context, capfd: pytest.CaptureFixture[str]
) -> None:
    received: list[str] = []
    with metaros.Node("n", context=context, enable_rosout=False) as node:
        node.create_subscription(String, "map", lambda message: received.append(message.data), KEPT)
        publisher = node.create_publisher(String, "map", KEPT)
        publisher.publish(String(data="first"))
        spin_until(
            node, lambda: received == ["first"]
        )  # before, Zenoh's history may swallow samples: docs/topics/qos.md
        for number in range(5):
            with pytest.raises(KeyboardInterrupt):
                interrupt_inside(lambda n=number: publisher.publish(String(data=str(n))))  # type: ignore[misc]
        spin_until(node, lambda: len(received) == 6)
    assert "callback error" not in capfd.readouterr().err
    assert received == ["first", *"01234"]


def test_a_request_for_a_service_of_this_program(context: metaros.Context, capfd: pytest.CaptureFixture[str]) -> None:
    with metaros.Node("n", context=context, enable_rosout=False) as node:
        service = node.create_service(Trigger, "do", lambda _, response: response)
        answers = zenoh.handlers.FifoChannel(10)
        with pytest.raises(KeyboardInterrupt):
            interrupt_inside(lambda: context.session.check_open().get(service.key, answers))
        spin_until(node, lambda: service.malformed == 1)
    assert "callback error" not in capfd.readouterr().err
