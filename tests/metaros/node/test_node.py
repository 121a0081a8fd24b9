"""Nodes and contexts: names, the graph, logging, decorators, ends."""

from __future__ import annotations

import io
from typing import Any

import pytest

import metaros
from metaros.clock import ManualClock
from metaros.errors import ClosedError, ConfigError, NameError_
from metaros.interfaces.rcl_interfaces.msg import Log
from metaros.interfaces.std_msgs.msg import String
from metaros.node import Logger
from metaros.wire import qos_rosout
from tests.support.processes.forked import ended, forked
from tests.support.processes.threads import left_behind, threads_now
from tests.support.waiting import wait_until


def test_names_are_resolved_and_checked(here):
    with metaros.Node("arm", namespace="/robot1", context=here) as node:
        assert node.full_name == "/robot1/arm"
        assert node.create_publisher(String, "state").topic == "/robot1/state"
        assert node.create_publisher(String, "~/state").topic == "/robot1/arm/state"
        assert node.create_publisher(String, "/state").topic == "/state"
    for name, namespace in (("a b", "/"), ("", "/"), ("a/b", "/"), ("a", "/x y"), ("1", "/")):
        with pytest.raises(NameError_):
            metaros.Node(name, namespace=namespace, context=here)


def test_the_graph_shows_both_sides_and_forgets_who_leaves(here, there):
    with metaros.Node("a", context=here), metaros.Node("b", context=there, namespace="/ns") as b:
        publisher = b.create_publisher(String, "/chatter", metaros.qos_sensor_data)
        for context in (here, there):
            wait_until(lambda c=context: c.graph.endpoints("/chatter"))
            wait_until(lambda c=context: {node.full_name for node in c.graph.nodes()} == {"/a", "/ns/b"})
            (endpoint,) = context.graph.endpoints("/chatter", "MP")
            assert endpoint.gid == publisher.gid
            assert endpoint.node_full_name == "/ns/b"
            assert endpoint.qos == metaros.qos_sensor_data
            assert endpoint.zid == there.zid
            assert context.graph.topics()["/chatter"] == {"std_msgs/msg/String"}
        changes: list[int] = []
        stop = here.graph.on_change(lambda: changes.append(1))
        b.close()
        wait_until(lambda: [node.full_name for node in here.graph.nodes()] == ["/a"])
        wait_until(lambda: not here.graph.endpoints("/chatter") and changes)
        stop()
    assert here.connected()


def test_a_late_context_knows_the_graph_when_it_opens(here, there, zenoh_router):
    with metaros.Node("b", context=there):
        wait_until(here.graph.nodes)
        with metaros.Context(domain_id=0, connect=zenoh_router) as late:
            assert [node.full_name for node in late.graph.nodes()] == ["/b"]


def test_entities_are_numbered_as_rmw_zenoh_numbers_them(island):
    with metaros.Context(domain_id=0, connect=island) as here, metaros.Node("a", context=here) as node:
        publisher = node.create_publisher(String, "chatter")
        tokens = {end.topic: end for end in here.graph.tokens()}
        assert (node.token.nid, tokens["/rosout"].eid, tokens["/parameter_events"].eid) == (0, 1, 2)
        assert publisher.token.eid == 10  # after seven standard services


def test_the_logger_writes_to_stderr_and_rosout(here, there, capsys):
    got: list[Any] = []
    with metaros.Node("arm", context=here, namespace="/robot1") as a, metaros.Node("b", context=there) as b:
        b.create_subscription(Log, "/rosout", got.append, qos_rosout)
        a.get_logger().debug("not shown")
        a.get_logger().warn("hot motor")
        executor = metaros.SingleThreadedExecutor()
        executor.add_node(b)
        wait_until(lambda: executor.spin_once(0.01) and got)
    (message,) = got
    assert (message.level, message.name, message.msg) == (30, "robot1.arm", "hot motor")
    assert message.file.endswith("test_node.py")
    assert message.function == "test_the_logger_writes_to_stderr_and_rosout"
    assert message.stamp.sec > 1_000_000_000
    assert "[robot1.arm]: hot motor" in capsys.readouterr().err


def test_a_logger_has_a_level():
    stream = io.StringIO()
    logger = Logger("n", ManualClock(), stream=stream)
    logger.set_level("error")
    logger.info("quiet")
    logger.fatal("loud")
    assert stream.getvalue() == "[FATAL] [1700000000.000000] [n]: loud\n"


def test_decorators_spin_until_the_node_closes(here):
    got: list[str] = []
    with metaros.Node("a", context=here) as node:
        publisher = node.create_publisher(String, "chatter")

        @node.timer(0.01)
        def tick() -> None:
            publisher.publish(String(data="tick"))

        @node.subscription(String, "chatter", qos=10)
        async def hear(message: Any) -> None:
            got.append(message.data)
            if len(got) == 3:
                node.close()

        metaros.spin(node)
    assert got[:3] == ["tick"] * 3


def test_closing_the_context_closes_its_nodes(zenoh_router):
    before = threads_now()
    context = metaros.Context(connect=zenoh_router)
    node = metaros.Node("a", context=context)
    context.close()
    context.close()
    assert node.closed
    with pytest.raises(ClosedError):
        metaros.Node("b", context=context)
    assert left_behind(before) == []


def test_wrong_settings_are_named(zenoh_router, monkeypatch):
    with pytest.raises(ConfigError, match="connect"):
        metaros.Context(connect="nonsense")
    monkeypatch.setenv("ZENOH_CONFIG_OVERRIDE", "no/such/key=1")
    with pytest.raises(ConfigError, match="no/such/key"):
        metaros.Context(connect=zenoh_router)
    monkeypatch.setenv("ZENOH_CONFIG_OVERRIDE", "nonsense")
    with pytest.raises(ConfigError, match="key=value"):
        metaros.Context(connect=zenoh_router)
    monkeypatch.delenv("ZENOH_CONFIG_OVERRIDE")
    monkeypatch.setenv("ROS_DOMAIN_ID", "many")
    with pytest.raises(ConfigError, match="ROS_DOMAIN_ID"):
        metaros.Context(connect=zenoh_router)
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    with metaros.Context(connect=zenoh_router) as context:
        assert context.domain_id == 7


def test_a_program_that_closes_nothing_still_ends(zenoh_router):
    programs = [
        f"node = metaros.Node('n', context=metaros.Context(connect={zenoh_router!r}))\n"
        f"node.create_subscription(String, 'chatter', lambda message: None, dedicated={dedicated})\n"
        "node.create_publisher(String, 'chatter').publish(String(data='bye'))\n"
        for dedicated in (False, True)
    ]
    imports = "import metaros, metaros.node\nfrom metaros.interfaces.std_msgs.msg import String"
    with forked(programs, imports=imports) as process:
        assert ended(process) == ({0: 0, 1: 0}, "")


def test_the_everyday_names_are_one_import_away():
    for name in metaros.__all__:
        assert getattr(metaros, name) is not None
    assert set(metaros.__all__) <= set(dir(metaros))
    with pytest.raises(AttributeError):
        metaros.nothing  # noqa: B018
