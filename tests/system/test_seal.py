"""Real agent and gateway: no byte of a sealed topic can be read at the gateway, and the keyring opens its exports.

What is sealed goes every way there is: live, stored, exported, compacted, and as a clip of the black box. Files of both
sides and the gateway's memory are searched for it, as it is and as other programs write it. A clear topic with a marker
of its own goes the same ways and is found: a search that finds nothing then says something.
"""

from __future__ import annotations

import base64
import json
import os
import secrets
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import metaros
from metaros.idl import message_class
from metaros.record import open_bag
from tests.support.stack import Stack
from tests.support.viewer import open_socket, records, subscribe
from tests.support.waiting import wait_until

TEXT, BATTERY = "std_msgs/msg/String", "sensor_msgs/msg/BatteryState"
CONFIG = """
[[topics]]
match = "/r1/secret"
class = "bulk"
seal = "sealed"

[[topics]]
match = "/r1/battery"
class = "bulk"
seal = "features"
fields = ["percentage"]

[[topics]]
match = "/r1/plain"
class = "bulk"
"""
CHARGE = 0.625


def run(*arguments: str) -> str:
    """Run the command line to its end; what it printed."""
    done = subprocess.run(
        [sys.executable, "-m", "metaros", *arguments],
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, "NO_COLOR": "1"},
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def memory(pid: int) -> Iterator[bytes]:
    """What a process can read of its own memory, region by region, a little of the one before in front."""
    regions = Path(f"/proc/{pid}/maps").read_text().splitlines()
    with Path(f"/proc/{pid}/mem").open("rb", buffering=0) as file:
        for region in regions:
            span, mode = region.split()[:2]
            begin, end = (int(text, 16) for text in span.split("-"))
            if "r" not in mode:
                continue
            for at in range(begin, end, 16 << 20):
                try:
                    file.seek(max(begin, at - 64))
                    yield file.read(min(end, at + (16 << 20)) - max(begin, at - 64))
                except (OSError, ValueError, OverflowError):  # of the kernel's own
                    break


def written(marker: bytes) -> set[bytes]:
    """A marker as programs write it: as it is, in UTF-16, in hexadecimal, as JSON's numbers, and in base64 wherever in
    the three-byte groups it may begin.
    """
    text = marker.decode()
    forms = {marker, text.encode("utf-16-le"), text.encode("utf-16-be")}
    forms |= {marker.hex().encode(), marker.hex().upper().encode()}
    forms |= {separator.join(map(str, marker)).encode() for separator in (",", ", ")}
    forms |= {"".join(f"\\u{ord(letter):04x}" for letter in text).encode()}
    for before in range(3):
        whole = base64.b64encode(b"\0" * before + marker)
        forms.add(whole[4 if before else 0 : -4])  # without the groups that it shares with others
    return forms


def found(pieces: Iterator[bytes], *markers: bytes) -> set[bytes]:
    """Those of the markers that are somewhere in it."""
    hits: set[bytes] = set()
    for piece in pieces:
        hits.update(marker for marker in markers if marker in piece)
    return hits


def files(folder: Path) -> Iterator[bytes]:
    """Every file below a folder."""
    return (path.read_bytes() for path in folder.rglob("*") if path.is_file())


def payloads(path: Path, topic: str) -> list[bytes]:
    """What a recording has of a topic."""
    return [message.data for message in open_bag(path).messages([topic])]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads another process's memory by /proc")
