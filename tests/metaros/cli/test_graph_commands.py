"""topic, node and service against a real node on a real router."""

from __future__ import annotations

import json
import signal
import sys

import pytest

import metaros
from metaros.interfaces.std_msgs.msg import Float64, String
from tests.metaros.cli.conftest import Run
from tests.support.processes import END_S, started
from tests.support.waiting import wait_until

pytestmark = pytest.mark.usefixtures("talker")


def test_topic_list(run_process: Run) -> None:
    assert "/chatter" in run_process("topic", "list").stdout.splitlines()
    assert "/chatter [std_msgs/msg/String]" in run_process("topic", "list", "-t").stdout.splitlines()
    rows = json.loads(run_process("topic", "list", "-o", "json").stdout)
    (row,) = (row for row in rows if row["topic"] == "/chatter")
    assert row == {"topic": "/chatter", "types": ["std_msgs/msg/String"], "publishers": 1, "subscribers": 0}
    assert int(run_process("topic", "list", "-c").stdout) == len(rows)


def test_topic_info(run: Run) -> None:
    done = run("topic", "info", "chatter", "-v")
    assert "Type: std_msgs/msg/String" in done.stdout
    assert "Publisher count: 1" in done.stdout
    assert "/demo/talker" in done.stdout
    assert "RELIABLE, VOLATILE, KEEP_LAST (10)" in done.stdout
    facts = json.loads(run("topic", "info", "/chatter", "-o", "json").stdout)
    assert facts["endpoints"][0]["type_hash"].startswith("RIHS01_df668c74")


def test_an_unknown_topic_gets_a_hint(run: Run) -> None:
    for verb in ("info", "echo", "hz"):
        done = run("topic", verb, "/chater", "--spin-time", "0.5")
        assert done.returncode == 1
        assert "no topic '/chater'" in done.stderr
        assert "did you mean /chatter?" in done.stderr


def test_echo(run_process: Run) -> None:
    done = run_process("topic", "echo", "/chatter", "--once")
    assert done.returncode == 0
    assert done.stdout.startswith("data: hello ")
    assert done.stdout.endswith("---\n")


def test_echo_json_lines_and_a_field(run: Run) -> None:
    lines = run("topic", "echo", "/chatter", "-n", "3", "-o", "json").stdout.splitlines()
    numbers = [int(json.loads(line)["data"].split()[1]) for line in lines]
    assert numbers == list(range(numbers[0], numbers[0] + 3))
    assert run("topic", "echo", "/chatter", "--once", "--field", "data").stdout.startswith("hello ")


def test_echo_raw_is_cdr(run: Run) -> None:
    payload = bytes.fromhex(run("topic", "echo", "/chatter", "--once", "--raw").stdout)
    assert payload[:4] == b"\x00\x01\x00\x00"
    assert b"hello" in payload


def test_echo_of_a_field_that_is_not_there(run: Run) -> None:
    done = run("topic", "echo", "/chatter", "--once", "--field", "date")
    assert done.returncode == 2
    assert "no field 'date'" in done.stderr
    assert "data" in done.stderr


def test_echo_gives_up_when_silent(run: Run) -> None:
    done = run("topic", "echo", "/nobody", "std_msgs/String", "--timeout", "0.3", "--spin-time", "0.1")
    assert done.returncode == 1
    assert "no message on /nobody within 0.3 s" in done.stderr


def test_hz_and_bw(run: Run) -> None:
    report = json.loads(run("topic", "hz", "/chatter", "-n", "1", "-o", "json").stdout)
    assert 0 < report["rate_hz"] < 60
    assert "average rate: " in run("topic", "hz", "/chatter", "-n", "1").stdout
    report = json.loads(run("topic", "bw", "/chatter", "-n", "1", "-o", "json").stdout)
    assert 10 < report["mean_bytes"] < 40
    assert "B/s from" in run("topic", "bw", "/chatter", "-n", "1").stdout


def test_pub_once_is_heard(run_process: Run, talker: metaros.Node) -> None:
    heard: list[str] = []
    talker.create_subscription(String, "/said", lambda message: heard.append(message.data), 10)
    done = run_process("topic", "pub", "said", "std_msgs/String", "data: hi", "--once")
    assert done.returncode == 0, done.stderr
    assert done.stdout == "publishing #1: std_msgs.msg.String(data='hi')\n"
    wait_until(lambda: heard == ["hi"])


def test_pub_at_a_rate(run: Run, talker: metaros.Node) -> None:
    heard: list[float] = []
    talker.create_subscription(Float64, "/value", lambda message: heard.append(message.data), 10)
    done = run("topic", "pub", "/value", "std_msgs/msg/Float64", "{data: 1.5}", "-r", "100", "-n", "20", "-q")
    assert (done.returncode, done.stdout) == (0, "")
    wait_until(lambda: heard == [1.5] * 20)


