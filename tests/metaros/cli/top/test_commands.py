"""`metaros top`: rates and rows, pure; then beside a real node, and on a terminal."""

from __future__ import annotations

import io
import json
import os
import signal
from dataclasses import replace
from itertools import product

import pytest
from rich.console import Console

import metaros
from metaros.cli.shared.topic_rates import RateMeter, TopicRates
from metaros.cli.top.drops import DropRow, drop_cells, drop_rows
from metaros.cli.top.rows import NodeRow, Screenful, TopicRow, node_rows, topic_rows
from metaros.cli.top.screen import node_columns, render, summary, topic_cells
from metaros.interfaces.std_msgs.msg import String
from metaros.wire import EndpointToken, NodeToken, qos_default
from metaros.wire.graph import GraphState
from tests.metaros.cli.conftest import Reported, Run
from tests.support.processes.command_line import program
from tests.support.processes.processes import END_S, started


def test_rates_are_means_over_five_looks() -> None:
    meter = RateMeter()
    assert meter.look(0.0, {}) == {}
    assert meter.look(1.0, {"/a": (10, 1000)}) == {"/a": TopicRates(10.0, 1000.0)}
    for second in range(2, 11):
        rates = meter.look(float(second), {"/a": (10, 1000), "/b": (second, second)})
    assert rates == {"/a": TopicRates(0.0, 0.0), "/b": TopicRates(1.0, 1.0)}


def state() -> GraphState:
    """/talker publishes /a and /b, /ear reads /a."""
    graph = GraphState()
    for name, ends in (("talker", (("MP", "/a"), ("MP", "/b"))), ("ear", (("MS", "/a"),))):
        node = NodeToken(0, "a1" if name == "ear" else "b2", 0, name)
        graph.add(str(node))
        for number, (kind, topic) in enumerate(ends, start=1):
            text = qos_default.encode()
            graph.add(str(EndpointToken(node, number, kind, topic, "std_msgs/msg/String", "RIHS01_ab", text)))  # type: ignore[arg-type]
    return graph


def test_rows_and_their_order() -> None:
    ends = state().endpoints()
    rates = {"/b": TopicRates(5.0, 50.0), "/a": TopicRates(2.0, 100.0)}
    first = TopicRow("/a", "std_msgs/msg/String", 2.0, 100.0, 1, 1)
    second = TopicRow("/b", "std_msgs/msg/String", 5.0, 50.0, 1, 0)
    assert topic_rows(ends, rates) == (first, second)
    assert topic_rows(ends, rates, sort="rate") == (second, first)
    assert topic_rows(ends, rates, sort="bandwidth") == (first, second)
    assert topic_rows(ends, rates, word="b") == (second,)


def test_a_node_s_process_is_shown_where_it_is_known() -> None:
    from metaros.cli.top.processes import Usage

    graph = state()
    rows = node_rows(graph.nodes(), graph.endpoints(), {"b2": Usage(42, 12.5)})
    assert rows == (NodeRow("/ear", 0, 1, 0), NodeRow("/talker", 2, 0, 0, 42, 12.5))
    assert node_columns(Screenful((), rows, 0))[-1] == "CPU"
    assert node_columns(Screenful((), rows[:1], 0))[-1] == "Srv"


def test_silence_is_a_dash() -> None:
    assert topic_cells(TopicRow("/a", "t", 0.0, 0.0, 1, 0)) == ("/a", "t", "–", "–", "1", "0")


def test_who_misses_most_comes_first_and_what_is_no_row_is_left_out() -> None:
    counts = {"depth": 5, "queued": 2, "queued_bytes": 4096, "lost": 0, "expired": 0, "malformed": 0}
    good = [{"node": f"/n{number}", "topic": "/t", "dropped": number, **counts} for number in range(3)]
    answers = [b"no json", b"{}", b"[1, {}]", json.dumps([*good, good[0] | {"dropped": "many"}]).encode()]
    rows = drop_rows(answers)
    assert [row.node for row in rows] == ["/n2", "/n1", "/n0"]
    assert drop_rows(answers, word="n1") == (rows[1],)
    assert drop_cells(rows[0]) == ("/n2", "/t", "2/5", "4.1 kB", "2", "–", "–", "–")
    assert drop_cells(replace(rows[0], depth=None, queued=1200))[2] == "1200/all"
    screenful = Screenful((), (), 0, rows)
    assert screenful.dropping == rows[:2]
    assert summary(screenful).endswith(", 3 missed")


