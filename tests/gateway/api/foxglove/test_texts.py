"""What clients are told in JSON."""

from __future__ import annotations

import json

from gateway.api.foxglove import texts
from gateway.api.foxglove.requests import Parameter
from gateway.api.foxglove.texts import GraphView


def test_the_first_message_says_what_can_be_done() -> None:
    span = (1_500_000_000, 2 * 10**9)
    info = json.loads(texts.server_info("x", session="s", metadata={"a": "b"}, span_ns=span, assets=True))
    assert info["capabilities"] == list(texts.CAPABILITIES)
    assert info["supportedEncodings"] == ["json", "cdr"]
    assert (info["dataStartTime"], info["dataEndTime"]) == ({"sec": 1, "nsec": 500_000_000}, {"sec": 2, "nsec": 0})
    bare = json.loads(texts.server_info("x", session="s", metadata={}, span_ns=None, assets=False))
    assert set(info["capabilities"]) - set(bare["capabilities"]) == {"assets", "playbackControl"}
    assert "dataStartTime" not in bare


def test_a_parameter_without_a_value_has_none() -> None:
    said = json.loads(texts.parameter_values([Parameter("/n.a", 1.0, "float64"), Parameter("/n.b")], answer_to="x"))
    assert said["parameters"] == [{"name": "/n.a", "value": 1.0, "type": "float64"}, {"name": "/n.b"}]
    assert said["id"] == "x"
    assert "id" not in json.loads(texts.parameter_values([]))


def test_a_graph_is_reported_whole_and_then_as_changes() -> None:
    one = GraphView({"/a": ["n1"], "/b": ["n1"]}, {"/a": ["n2"]}, {"/s": ["n1"]})
    first = json.loads(texts.graph_update(None, one) or "")
    assert first == {
        "op": "connectionGraphUpdate",
        "publishedTopics": [{"name": "/a", "publisherIds": ["n1"]}, {"name": "/b", "publisherIds": ["n1"]}],
        "subscribedTopics": [{"name": "/a", "subscriberIds": ["n2"]}],
        "advertisedServices": [{"name": "/s", "providerIds": ["n1"]}],
        "removedTopics": [],
        "removedServices": [],
    }
    assert texts.graph_update(one, one) is None
    two = GraphView({"/b": ["n1", "n3"]}, {"/a": ["n2"]}, {})
    after = json.loads(texts.graph_update(one, two) or "")
    assert after["publishedTopics"] == [
        {"name": "/b", "publisherIds": ["n1", "n3"]},
        {"name": "/a", "publisherIds": []},
    ]
    assert (after["subscribedTopics"], after["advertisedServices"]) == ([], [])
    assert (after["removedTopics"], after["removedServices"]) == ([], ["/s"])
    gone = json.loads(texts.graph_update(two, GraphView({}, {}, {})) or "")
    assert gone["removedTopics"] == ["/a", "/b"]
    assert gone["publishedTopics"] == gone["subscribedTopics"] == []


def test_an_empty_graph_is_reported_the_first_time() -> None:
    said = json.loads(texts.graph_update(None, GraphView({}, {}, {})) or "")
    assert said["op"] == "connectionGraphUpdate"
    assert len(said) == 6
