"""What clients send, as requests or as a status that says what is wrong with it."""

from __future__ import annotations

import json
import math
from typing import Any

import cbor2
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.api.rosbridge.protocol import PLAIN, Protocol
from gateway.api.rosbridge.requests import (
    OPS,
    ActionResult,
    CallService,
    Publish,
    SendGoal,
    Shape,
    Subscribe,
    Unsubscribe,
)


def receive(protocol: Protocol, **message: Any) -> Any:
    request, frames = protocol.receive(json.dumps(message), now_s=0.0)
    assert not frames, frames
    return request


def refused(protocol: Protocol, frame: str | bytes) -> dict[str, Any]:
    """The status that a frame is answered with."""
    request, frames = protocol.receive(frame, now_s=0.0)
    assert request is None
    (text, data), *rest = frames
    assert text
    assert not rest
    return dict(json.loads(data))


def test_a_subscription_with_everything() -> None:
    found = receive(
        Protocol(),
        op="subscribe",
        id="s1",
        topic="/odom",
        type="nav_msgs/Odometry",
        throttle_rate=100,
        queue_length=3,
        fragment_size=1000,
        compression="png",
    )
    assert isinstance(found, Subscribe)
    assert (found.id, found.topic, found.type_name, found.throttle_s) == ("s1", "/odom", "nav_msgs/Odometry", 0.1)
    assert (found.queue_length, found.shape) == (3, Shape(fragment_size=1000, compression="png"))


def test_what_is_left_out_has_a_default() -> None:
    found = receive(Protocol(), op="subscribe", topic="odom", type=None)
    assert (found.id, found.type_name, found.throttle_s, found.queue_length, found.shape) == (None, "", 0.0, 0, PLAIN)
    call = receive(Protocol(), op="call_service", service="rosapi/topics")
    assert isinstance(call, CallService)
    assert (call.args, call.timeout_s) == (None, None)
    assert isinstance(receive(Protocol(), op="unsubscribe", topic="/odom"), Unsubscribe)
    result = receive(Protocol(), op="action_result", id="g", result=False)
    assert isinstance(result, ActionResult)
    assert (result.status, result.result) == (6, False)


def test_nan_as_python_writes_it_is_taken() -> None:
    text = json.dumps({"op": "publish", "topic": "/x", "msg": {"data": [math.nan, -math.inf]}})
    found, _ = Protocol().receive(text, now_s=0.0)
    assert isinstance(found, Publish)
    assert math.isnan(found.message["data"][0])
    assert found.message["data"][1] == -math.inf


def test_a_goal_needs_an_id() -> None:
    said = refused(Protocol(), b'{"op":"send_action_goal","action":"/a","args":{}}')
    assert "id" in said["msg"]
    assert isinstance(receive(Protocol(), op="send_action_goal", id="g", action="/a", action_type="p/A"), SendGoal)


WRONG: tuple[dict[str, Any], ...] = (
    {"op": "dance"},
    {"op": 5},
    {},
    {"op": "subscribe"},
    {"op": "subscribe", "topic": 5},
    {"op": "subscribe", "topic": "/x", "throttle_rate": "fast"},
    {"op": "subscribe", "topic": "/x", "compression": "zip"},
    {"op": "publish", "topic": ""},
    {"op": "set_level", "level": "loud"},
    {"op": "advertise", "topic": "/x", "type": 5},
    {"op": "auth", "mac": "x"},
    {"op": "fragment", "id": "x"},
)


def test_what_does_not_fit_is_answered_with_a_status_about_it() -> None:
    for wrong in WRONG:
        said = refused(Protocol(), json.dumps({"id": "r7", **wrong}))
        assert (said["op"], said["level"], said.get("id")) == ("status", "error", wrong.get("id", "r7")), wrong


def test_levels_say_which_statuses_come() -> None:
    protocol = Protocol()
    assert protocol.status("error", "x")
    assert not protocol.status("warning", "x")
    receive(protocol, op="set_level", level="info")
    assert protocol.status("info", "x")
    assert protocol.status("warning", "x")
    receive(protocol, op="set_level", level="none")
    assert not protocol.status("error", "x")
    assert protocol.receive("no json", now_s=0.0) == (None, [])


def test_an_answer_is_shaped_as_its_request_said() -> None:
    protocol, message = Protocol(), {"op": "service_response", "values": {"text": "x" * 500}}
    assert [json.loads(data) for _, data in protocol.answer(message)] == [message]
    ((text, data),) = protocol.answer(message, Shape(compression="cbor"))
    assert not text
    assert cbor2.loads(data) == message
    pieces = [json.loads(data) for _, data in protocol.answer(message, Shape(fragment_size=100))]
    assert len(pieces) > 4
    assert json.loads("".join(piece["data"] for piece in pieces)) == message
    assert len({piece["id"] for piece in pieces}) == 1
    other = json.loads(protocol.answer(message, Shape(fragment_size=100))[0][1])
    assert other["id"] != pieces[0]["id"]


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=9), inner, max_size=4),
    max_leaves=9,
)
NAMES = st.sampled_from(["topic", "service", "action", "id", "type", "args", "values", "level", "fragment_size", "num"])


@settings(max_examples=50)
@given(st.text(max_size=40) | st.binary(max_size=40))
def test_garbage_is_a_status_and_nothing_else(frame: str | bytes) -> None:
    _, frames = Protocol().receive(frame, now_s=0.0)
    assert all(json.loads(data)["op"] == "status" for _, data in frames)


@settings(max_examples=60)
@given(st.sampled_from([*OPS, "fragment", "auth"]), st.dictionaries(NAMES, JSON, max_size=6))
def test_any_fields_of_any_op_are_a_request_or_a_status(op: str, fields: dict[str, Any]) -> None:
    request, frames = Protocol().receive(json.dumps({"op": op, **fields}), now_s=0.0)
    assert request is None or not frames
    assert all(json.loads(data)["op"] == "status" for _, data in frames)


def test_json_nested_without_end_is_a_status() -> None:
    assert refused(Protocol(), '{"op":"publish","topic":"/x","msg":NaN,"x":' + "[" * 100_000)["level"] == "error"
