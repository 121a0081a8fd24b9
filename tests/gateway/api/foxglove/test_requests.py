"""JSON of clients: every op becomes a value, everything else a refusal that names the field."""

from __future__ import annotations

import contextlib
import json

from hypothesis import given
from hypothesis import strategies as st

from gateway.api.foxglove import requests
from gateway.api.foxglove.requests import TextRequest, read_text
from gateway.errors import InvalidRequestError
from tests.support.tables import refusal

EVERY_OP: list[tuple[dict[str, object], TextRequest]] = [
    (
        {"op": "subscribe", "subscriptions": [{"id": 0, "channelId": 3}, {"id": 1, "channelId": 4}]},
        requests.Subscribe(((0, 3), (1, 4))),
    ),
    ({"op": "unsubscribe", "subscriptionIds": [0, 1]}, requests.Unsubscribe((0, 1))),
    (
        {
            "op": "advertise",
            "channels": [{"id": 2, "topic": "/t", "encoding": "json", "schemaName": "std_msgs/msg/String"}],
        },
        requests.Advertise((requests.ClientChannel(2, "/t", "json", "std_msgs/msg/String"),)),
    ),
    ({"op": "unadvertise", "channelIds": [2]}, requests.Unadvertise((2,))),
    ({"op": "getParameters", "parameterNames": [], "id": "all"}, requests.GetParameters((), "all")),
    (
        {"op": "setParameters", "parameters": [{"name": "/n.p", "value": 1.5, "type": "float64"}]},
        requests.SetParameters((requests.Parameter("/n.p", 1.5, "float64"),), None),
    ),
    ({"op": "subscribeParameterUpdates", "parameterNames": ["a"]}, requests.WatchParameters(("a",), on=True)),
    ({"op": "unsubscribeParameterUpdates", "parameterNames": ["a"]}, requests.WatchParameters(("a",), on=False)),
    ({"op": "subscribeConnectionGraph"}, requests.WatchGraph(on=True)),
    ({"op": "unsubscribeConnectionGraph"}, requests.WatchGraph(on=False)),
    ({"op": "fetchAsset", "uri": "package://a/b.stl", "requestId": 9}, requests.FetchAsset("package://a/b.stl", 9)),
]


def test_every_op_is_read() -> None:
    assert [(said, read_text(json.dumps(said))) for said, _ in EVERY_OP] == EVERY_OP


WRONG = (  # what is said, and what its refusal names
    ("no json", "no JSON"),
    ("[]", "JSON object"),
    ('{"op": "dance"}', "'dance'"),
    ('{"op": ["subscribe"]}', "unknown"),
    ('{"op": "subscribe"}', "subscriptions"),
    ('{"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 1}]}', "id is a number"),
    ('{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": true}]}', "channelId"),
    ('{"op": "unsubscribe", "subscriptionIds": ["1"]}', "subscriptionIds"),
    ('{"op": "getParameters", "parameterNames": [1]}', "parameterNames"),
    ('{"op": "fetchAsset", "uri": "", "requestId": 1}', "uri"),
)


def test_what_is_wrong_is_named() -> None:
    refused = [(said, refusal(InvalidRequestError, read_text, said), named) for said, named in WRONG]
    assert [row for row in refused if row[2] not in row[1]] == []


VALUES = st.none() | st.integers() | st.text(max_size=4)


@given(st.sampled_from([str(said["op"]) for said, _ in EVERY_OP]), st.lists(VALUES, max_size=3) | VALUES)
def test_any_value_of_a_field_is_read_or_refused(op: str, value: object) -> None:
    meant = next(said for said, _ in EVERY_OP if said["op"] == op)
    for name in meant:
        if name != "op":
            with contextlib.suppress(InvalidRequestError):
                read_text(json.dumps({**meant, name: value}))
