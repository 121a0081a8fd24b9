"""The same event and the same zip file give the same call, at the gateway and on the robot."""

from __future__ import annotations

import json
from pathlib import Path

from gateway.automation.sample_events import sample_event
from gateway.domain.automation.shapes import eventbridge
from gateway.domain.channel import Channel
from metaros.automation.functions.calls import FunctionSpec
from metaros.automation.functions.package import unpack
from metaros.automation.robot.event import ReceivedMessage, event_of
from metaros.automation.robot.program import open_package
from metaros.cdr import codec
from metaros.idl.json import to_json
from metaros.interfaces.std_msgs.msg import String
from tests.support.functions.functions import running_engine
from tests.support.functions.robot_function import function_zip, write_function

STAMP_NS = 1_700_000_000_123_456_789


def test_the_shape_is_the_gateways() -> None:
    message = to_json(codec("std_msgs/msg/String").decode(codec("std_msgs/msg/String").encode(String(data="é"))))
    here = event_of(
        ReceivedMessage(
            topic="/r/word", type="std_msgs/msg/String", stamp_ns=STAMP_NS, seq=7, gid=b"\x0a", message=message
        ),
        robot="r",
    )
    channel = Channel(robot="r", channel_id=1, topic="/r/word", schema_name="std_msgs/msg/String", type_hash="")
    there = eventbridge(sample_event("r", 3, 9, 7, STAMP_NS, channel, {"message": message}))
    assert here.pop("id") == "r/r/word/0a/7"
    assert there.pop("id") == "r/3/9/7"
    assert here == there


async def test_the_same_zip_gives_the_same_answer(tmp_path: Path) -> None:
    function_zip(write_function(tmp_path / "echo"))
    package = open_package(tmp_path / "echo.zip", tmp_path / "robot")
    event = {"detail": {"message": {"data": "hello"}}}
    async with running_engine(tmp_path) as bench:
        here = package.spec()
        code = unpack(tmp_path / "echo.zip", tmp_path / "gateway")
        arn = "arn:aws:lambda:local:000000000000:function:echo"
        there = FunctionSpec(key="g", name="echo", version="1", arn=arn, handler="app.handler", code_dir=code)
        assert await bench.returned(here, event) == await bench.returned(there, event) == event
    assert json.loads((code / "function.yaml").read_text())["name"] == "echo"
