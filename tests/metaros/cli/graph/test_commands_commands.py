"""topic, node and service against a real node on a real router."""

from __future__ import annotations

import json
import signal

import pytest

import metaros
from metaros.cli.graph_target import listener
from metaros.interfaces.std_msgs.msg import Float64, String
from tests.metaros.cli.conftest import Reported, Run
from tests.support.processes.command_line import program, stream_metaros
from tests.support.processes.processes import END_S, started
from tests.support.waiting import wait_until

pytestmark = pytest.mark.usefixtures("talker")


def test_topic_list(run: Run) -> None:
    assert "/chatter" in run("topic", "list").out.splitlines()
    assert "/chatter [std_msgs/msg/String]" in run("topic", "list", "-t").out.splitlines()
    rows = json.loads(run("topic", "list", "-o", "json").out)
    (row,) = (row for row in rows if row["topic"] == "/chatter")
    assert row == {"topic": "/chatter", "types": ["std_msgs/msg/String"], "publishers": 1, "subscribers": 0}
    assert int(run("topic", "list", "-c").out) == len(rows)


def test_topic_info(run: Run) -> None:
    done = run("topic", "info", "chatter", "-v")
    assert "Type: std_msgs/msg/String" in done.out
    assert "Publisher count: 1" in done.out
    assert "/demo/talker" in done.out
    assert "RELIABLE, VOLATILE, KEEP_LAST (10)" in done.out
    facts = json.loads(run("topic", "info", "/chatter", "-o", "json").out)
    assert facts["endpoints"][0]["type_hash"].startswith("RIHS01_df668c74")


def test_an_unknown_topic_gets_a_hint(run: Run) -> None:
    for verb in ("info", "echo", "hz"):
        done = run("topic", verb, "/chater", "--spin-time", "0.3")
        assert done.code == 1
        assert "no topic '/chater'" in done.err
        assert "did you mean /chatter?" in done.err


def test_echo(run: Run) -> None:
    done = run("topic", "echo", "/chatter", "--once")
    assert done.code == 0
    assert done.out.startswith("data: hello ")
    assert done.out.endswith("---\n")
    lines = run("topic", "echo", "/chatter", "-n", "3", "-o", "json").out.splitlines()
    numbers = [int(json.loads(line)["data"].split()[1]) for line in lines]
    assert numbers == list(range(numbers[0], numbers[0] + 3))
    assert run("topic", "echo", "/chatter", "--once", "--field", "data").out.startswith("hello ")


def test_echo_raw_is_cdr(run: Run) -> None:
    payload = bytes.fromhex(run("topic", "echo", "/chatter", "--once", "--raw").out)
    assert payload[:4] == b"\x00\x01\x00\x00"
    assert b"hello" in payload


def test_echo_of_a_field_that_is_not_there(run: Run) -> None:
    done = run("topic", "echo", "/chatter", "--once", "--field", "date")
    assert done.code == 2
    assert "no field 'date'" in done.err
    assert "data" in done.err


def test_echo_gives_up_when_silent(run: Run) -> None:
    done = run("topic", "echo", "/nobody", "std_msgs/String", "--timeout", "0.1", "--spin-time", "0.05")
    assert done.code == 1
    assert "no message on /nobody within 0.1 s" in done.err


