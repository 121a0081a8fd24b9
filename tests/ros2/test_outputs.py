"""What `ros2` prints is read: texts as ROS 2 Jazzy prints them, and texts that are cut off or beside the point."""

from __future__ import annotations

import math

import pytest

from tests.ros2.installation import outputs
from tests.ros2.participant import GoalRun, Seen

ECHO = """\
WARNING: topic [/scan] does not appear to be published yet
header:
  stamp:
    sec: 1700000000
    nanosec: 123456789
  frame_id: laser
scan_time: 0.10000000149011612
ranges:
- 1.0
- .inf
intensities: []
---
A message was lost!!!
\ttotal count change:1
\ttotal count: 1---
header: {}
ranges: []
---
header:
  sta"""

CALL = """\
waiting for service to become available...
requester: making request: example_interfaces.srv.AddTwoInts_Request(a=3, b=4)

response:
example_interfaces.srv.AddTwoInts_Response(sum=-7)

"""

TYPES = """\
requester: making request: x(y=1)

response:
p.srv.X_Response(successful=True, failure_reason='it\\'s (so), or "not"', parts=[p.msg.F(id=1, at=[]), p.msg.F(id=2, \
at=array('B', [1, 2]))], uuid=array([0, 255], dtype=uint8), empty=array('d'), big=inf, none=nan, deep=p.msg.T(sec=-1))

"""

GOAL = """\
Waiting for an action server to become available...
Sending goal:
     order: 3

Feedback:
    sequence:
- 0
- 1
- 1

Goal accepted with ID: f9b3dc4dbbee4b5ba5b0a8b4e1e9f0f1

Feedback:
    sequence:
- 0
- 1
- 1
- 2

Result:
    sequence:
- 0
- 1
- 1
- 2

Goal finished with status: SUCCEEDED
"""

INFO = """\
Type: std_msgs/msg/String

Publisher count: 1

Node name: talker
Node namespace: /robot/arm
Topic type: std_msgs/msg/String
Topic type hash: RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18
Endpoint type: PUBLISHER
GID: 01.0f.4a.2e.93.11.5d.7c.00.00.00.00.00.00.14.03
QoS profile:
  Reliability: RELIABLE
  History (Depth): KEEP_LAST (7)
  Durability: TRANSIENT_LOCAL
  Lifespan: Infinite
  Deadline: Infinite
  Liveliness: AUTOMATIC
  Liveliness lease duration: Infinite

Subscription count: 1

Node name: listener
Node namespace: /
Topic type: std_msgs/msg/String
Topic type hash: INVALID
Endpoint type: SUBSCRIPTION
GID: 01.0f.4a.2e.93.11.5d.7c.00.00.00.00.00.00.14.04
QoS profile:
  Reliability: BEST_EFFORT
  History (Depth): UNKNOWN
  Durability: VOLATILE
  Lifespan: Infinite

"""


def test_messages_of_echo() -> None:
    first, second = outputs.messages(ECHO)
    assert first["header"] == {"stamp": {"sec": 1_700_000_000, "nanosec": 123_456_789}, "frame_id": "laser"}
    assert first["ranges"] == [1.0, math.inf]
    assert second == {"header": {}, "ranges": []}
    assert outputs.messages("data: half") == []


def test_responses_of_services() -> None:
    assert outputs.response(CALL) == {"sum": -7}
    read = outputs.response(TYPES)
    assert read.pop("none") != 0
    assert read == {
        "successful": True,
        "failure_reason": 'it\'s (so), or "not"',
        "parts": [{"id": 1, "at": []}, {"id": 2, "at": [1, 2]}],
        "uuid": [0, 255],
        "empty": [],
        "big": math.inf,
        "deep": {"sec": -1},
    }
    for text in ("The passed service type is invalid\n", "response:\n[1, 2]\n", "response:\nopen(x)\n\n"):
        with pytest.raises(ValueError):
            outputs.response(text)


def test_goals() -> None:
    told = [[0, 1, 1], [0, 1, 1, 2]]
    assert outputs.goal_run(GOAL) == GoalRun("SUCCEEDED", told[-1], told)
    cancelled = GOAL.replace("SUCCEEDED", "CANCELED")
    assert outputs.goal_run(cancelled).status == "CANCELED"
    assert outputs.goal_run("Sending goal:\n     order: -1\n\nGoal was rejected.\n") == GoalRun("REJECTED")
    with pytest.raises(ValueError, match="no end of a goal"):
        outputs.goal_run("Waiting for an action server to become available...\n")


def test_parameters() -> None:
    texts = {
        "Double value is: 0.5\n": 0.5,
        "Integer value is: 7\n": 7,
        "Boolean value is: True\n": True,
        "String value is: 7\n": "7",
        "Double values are: [0.5, 1.0]\n": [0.5, 1.0],
        "Parameter not set.\n": None,
        "Node not found\n": None,
    }
    assert {text: outputs.parameter(text) for text in texts} == texts
    assert outputs.names("  speed\n  start_type_description_service\n\n") == ["speed", "start_type_description_service"]
    assert outputs.names("/native:\n  speed\n") == ["speed"]
    assert outputs.names("Node not found\n") == []
    refusals = {
        "Set parameter successful\n": None,
        "Set parameter successful: as asked\n": None,
        "Setting parameter failed: not within 0..1\n": "not within 0..1",
        "Setting parameter failed\n": "no reason",
        "Node not found\n": "Node not found",
    }
    assert {text: outputs.refusal(text) for text in refusals} == refusals


def test_states() -> None:
    assert outputs.state("unconfigured [1]\n") == "unconfigured"
    assert outputs.state("/arm: active [3]\n") == "active"
    assert outputs.state("Node not found\n") == ""


def test_endpoints() -> None:
    string, type_hash = "std_msgs/msg/String", "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    assert outputs.endpoints(INFO) == [
        Seen("MP", "/robot/arm/talker", string, type_hash, "reliable", "transient_local", 7),
        Seen("MS", "/listener", string, "INVALID", "best_effort", "volatile", 0),
    ]
    assert outputs.endpoints("Unknown topic '/none'\n") == []
