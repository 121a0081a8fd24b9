"""The picture of a graph: links, faults, what is left out; as a tree and for graphviz."""

from __future__ import annotations

from metaros.cli.graph.model import GraphModel, build_graph_model, restrict
from metaros.cli.graph.text import dot, summary, tree
from metaros.wire import EndpointToken, NodeToken, QoSProfile, Reliability, qos_default
from metaros.wire.liveliness_tokens import EndpointKind

HASH, OTHER = "RIHS01_" + "ab" * 32, "RIHS01_" + "cd" * 32
BEST_EFFORT = QoSProfile(reliability=Reliability.BEST_EFFORT)
FIBONACCI = "example_interfaces/action/Fibonacci"


def end(
    node: str,
    kind: EndpointKind,
    topic: str,
    type_name: str = "std_msgs/msg/String",
    type_hash: str = HASH,
    qos: QoSProfile = qos_default,
) -> EndpointToken:
    """One endpoint of the node `/<node>`."""
    owner = NodeToken(0, "a1", 0, node)
    return EndpointToken(owner, 1, kind, topic, type_name, type_hash, qos.encode())


def plain(text: str, code: str) -> str:
    """No style."""
    return text


def lines(picture: GraphModel) -> list[str]:
    """The tree without styles."""
    return list(tree(picture, plain))


def test_a_topic_is_a_branch_with_its_readers() -> None:
    tokens = [end("talker", "MP", "/chatter"), end("ear", "MS", "/chatter"), end("eye", "MS", "/chatter")]
    assert lines(build_graph_model(["/talker", "/ear", "/eye"], tokens)) == [
        "/ear   reads and calls 1",
        "/eye   reads and calls 1",
        "/talker",
        "└─ /chatter  std_msgs/msg/String",
        "   ├─▶ /ear",
        "   └─▶ /eye",
    ]


def test_mismatches_are_marked_where_they_are_with_the_reason() -> None:
    tokens = [
        end("talker", "MP", "/chatter", qos=BEST_EFFORT),
        end("deaf", "MS", "/chatter"),
        end("old", "MS", "/chatter", type_hash=OTHER),
        end("odd", "MS", "/chatter", "std_msgs/msg/Int8"),
        end("ear", "MS", "/chatter", qos=BEST_EFFORT),
    ]
    picture = build_graph_model(["/talker", "/deaf", "/old", "/odd", "/ear"], tokens)
    assert {(item.sink, item.code) for item in picture.faults} == {
        ("/deaf", "qos_mismatch"),
        ("/old", "type_hash_mismatch"),
        ("/odd", "type_mismatch"),
    }
    text = "\n".join(lines(picture))
    assert "✗ /deaf  reliability: best_effort is offered, reliable requested" in text
    assert "✗ /old  type hash RIHS01_abababab… meets RIHS01_cdcdcdcd…" in text
    assert "✗ /odd  type std_msgs/msg/String meets std_msgs/msg/Int8" in text
    assert "▶ /ear" in text
    assert summary(picture, plain) == "5 nodes, 1 topic  ✗ 3 mismatches"


def test_who_waits_in_vain_is_reported() -> None:
    tokens = [end("ear", "MS", "/silence"), end("ear", "SC", "/help", "std_srvs/srv/Trigger")]
    assert lines(build_graph_model(["/ear"], tokens)) == [
        "/ear",
        "├─ ◁ /silence  std_msgs/msg/String  nobody publishes",
        "└─ ◁ service /help  std_srvs/srv/Trigger  nobody serves",
    ]


def test_an_action_is_one_link() -> None:
    tokens = []
    for node, service, topic in (("walker", "SS", "MP"), ("boss", "SC", "MS")):
        tokens += [
            end(node, service, "/walk/_action/send_goal", f"{FIBONACCI}_SendGoal"),  # type: ignore[arg-type]
            end(node, service, "/walk/_action/get_result", f"{FIBONACCI}_GetResult"),  # type: ignore[arg-type]
            end(node, topic, "/walk/_action/feedback", f"{FIBONACCI}_FeedbackMessage"),  # type: ignore[arg-type]
        ]
    picture = build_graph_model(["/walker", "/boss"], tokens)
    (link,) = picture.links
    assert (link.kind, link.name, link.types) == ("action", "/walk", (FIBONACCI,))
    assert (link.sources, link.sinks) == (("/walker",), ("/boss",))
    assert f"└─ action /walk  {FIBONACCI}" in lines(picture)
    assert len(build_graph_model(["/walker", "/boss"], tokens, everything=True).links) == 3


def test_what_every_node_has_is_left_out_unless_asked_for() -> None:
    tokens = [
        end("talker", "MP", "/rosout", "rcl_interfaces/msg/Log"),
        end("talker", "SS", "/talker/set_parameters", "rcl_interfaces/srv/SetParameters"),
    ]
    assert build_graph_model(["/talker"], tokens).links == ()
    assert len(build_graph_model(["/talker"], tokens, everything=True).links) == 2


def test_restricted_to_a_name_and_what_it_is_linked_to() -> None:
    tokens = [end("talker", "MP", "/chatter"), end("ear", "MS", "/chatter"), end("eye", "MS", "/odom")]
    picture = restrict(build_graph_model(["/talker", "/ear", "/eye"], tokens), "talk")
    assert picture.nodes == ("/ear", "/talker")
    assert [link.name for link in picture.links] == ["/chatter"]


def test_graphviz_gets_edges_and_faults_in_red() -> None:
    tokens = [
        end("talker", "MP", "/chatter"),
        end("ear", "MS", "/chatter"),
        end("old", "MS", "/chatter", type_hash=OTHER),
        end("talker", "SS", "/reset", "std_srvs/srv/Trigger"),
        end("ear", "SC", "/reset", "std_srvs/srv/Trigger"),
    ]
    text = list(dot(build_graph_model(["/talker", "/ear", "/old"], tokens)))
    assert (text[0], text[-1]) == ("digraph metaros {", "}")
    assert '  "node /talker" -> "topic /chatter";' in text
    assert '  "topic /chatter" -> "node /ear";' in text
    assert '  "topic /chatter" -> "node /old";' not in text
    assert '  "node /ear" -> "service /reset";' in text
    assert '  "service /reset" -> "node /talker";' in text
    assert any(line.startswith('  "node /talker" -> "node /old" [color=red') for line in text)
