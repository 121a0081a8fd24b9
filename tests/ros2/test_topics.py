"""Topics: what is published arrives as it was, and what is kept comes to who asks later."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.ros2.participant import Participant
from tests.ros2.raw.cdr import decode, encode
from tests.ros2.raw.layouts import LAYOUTS
from tests.ros2.samples import SAMPLES, same
from tests.ros2.scenarios import scenario
from tests.support.waiting import wait_until

pytestmark = pytest.mark.xdist_group("ros2")
VECTORS = json.loads((Path(__file__).parents[1] / "data" / "ros2_vectors.json").read_text())


@scenario("messages on topics", told="speak", heard="listen")
def test_what_is_published_arrives_as_it_was(teller: Participant, hearer: Participant) -> None:
    for number, (type_name, fields) in enumerate(SAMPLES.items()):
        topic = f"/{teller.name}_{hearer.name}_{number}"
        heard = hearer.listen(topic, type_name)
        say = teller.speak(topic, type_name, fields)
        wait_until(lambda say=say, heard=heard: (say() and False) or heard())
        assert [message for message in heard() if not same(message, fields)] == []


@scenario("latched topics", told="latch", heard="hear latched")
def test_what_is_kept_comes_to_who_asks_later(teller: Participant, hearer: Participant) -> None:
    topic, fields = f"/{teller.name}_{hearer.name}_map", {"data": "office"}
    teller.speak(topic, "std_msgs/msg/String", fields, latched=True)()
    heard = hearer.listen(topic, "std_msgs/msg/String", latched=True)
    wait_until(heard)
    assert [dict(message) for message in heard()] == [fields]


def test_the_raw_peers_bytes_are_those_of_fast_cdr() -> None:
    vectors = {vector["type"]: bytes.fromhex(vector["fastcdr_1_0_26"]) for vector in VECTORS["cdr"]}
    for type_name, fields in SAMPLES.items():
        assert encode(LAYOUTS[type_name], fields) == vectors[type_name], type_name
        assert same(decode(LAYOUTS[type_name], vectors[type_name]), fields)
    request, response = LAYOUTS["example_interfaces/srv/AddTwoInts"]
    assert encode(request, {"a": 3, "b": 4}) == vectors["example_interfaces/srv/AddTwoInts_Request"]
    assert encode(response, {"sum": 7}) == vectors["example_interfaces/srv/AddTwoInts_Response"]
    jazzy = VECTORS["real_ros2_jazzy_cdr"]["vectors"]
    checked = [name for name in LAYOUTS if name in jazzy]
    assert len(checked) == 6
    for name in checked:
        for data in map(bytes.fromhex, jazzy[name]):
            assert encode(LAYOUTS[name], decode(LAYOUTS[name], data)) == data, name
