"""The graph: what it answers after tokens came and went, by topic and in all; when it is whole."""

from __future__ import annotations

import threading
from contextlib import closing

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from metaros.wire import EndpointToken, Graph, NodeToken, WireSession
from metaros.wire.graph import GraphState
from tests.support.waiting import wait_until

# a busy machine is no fault of the code
unhurried = settings(deadline=None, max_examples=50, suppress_health_check=[HealthCheck.too_slow])

NODE = NodeToken(0, "abc123", 0, "n", "/")
HASH = "RIHS01_" + "0" * 64


def endpoint(number: int, topic: str, kind: str) -> EndpointToken:
    return EndpointToken(NODE, number, kind, topic, "std_msgs/msg/String", HASH, "::,10:,:,:,,")  # type: ignore[arg-type]


PLACES = (("/a", "MP"), ("/b", "MS"), ("/a", "SS"), ("/c", "MP"))
ENDPOINTS = [endpoint(number, topic, kind) for number, (topic, kind) in enumerate(PLACES)]


@unhurried
@given(st.lists(st.tuples(st.sampled_from(range(4)), st.booleans()), max_size=30))
def test_answers_by_topic_are_those_of_a_search(steps):
    state, there = GraphState(), dict[int, EndpointToken]()
    for number, alive in steps:
        key = str(ENDPOINTS[number])
        changed = state.add(key) if alive else state.discard(key)
        assert (changed is None) is ((number in there) is alive)
        if alive:
            there[number] = ENDPOINTS[number]
        else:
            there.pop(number, None)
        assert set(state.tokens()) == set(there.values())
        for topic in ("/a", "/b", "/none"):
            assert set(state.tokens(topic)) == {token for token in there.values() if token.topic == topic}
            for kind in (None, "MP", "SS"):
                wanted = {t.gid for t in there.values() if t.topic == topic and kind in (None, t.kind)}
                assert {info.gid for info in state.endpoints(topic, kind)} == wanted


def test_nodes_come_and_go_and_what_is_no_token_is_counted():
    state = GraphState()
    assert state.add(str(NODE)) == NODE
    assert state.add(str(NODE)) is None
    assert [node.full_name for node in state.nodes()] == ["/n"]
    assert state.discard(str(NODE)) == NODE
    assert state.discard(str(NODE)) is None
    assert state.add("@ros2_lv/0/nonsense") is None
    assert state.malformed == 1


def test_a_graph_that_has_settled_has_all_that_the_router_knows(zenoh_router):
    keys = [*map(str, [NODE, *ENDPOINTS]), "@ros2_lv/0/nonsense"]
    with closing(WireSession(connect=zenoh_router)) as there, closing(WireSession(connect=zenoh_router)) as asking:
        declared = [there.zenoh.liveliness().declare_token(key) for key in keys]
        with asking.client() as client:
            wait_until(lambda: len(list(client.liveliness().get("@ros2_lv/0/**"))) == len(declared))
        for _ in range(5):  # now and then a peer has been told all by itself
            with closing(WireSession(connect=zenoh_router)) as here, closing(Graph(here)) as graph:
                assert graph.settle(60.0)
                assert set(graph.tokens()) == set(ENDPOINTS)


def test_without_a_router_a_graph_does_not_settle(free_port):
    with closing(WireSession(connect=f"tcp/127.0.0.1:{free_port}")) as alone, closing(Graph(alone)) as graph:
        assert not graph.settle(60.0)


def test_what_is_reported_late_of_ones_own_does_not_bring_it_back(zenoh_router):
    with closing(WireSession(connect=zenoh_router)) as here, closing(Graph(here)) as graph:
        own = NodeToken(0, here.zid, 5, "own", "/")
        graph.add_own(first := NodeToken(0, here.zid, 4, "first", "/"))
        reports = here.zenoh.liveliness().declare_subscriber(str(own))
        declared = here.zenoh.liveliness().declare_token(str(own))
        late = reports.recv()
        told: list[tuple[object, bool]] = []
        graph.on_token(lambda token, alive: told.append((token, alive)))
        graph.add_own(own)
        graph.discard_own(own)
        done = threading.Event()
        graph._queue.put(late)
        graph._queue.put(done)
        assert done.wait(60)
        assert told == [(own, True), (own, False)]
        assert [node.name for node in graph.nodes()] == [first.name]
        assert graph.settle(60.0)  # the router knows it still
        declared.undeclare()
