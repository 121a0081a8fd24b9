"""Liveliness tokens: nodes and endpoints, and texts that are neither."""

from __future__ import annotations

from contextlib import suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.errors import TokenError
from metaros.wire import EndpointToken, NodeToken, gid_of, parse_token, qos_default
from metaros.wire.graph import GraphState
from metaros.wire.matching import mismatch

NODE = NodeToken(0, "aac3178e146ba6f1fc6e6a4085e77f21", 3, "talker", "/fleet/robot1", "/")
PUBLISHER = EndpointToken(
    NODE, 10, "MP", "/fleet/robot1/chatter", "std_msgs/msg/String", "RIHS01_" + "0" * 64, qos_default.encode()
)
PARTS = st.sampled_from(
    [
        *("@ros2_lv", "0", "3", "ab12", "NN", "MP", "MS", "%", "%a%b", "talker", "", "é", "*", "**"),
        *("x::msg::dds_::Y_", "RIHS01_0", "::,10:,:,:,,", ":::", "backends:cpu:", "-1", "9" * 30),
    ]
)


def test_tokens_read_what_they_write():
    assert parse_token(str(NODE)) == NODE
    assert parse_token(str(PUBLISHER)) == PUBLISHER
    assert NODE.full_name == "/fleet/robot1/talker"
    assert PUBLISHER.gid == gid_of(str(PUBLISHER))


def test_the_fourteenth_part_of_newer_releases_is_kept():
    token = parse_token(f"{PUBLISHER}/backends:cpu:")
    assert isinstance(token, EndpointToken)
    assert token.backends == "backends:cpu:"
    assert str(token) == f"{PUBLISHER}/backends:cpu:"


@settings(max_examples=50)
@given(st.one_of(st.text(), st.lists(PARTS, min_size=7, max_size=15).map("/".join)))
def test_any_text_is_a_token_or_a_token_error(text):
    try:
        token = parse_token(text)
    except TokenError:
        return
    assert parse_token(str(token)) == token


@settings(max_examples=50)
@given(st.integers(0, 13), PARTS)
def test_any_damaged_token_is_a_token_or_a_token_error(place, part):
    parts = [*str(PUBLISHER).split("/"), "backends:cpu:"]
    parts[place] = part
    with suppress(TokenError):
        parse_token("/".join(parts))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "@ros2_lv/0/a/0/0/NN/%/%",
        "@ros2_lv/0/a/0/1/NN/%/%/talker",
        "@ros2_lv/0/A/0/0/NN/%/%/talker",
        "@ros2_lv/0/a/0/0/XX/%/%/talker",
        "@ros2_lv/300/a/0/0/NN/%/%/talker",
        str(PUBLISHER).replace("%fleet%robot1%chatter", "%"),
        "a" * 5000,
    ],
)
def test_no_token(text):
    with pytest.raises(TokenError):
        parse_token(text)


def test_the_graph_counts_what_it_cannot_read():
    state = GraphState()
    assert state.add(str(NODE)) == NODE
    assert state.add(str(NODE)) is None
    assert state.add(str(PUBLISHER)) == PUBLISHER
    assert state.add("@ros2_lv/0/nonsense") is None
    assert state.malformed == 1
    assert [node.full_name for node in state.nodes()] == ["/fleet/robot1/talker"]
    (endpoint,) = state.endpoints("/fleet/robot1/chatter", "MP")
    assert (endpoint.node_full_name, endpoint.qos) == ("/fleet/robot1/talker", qos_default)
    assert state.discard(str(PUBLISHER)) == PUBLISHER
    assert state.discard(str(PUBLISHER)) is None
    assert state.endpoints() == []


def variant(**changes: object) -> EndpointToken:
    fields = {"node": NODE, "eid": 11, "kind": "MS", "topic": PUBLISHER.topic, "type_name": PUBLISHER.type_name}
    fields |= {"type_hash": PUBLISHER.type_hash, "qos_text": PUBLISHER.qos_text}
    return EndpointToken(**(fields | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("peer", "code"),
    [
        (variant(), None),
        (variant(kind="MP", type_hash="RIHS01_11"), None),
        (variant(topic="/other", type_hash="RIHS01_11"), None),
        (variant(type_hash="RIHS01_11"), "type_hash_mismatch"),
        (variant(type_name="std_msgs/msg/Bool"), "type_mismatch"),
        (variant(qos_text=":1:,1:,:,:,,"), "qos_mismatch"),
    ],
)
def test_what_keeps_two_endpoints_apart(peer, code):
    found = mismatch(PUBLISHER, peer)
    assert (found and found.code) == code