def test_the_live_screen_fits_the_terminal() -> None:
    topics = tuple(TopicRow(f"/topic_{n}", "std_msgs/msg/String", n, n * 10, 1, 0) for n in range(40))
    nodes = tuple(NodeRow(f"/node_{n}", 1, 0, 0, n, 1.0) for n in range(20))
    for height, drops in product((16, 24, 50), (0, 1, 9)):
        missed = tuple(DropRow(f"/slow_{n}", "/t", 5, 5, 100, 1, 0, 0, 0) for n in range(drops))
        console = Console(width=100, height=height, file=io.StringIO(), force_terminal=False)
        shown = console.render(render(Screenful(topics, nodes, 1, missed), height))
        text = "".join(segment.text for segment in shown)
        assert text.count("\n") <= max(height, 15 + (6 if drops else 0)), (height, drops)
        assert "more" in text
        assert "✗ 1 mismatch:" in text


def test_summary() -> None:
    rows = (TopicRow("/a", "t", 10.0, 1500.0, 1, 0), TopicRow("/b", "t", 5.0, 500.0, 1, 0))
    assert summary(Screenful(rows, (), 0)) == "0 nodes, 2 topics, 15 messages/s, 2 kB/s"


@pytest.mark.usefixtures("talker")
def test_once(run: Run) -> None:
    facts = json.loads(run("top", "--once", "--interval", "0.1", "-o", "json").out)
    (node,) = (row for row in facts["nodes"] if row["node"] == "/demo/talker")
    assert node["pid"] in (None, os.getpid())
    done = run("top", "chatter", "--once", "--interval", "0.1")
    assert done.out.startswith("/chatter  std_msgs/msg/String  ")
    assert "1 topic," in done.err


@pytest.mark.usefixtures("talker")
def test_a_stream_of_objects(zenoh_port: str) -> None:
    with started(program("top", "-o", "json", "--interval", "0.1", "--zenoh-port", zenoh_port)) as top:
        assert top.stdout is not None
        rows = (row for line in top.stdout for row in json.loads(line)["topics"])
        chatter = next(row for row in rows if row["topic"] == "/chatter" and row["rate_hz"])
        top.send_signal(signal.SIGINT)
        _, err = top.communicate(timeout=END_S)
    assert (top.returncode, err) == (0, "")
    assert 0 < chatter["rate_hz"] < 60
    assert chatter["bytes_per_s"] > 0
    assert (chatter["publishers"], chatter["subscribers"]) == (1, 0)


@pytest.mark.usefixtures("talker")
def test_graph_as_tree_json_and_dot(run: Run, talker: metaros.Node, told: Reported) -> None:
    talker.create_publisher(String, "/cry")
    talker.create_raw_subscription("/cry", "std_msgs/msg/String", "RIHS01_" + "ab" * 32, qos_default, lambda _: None)
    told("/cry", ends=2)
    done = run("graph")
    assert "├─ /cry  std_msgs/msg/String" in done.out
    assert "✗ /demo/talker  type hash RIHS01_df668c74… meets RIHS01_abababab…" in done.out
    assert "/rosout" not in done.out
    assert "/rosout" in run("graph", "--all").out
    facts = json.loads(run("graph", "-o", "json").out)
    assert facts["nodes"] == ["/demo/talker"]
    (link,) = (link for link in facts["links"] if link["name"] == "/cry")
    assert [fault["code"] for fault in link["faults"]] == ["type_hash_mismatch"]
    assert run("graph", "-o", "dot").out.startswith("digraph metaros {")


def test_graph_of_a_name_that_is_not_there(run: Run, talker: metaros.Node) -> None:
    talker.create_subscription(String, "/chatter", lambda _: None)
    done = run("graph", "chater")
    assert done.code == 1
    assert "no name in the graph contains 'chater'" in done.err
