"""type, find, info and delay of topics and services against a real node."""

from __future__ import annotations

import json

import pytest

import metaros
from metaros.cdr import codec
from metaros.cli.graph_target import listener
from metaros.cli.topic.delay import Delay
from metaros.clock import ManualClock
from metaros.errors import UsageError
from metaros.interfaces.sensor_msgs.msg import Temperature
from metaros.interfaces.std_srvs.srv import Trigger
from tests.metaros.cli.conftest import Reported, Run, assert_reported
from tests.support.processes.command_line import stream_metaros


def stamped(clock: ManualClock, *, age_s: float) -> bytes:
    """A Temperature made `age_s` ago."""
    message = Temperature()
    made_ns = clock.wall_ns() - round(age_s * 1e9)
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(made_ns, 10**9)
    return codec(Temperature).encode(message)


def test_delay_is_stamp_to_arrival_without_the_wait_in_our_queue(clock: ManualClock) -> None:
    delay = Delay(10, "sensor_msgs/msg/Temperature", clock=clock)
    for age_s in (0.1, 0.3):
        payload, arrived = stamped(clock, age_s=age_s), clock.monotonic_s()
        clock.advance(0.5)  # our own queue's
        delay.add(arrived, payload)
    report = delay.report(clock.monotonic_s())
    assert report["delay_s"] == pytest.approx(0.2)
    assert (report["min_s"], report["max_s"]) == (pytest.approx(0.1), pytest.approx(0.3))
    assert delay.report(clock.monotonic_s() + 60.0) == {"window": 0}


def test_delay_of_what_has_no_header(clock: ManualClock) -> None:
    with pytest.raises(UsageError, match="no header"):
        Delay(10, "std_msgs/msg/String", clock=clock)


@pytest.mark.usefixtures("talker")
def test_types_and_the_way_back(run: Run) -> None:
    assert run("topic", "type", "/chatter").out == "std_msgs/msg/String\n"
    assert json.loads(run("topic", "type", "/chatter", "-o", "json").out) == ["std_msgs/msg/String"]
    assert run("topic", "find", "std_msgs/String").out == "/chatter\n"
    assert run("topic", "find", "std_msgs/msg/String", "-c").out == "1\n"
    assert run("service", "type", "/demo/talker/reset").out == "std_srvs/srv/Trigger\n"
    assert run("service", "find", "std_srvs/Trigger").out == "/demo/talker/reset\n"
    assert run("service", "find", "std_srvs/Empty", "-c").out == "0\n"


@pytest.mark.usefixtures("talker")
def test_what_is_not_there_gets_a_hint(run: Run) -> None:
    table = {
        ("topic", "type", "/chater"): (1, "did you mean /chatter?"),
        ("service", "type", "/demo/talker/rest"): (1, "did you mean /demo/talker/reset?"),
        ("service", "info", "/demo/talker/rest"): (1, "did you mean /demo/talker/reset?"),
        ("topic", "find", "std_msgs/Strng"): (2, "std_msgs/msg/String"),
        ("service", "find", "std_srvs/Triger"): (2, "std_srvs/srv/Trigger"),
        ("topic", "delay", "/chatter"): (2, "std_msgs/msg/String has no header"),
    }
    assert_reported(run, table)


def test_service_info(run: Run, talker: metaros.Node, told: Reported) -> None:
    talker.create_client(Trigger, "~/reset")
    told("/demo/talker/reset", ends=2)
    lines = run("service", "info", "/demo/talker/reset").out.splitlines()
    assert lines == ["Type: std_srvs/srv/Trigger", "Services count: 1", "Clients count: 1"]
    assert run("service", "info", "/demo/talker/reset", "-v").out.count("/demo/talker\n") == 2
    facts = json.loads(run("service", "info", "/demo/talker/reset", "-o", "json").out)
    assert sorted(item["kind"] for item in facts["endpoints"]) == ["client", "server"]


def test_hidden_names_are_listed_on_request_only(run: Run, talker: metaros.Node, told: Reported) -> None:
    talker.create_service(Trigger, "/walk/_action/odd", lambda request, response: response)
    told("/walk/_action/odd")
    assert "/walk/_action/odd" not in run("service", "list").out
    assert "/walk/_action/odd" in run("service", "list", "--include-hidden-services").out.splitlines()
    shown, everything = (int(run("service", "list", "-c", *more).out) for more in ((), ("--include-hidden-services",)))
    assert everything == shown + 1


def test_topic_delay(zenoh_port: str, talker: metaros.Node, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(listener, "REPORT_S", 0.1)
    publisher = talker.create_publisher(Temperature, "/warmth", 10)

    def publish() -> None:
        message = Temperature()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(talker.clock.wall_ns(), 10**9)
        publisher.publish(message)

    timer = talker.create_timer(0.02, publish)
    with stream_metaros("topic", "delay", "/warmth", "-o", "json", "--zenoh-port", zenoh_port) as lines:
        report = next(found for line in lines if (found := json.loads(line))["window"] > 1)
    assert 0.0 <= report["delay_s"] < 30.0
    with stream_metaros("topic", "delay", "/warmth", "--zenoh-port", zenoh_port) as lines:
        assert "average delay: " in next(lines)
    timer.cancel()