@pytest.mark.parametrize(
    ("type_name", "values", "word"),
    [
        ("std_msgs/String", "{date: x}", "date"),
        ("std_msgs/UInt8", "{data: 300}", "data"),
        ("std_msgs/Strin", "{}", "std_msgs/msg/String"),
        ("std_msgs/String", "hello", "example"),
    ],
)
def test_pub_of_what_cannot_be_names_the_fault(run: Run, type_name: str, values: str, word: str) -> None:
    done = run("topic", "pub", "/said", type_name, values, "--once")
    assert done.returncode == 2
    assert word in done.stderr
    assert "Traceback" not in done.stderr


def test_pub_to_an_impossible_name(run: Run) -> None:
    done = run("topic", "pub", "/a b", "std_msgs/String", "{}", "--once")
    assert done.returncode == 2
    assert "'/a b'" in done.stderr


def test_node_list_and_info(run: Run) -> None:
    assert "/demo/talker" in run("node", "list").stdout.splitlines()
    lines = [line.strip() for line in run("node", "info", "/demo/talker").stdout.splitlines()]
    assert "/chatter: std_msgs/msg/String" in lines
    assert "/demo/talker/reset: std_srvs/srv/Trigger" in lines
    facts = json.loads(run("node", "info", "/demo/talker", "-o", "json").stdout)
    assert {"name": "/demo/talker/reset", "type": "std_srvs/srv/Trigger"} in facts["service_servers"]
    done = run("node", "info", "/talker")
    assert done.returncode == 1
    assert "did you mean /demo/talker?" in done.stderr


def test_service_list_and_call(run: Run) -> None:
    assert "/demo/talker/reset [std_srvs/srv/Trigger]" in run("service", "list", "-t").stdout.splitlines()
    done = run("service", "call", "/demo/talker/reset", "-o", "json")
    assert json.loads(done.stdout) == {"success": True, "message": "done"}
    assert run("service", "call", "/demo/talker/reset", "std_srvs/Trigger", "{}").stdout == (
        "success: true\nmessage: done\n"
    )


def test_a_call_that_nobody_serves(run: Run) -> None:
    done = run("service", "call", "/demo/talker/rest")
    assert done.returncode == 1
    assert "did you mean /demo/talker/reset?" in done.stderr
    done = run("service", "call", "/demo/talker/reset", "std_srvs/Empty")
    assert done.returncode == 2
    assert "std_srvs/srv/Trigger" in done.stderr


def test_another_hash_is_refused_with_both(run: Run, talker: metaros.Node) -> None:
    foreign = "RIHS01_" + "ab" * 32
    talker.create_raw_publisher("/other", "std_msgs/msg/String", foreign, metaros.qos_default)
    done = run("topic", "echo", "/other", "--once")
    assert done.returncode == 1
    assert foreign in done.stderr
    assert "--raw" in done.stderr


def test_an_unknown_type_is_refused_but_listed(run: Run, talker: metaros.Node) -> None:
    talker.create_raw_publisher("/odd", "acme_msgs/msg/Thing", "RIHS01_" + "cd" * 32, metaros.qos_default)
    assert "/odd [acme_msgs/msg/Thing]" in run("topic", "list", "-t").stdout.splitlines()
    done = run("topic", "echo", "/odd", "--once")
    assert done.returncode == 2
    assert "acme_msgs/msg/Thing" in done.stderr


def test_ctrl_c_ends_a_stream_without_a_traceback(zenoh_router: str) -> None:
    port = zenoh_router.rsplit(":", 1)[1]
    command = [sys.executable, "-m", "metaros", "topic", "echo", "/chatter", "--zenoh-port", port]
    with started(command) as echo:
        assert echo.stdout is not None
        echo.stdout.readline()
        echo.send_signal(signal.SIGINT)
        _, err = echo.communicate(timeout=END_S)
    assert echo.returncode == 130
    assert "Traceback" not in err


def test_a_closed_pipe_ends_a_stream_without_a_traceback(zenoh_router: str) -> None:
    port = zenoh_router.rsplit(":", 1)[1]
    command = [sys.executable, "-m", "metaros", "topic", "echo", "/chatter", "--zenoh-port", port]
    with started(command) as echo:
        assert echo.stdout is not None
        assert echo.stderr is not None
        echo.stdout.readline()
        echo.stdout.close()
        assert echo.wait(END_S) in (0, 1)
        assert echo.stderr.read() == ""