def test_hz_and_bw(zenoh_port: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(listener, "REPORT_S", 0.1)
    with stream_metaros("topic", "hz", "/chatter", "-o", "json", "--zenoh-port", zenoh_port) as lines:
        # Not of two samples, which a busy machine may have bunched.
        report = next(found for line in lines if (found := json.loads(line))["window"] > 20)
    assert 0 < report["rate_hz"] < 60
    with stream_metaros("topic", "bw", "/chatter", "-o", "json", "--zenoh-port", zenoh_port) as lines:
        report = next(found for line in lines if (found := json.loads(line))["window"] > 1)
    assert 10 < report["mean_bytes"] < 40


def test_hz_and_bw_in_words_for_so_many_reports(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(listener, "REPORT_S", 0.3)
    for verb, words in (("hz", "average rate: "), ("bw", "B/s from")):
        done = run("topic", verb, "/chatter", "-n", "2")
        assert sum(words in line for line in done.out.splitlines()) + done.err.count("no new messages") == 2
        assert words in done.out


def test_pub_once_is_received(run: Run, talker: metaros.Node) -> None:
    received: list[str] = []
    talker.create_subscription(String, "/said", lambda message: received.append(message.data), 10)
    done = run("topic", "pub", "said", "std_msgs/String", "data: hi", "--once", "--max-wait-time-secs", "60")
    assert (done.code, done.out) == (0, "publishing #1: std_msgs.msg.String(data='hi')\n")
    wait_until(lambda: received == ["hi"])


def test_pub_at_a_rate(run: Run, talker: metaros.Node) -> None:
    received: list[float] = []
    talker.create_subscription(Float64, "/value", lambda message: received.append(message.data), 20)
    rate = ("-r", "200", "-n", "20", "-q", "--max-wait-time-secs", "60")
    done = run("topic", "pub", "/value", "std_msgs/msg/Float64", "{data: 1.5}", *rate)
    assert (done.code, done.out) == (0, "")
    wait_until(lambda: received == [1.5] * 20)


def test_pub_of_what_cannot_be_names_the_fault(run: Run) -> None:
    table = {
        ("/said", "std_msgs/String", "{date: x}"): "date",
        ("/said", "std_msgs/UInt8", "{data: 300}"): "data",
        ("/said", "std_msgs/Strin", "{}"): "std_msgs/msg/String",
        ("/said", "std_msgs/String", "hello"): "example",
        ("/a b", "std_msgs/String", "{}"): "'/a b'",
    }
    told = {case: run("topic", "pub", *case, "--once") for case in table}
    assert {case: done for case, done in told.items() if done.code != 2 or table[case] not in done.err} == {}
    assert [done.err for done in told.values() if "Traceback" in done.err] == []


def test_node_list_and_info(run: Run) -> None:
    assert "/demo/talker" in run("node", "list").out.splitlines()
    lines = [line.strip() for line in run("node", "info", "/demo/talker").out.splitlines()]
    assert "/chatter: std_msgs/msg/String" in lines
    assert "/demo/talker/reset: std_srvs/srv/Trigger" in lines
    facts = json.loads(run("node", "info", "/demo/talker", "-o", "json").out)
    assert {"name": "/demo/talker/reset", "type": "std_srvs/srv/Trigger"} in facts["service_servers"]
    done = run("node", "info", "/talker")
    assert done.code == 1
    assert "did you mean /demo/talker?" in done.err


def test_service_list_and_call(run: Run) -> None:
    assert "/demo/talker/reset [std_srvs/srv/Trigger]" in run("service", "list", "-t").out.splitlines()
    done = run("service", "call", "/demo/talker/reset", "-o", "json")
    assert json.loads(done.out) == {"success": True, "message": "done"}
    assert run("service", "call", "/demo/talker/reset", "std_srvs/Trigger", "{}").out == (
        "success: true\nmessage: done\n"
    )


def test_a_call_that_nobody_serves(run: Run) -> None:
    done = run("service", "call", "/demo/talker/rest")
    assert done.code == 1
    assert "did you mean /demo/talker/reset?" in done.err
    done = run("service", "call", "/demo/talker/reset", "std_srvs/Empty")
    assert done.code == 2
    assert "std_srvs/srv/Trigger" in done.err


def test_another_hash_is_refused_with_both(run: Run, talker: metaros.Node) -> None:
    foreign = "RIHS01_" + "ab" * 32
    talker.create_raw_publisher("/other", "std_msgs/msg/String", foreign, metaros.qos_default)
    done = run("topic", "echo", "/other", "--once")
    assert done.code == 1
    assert foreign in done.err
    assert "--raw" in done.err


def test_an_unknown_type_is_refused_but_listed(run: Run, talker: metaros.Node, told: Reported) -> None:
    talker.create_raw_publisher("/odd", "acme_msgs/msg/Thing", "RIHS01_" + "cd" * 32, metaros.qos_default)
    told("/odd")
    assert "/odd [acme_msgs/msg/Thing]" in run("topic", "list", "-t").out.splitlines()
    done = run("topic", "echo", "/odd", "--once")
    assert done.code == 2
    assert "acme_msgs/msg/Thing" in done.err


def test_ctrl_c_ends_a_stream_without_a_traceback(zenoh_port: str) -> None:
    with started(program("topic", "echo", "/chatter", "--zenoh-port", zenoh_port)) as echo:
        assert echo.stdout is not None
        echo.stdout.readline()
        echo.send_signal(signal.SIGINT)
        _, err = echo.communicate(timeout=END_S)
    assert echo.returncode == 130
    assert "Traceback" not in err


def test_a_closed_pipe_ends_a_stream_without_a_word(zenoh_port: str) -> None:
    with stream_metaros("topic", "echo", "/chatter", "--zenoh-port", zenoh_port) as lines:
        assert next(lines).startswith("data: ")


@pytest.mark.parametrize("noun", ["node", "service"])
def test_as_a_process(zenoh_port: str, noun: str) -> None:
    with started(program(noun, "list", "--zenoh-port", zenoh_port)) as process:
        out, err = process.communicate(timeout=END_S)
    assert ("/demo/talker" in out, err, process.returncode) == (True, "", 0)
