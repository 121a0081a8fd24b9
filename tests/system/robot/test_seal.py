"""Real agent and gateway: no byte of a sealed topic can be read at the gateway, and the keyring opens its exports.

What is sealed goes every way there is: live, stored, exported, compacted, and as a clip of the black box. Files of both
sides and the gateway's memory are searched for it, as it is and as other programs write it. A clear topic with a marker
of its own goes the same ways and is found: a search that finds nothing then says something.
"""

from __future__ import annotations

import base64
import json
import secrets
import sys
from collections.abc import Collection, Iterator
from pathlib import Path

import pytest
from websockets.sync.client import ClientConnection

import metaros
from metaros.idl import message_class
from metaros.record import open_bag
from tests.support.gateways.viewer import open_socket, records, subscribe
from tests.support.processes.command_line import run_metaros
from tests.support.processes.stack import Stack
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
HIDDEN = ("/r1/secret", "/r1/battery")


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


class Source:
    """A node of r1 with a topic that is sealed, one that is not, and one whose features alone are told."""

    def __init__(self, context: metaros.Context, *, secret: bytes, plain: bytes) -> None:
        node = self._node = metaros.Node("source", namespace="/r1", context=context)
        self._text, self._battery = message_class(TEXT), message_class(BATTERY)
        self._markers = {"secret": secret.decode(), "plain": plain.decode()}
        self._texts = {
            name: node.create_publisher(self._text, name, metaros.qos_reliable_all) for name in self._markers
        }
        self._charge = node.create_publisher(self._battery, "battery", metaros.qos_reliable_all)

    def publish(self) -> bool:
        """One of each."""
        for name, marker in self._markers.items():
            self._texts[name].publish(self._text(data=marker))
        self._charge.publish(self._battery(percentage=CHARGE, location=self._markers["secret"]))
        return True


def received(stack: Stack) -> int:
    """How many of the sealed and of the clear topic the gateway has at least."""
    topics = stack.topics("r1")
    return min(topics.get(f"/r1/{name}", {}).get("received", 0) for name in ("secret", "plain"))


def live(viewer: ClientConnection, topics: Collection[str]) -> dict[str, bytes]:
    """A payload of each of these, as a viewer gets it."""
    seen: dict[str, bytes] = {}
    names: dict[int, str] = {}
    while not seen.keys() >= set(topics):
        frame = viewer.recv(timeout=60)
        if isinstance(frame, str):
            said = json.loads(frame)
            if said["op"] == "channel":
                names[said["channel"]] = said["topic"]
            continue
        seen.update((names[record.channel], record.payload) for record in records(frame))
    return seen


def taken_out(stack: Stack, folder: Path, *, plain: bytes) -> tuple[Path, Path]:
    """All that the gateway gives: a clip of the black box and an export, after it was asked for messages and series."""
    clip, sealed, where = folder / "clip.mcap", folder / "sealed.mcap", ("--gateway", stack.url)
    run_metaros("recording", "save", "r1", "--last", "5m", *where)
    (saved,) = json.loads(run_metaros("recording", "list", "r1", "-o", "json", *where))
    run_metaros("recording", "get", saved["id"], "--file", str(clip), *where)
    assert run_metaros("gateway", "store", "compact", "--data-dir", str(folder / "data"))
    assert "sealed" in run_metaros("history", "messages", "r1", "--topics", "secret", "-o", "json", *where)
    assert plain.decode() in run_metaros("history", "messages", "r1", "--topics", "plain", "-o", "json", *where)
    assert "battery.percentage" in json.dumps(stack.get("/api/v1/robots/r1/metrics"))
    run_metaros("history", "export", str(sealed), "--robot", "r1", "--start", "-10m", *where)
    return clip, sealed


def check_opened(sealed: Path, keyring: Path, *, secret: bytes, plain: bytes) -> None:
    """The key opens everything of an export, under both of its keys."""
    opened = sealed.with_name("opened.mcap")
    keys = ("-k", str(keyring), "--sealed", "**/secret", "-o", "json")
    reported = json.loads(run_metaros("seal", "open", str(sealed), str(opened), *keys))
    kept = payloads(sealed, "/r1/secret")
    assert (reported["opened"], reported["refused"]) == (len(kept) + len(payloads(sealed, "/r1/battery")), [])
    assert len({payload[1:9] for payload in kept}) == 2  # sealed by both keys
    assert all(secret in payload for topic in HIDDEN for payload in payloads(opened, topic))
    assert all(plain in payload for payload in payloads(opened, "/r1/plain"))


@pytest.mark.integration
@pytest.mark.skipif(sys.platform != "linux", reason="reads another process's memory by /proc")
def test_the_gateways_disk_and_memory_hold_nothing_readable_and_the_key_opens_what_it_gives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    secret, plain = (f"{name}-{secrets.token_hex(16)}".encode() for name in ("secret", "plain"))
    hidden = written(secret)
    config, state = tmp_path / "agent.toml", tmp_path / "agent-r1"
    keyring = state / "seal.keys"
    config.write_text(CONFIG)
    state.mkdir()
    run_metaros("seal", "key", "new", str(keyring))
    with Stack(tmp_path) as stack:
        stack.router()
        gateway, agent = stack.at_once(stack.gateway, lambda: stack.agent("r1", "--config", str(config)))
        with (
            metaros.Context(connect=f"tcp/127.0.0.1:{stack.zenoh_port}") as context,
            open_socket(stack.url, "/api/v1/stream", key=stack.key) as viewer,
        ):
            source = Source(context, secret=secret, plain=plain)
            wait_until(lambda: {*HIDDEN, "/r1/plain"} <= stack.topics("r1").keys())
            subscribe(viewer, 1, "r1", "/r1/*")
            wait_until(lambda: source.publish() and received(stack) >= 20)
            seen = live(viewer, {*HIDDEN, "/r1/plain"})
            assert plain in seen["/r1/plain"]
            assert not [topic for topic in HIDDEN if secret in seen[topic]]
            assert {stack.topics("r1")[topic]["encoding"] for topic in HIDDEN} == {"sealed/cdr"}
            run_metaros("seal", "key", "rotate", str(keyring))
            wait_until(lambda: source.publish() and "sealing with key" in agent.output)
            before = stack.topics("r1")["/r1/secret"]["received"]
            wait_until(lambda: source.publish() and received(stack) >= before + 5)
        monkeypatch.setenv("METAROS_KEY", stack.key)
        clip, sealed = taken_out(stack, tmp_path, plain=plain)
        stored = {path.name for path in (tmp_path / "data").rglob("*")}
        assert {"gateway.sqlite", "gateway.sqlite-wal", "gateway.sqlite-shm"} <= stored
        assert found(files(tmp_path / "data"), *hidden, plain) == {plain}
        assert found(memory(gateway.process.pid), *hidden, plain) == {plain}
        assert found(files(state), *hidden, plain) == {plain}  # outbox and black box on the robot's disk
    for topic in HIDDEN:
        for file in (clip, sealed):
            assert payloads(file, topic)
            assert not [payload for payload in payloads(file, topic) if secret in payload]
    assert any(plain in payload for payload in payloads(clip, "/r1/plain"))
    check_opened(sealed, keyring, secret=secret, plain=plain)


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