def test_the_gateways_disk_and_memory_hold_nothing_readable_and_the_key_opens_what_it_gives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    secret, plain = (f"{name}-{secrets.token_hex(16)}".encode() for name in ("secret", "plain"))
    hidden = written(secret)
    config, state = tmp_path / "agent.toml", tmp_path / "agent-r1"
    config.write_text(CONFIG)
    state.mkdir()
    run("seal", "key", "new", str(state / "seal.keys"))
    with Stack(tmp_path) as stack:
        stack.router()
        gateway = stack.gateway()
        agent = stack.agent("r1", "--config", str(config))
        with (
            metaros.Context(connect=f"tcp/127.0.0.1:{stack.zenoh_port}") as context,
            open_socket(stack.url, "/api/v1/stream", key=stack.key) as viewer,
        ):
            node = metaros.Node("source", namespace="/r1", context=context)
            make, battery = message_class(TEXT), message_class(BATTERY)
            publishers = {
                name: node.create_publisher(make, name, metaros.qos_reliable_all) for name in ("secret", "plain")
            }
            charge = node.create_publisher(battery, "battery", metaros.qos_reliable_all)

            def publish() -> bool:
                """One of each."""
                for name, marker in (("secret", secret), ("plain", plain)):
                    publishers[name].publish(make(data=marker.decode()))
                charge.publish(battery(percentage=CHARGE, location=secret.decode()))
                return True

            def received(count: int) -> bool:
                topics = stack.topics("r1")
                return all(topics.get(f"/r1/{n}", {}).get("received", 0) >= count for n in ("secret", "plain"))

            wait_until(lambda: {"/r1/secret", "/r1/plain", "/r1/battery"} <= stack.topics("r1").keys())
            subscribe(viewer, 1, "r1", "/r1/*")
            wait_until(lambda: publish() and received(20))
            seen: dict[str, bytes] = {}
            names: dict[int, str] = {}
            while not {"/r1/secret", "/r1/plain", "/r1/battery"} <= seen.keys():
                frame = viewer.recv(timeout=60)
                if isinstance(frame, str):
                    said = json.loads(frame)
                    if said["op"] == "channel":
                        names[said["channel"]] = said["topic"]
                    continue
                seen.update((names[record.channel], record.payload) for record in records(frame))
            assert plain in seen["/r1/plain"]
            assert not [topic for topic in ("/r1/secret", "/r1/battery") if secret in seen[topic]]
            encodings = {topic: facts["encoding"] for topic, facts in stack.topics("r1").items()}
            assert (encodings["/r1/secret"], encodings["/r1/battery"]) == ("sealed/cdr", "sealed/cdr")
            run("seal", "key", "rotate", str(state / "seal.keys"))
            wait_until(lambda: publish() and "sealing with key" in agent.output)
            before = stack.topics("r1")["/r1/secret"]["received"]
            wait_until(lambda: publish() and received(before + 5))
        monkeypatch.setenv("METAROS_KEY", stack.key)
        where = ("--gateway", stack.url)
        run("recording", "save", "r1", "--last", "5m", *where)
        clip = tmp_path / "clip.mcap"
        (saved,) = json.loads(run("recording", "list", "r1", "-o", "json", *where))
        run("recording", "get", saved["id"], "--file", str(clip), *where)
        assert run("gateway", "store", "compact", "--data-dir", str(tmp_path / "data"))
        shown = run("history", "messages", "r1", "--topics", "secret", "-o", "json", *where)
        assert "sealed" in shown
        assert plain.decode() in run("history", "messages", "r1", "--topics", "plain", "-o", "json", *where)
        series = stack.get("/api/v1/robots/r1/metrics")
        assert "battery.percentage" in json.dumps(series)
        sealed = tmp_path / "sealed.mcap"
        run("history", "export", str(sealed), "--robot", "r1", "--start", "-10m", *where)
        stored = {path.name for path in (tmp_path / "data").rglob("*")}
        assert {"gateway.sqlite", "gateway.sqlite-wal", "gateway.sqlite-shm"} <= stored
        assert found(files(tmp_path / "data"), *hidden, plain) == {plain}
        assert found(memory(gateway.process.pid), *hidden, plain) == {plain}
        assert found(files(state), *hidden, plain) == {plain}  # outbox and black box on the robot's disk
    for topic in ("/r1/secret", "/r1/battery"):
        for file in (clip, sealed):
            assert payloads(file, topic)
            assert not [payload for payload in payloads(file, topic) if secret in payload]
    assert any(plain in payload for payload in payloads(clip, "/r1/plain"))
    opened = tmp_path / "opened.mcap"
    keys = ("-k", str(state / "seal.keys"), "--sealed", "**/secret", "-o", "json")
    told = json.loads(run("seal", "open", str(sealed), str(opened), *keys))
    kept = payloads(sealed, "/r1/secret")
    assert (told["opened"], told["refused"]) == (len(kept) + len(payloads(sealed, "/r1/battery")), [])
    assert len({payload[1:9] for payload in kept}) == 2  # sealed by both keys
    assert all(secret in payload for topic in ("/r1/secret", "/r1/battery") for payload in payloads(opened, topic))
    assert all(plain in payload for payload in payloads(opened, "/r1/plain"))


def test_the_search_knows_a_marker_however_it_is_written() -> None:
    marker = b"secret-0123456789abcdef"
    text = marker.decode()
    for form in (
        b"\0\1" + marker + b"\2",
        text.encode("utf-16-le"),
        text.encode("utf-16-be"),
        marker.hex().encode(),
        json.dumps(list(marker)).encode(),
        json.dumps(list(marker), separators=(",", ":")).encode(),
        *(base64.b64encode(b"x" * before + marker + b"y" * after) for before in range(5) for after in range(5)),
    ):
        assert found(iter([form]), *written(marker)), form
    assert not found(iter([b"secret-0123456789abcdeF", base64.b64encode(b"nothing of it")]), *written(marker))
