"""Real agent and gateway: no byte of a sealed topic can be read at the gateway, and the keyring opens its exports.

A clear topic with a marker of its own goes the same way and is found: a search that finds nothing then says something.
"""

from __future__ import annotations

import json
import os
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

BYTES = "std_msgs/msg/UInt8MultiArray"
CONFIG = """
[[topics]]
match = "/r1/secret"
class = "bulk"
seal = "sealed"

[[topics]]
match = "/r1/plain"
class = "bulk"
"""


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
def test_the_gateways_disk_and_memory_hold_nothing_readable_and_the_key_opens_what_it_gives(tmp_path: Path) -> None:
    secret, plain = os.urandom(32), os.urandom(32)
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
            make = message_class(BYTES)
            publishers = {
                name: node.create_publisher(make, name, metaros.qos_reliable_all) for name in ("secret", "plain")
            }

            def publish() -> bool:
                """One of each."""
                for name, marker in (("secret", secret), ("plain", plain)):
                    publishers[name].publish(make(data=list(marker)))
                return True

            def received(count: int) -> bool:
                topics = stack.topics("r1")
                return all(topics.get(f"/r1/{n}", {}).get("received", 0) >= count for n in ("secret", "plain"))

            wait_until(lambda: {"/r1/secret", "/r1/plain"} <= stack.topics("r1").keys())
            subscribe(viewer, 1, "r1", "/r1/*")
            wait_until(lambda: publish() and received(20))
            seen: dict[str, bytes] = {}
            names: dict[int, str] = {}
            while seen.keys() != {"/r1/secret", "/r1/plain"}:
                frame = viewer.recv(timeout=60)
                if isinstance(frame, str):
                    said = json.loads(frame)
                    if said["op"] == "channel":
                        names[said["channel"]] = said["topic"]
                    continue
                seen.update((names[record.channel], record.payload) for record in records(frame))
            assert plain in seen["/r1/plain"]
            assert secret not in seen["/r1/secret"]
            assert stack.topics("r1")["/r1/secret"]["encoding"] == "sealed/cdr"
            run("seal", "key", "rotate", str(state / "seal.keys"))
            wait_until(lambda: publish() and "sealing with key" in agent.output)
            before = stack.topics("r1")["/r1/secret"]["received"]
            wait_until(lambda: publish() and received(before + 5))
        assert found(files(tmp_path / "data"), secret, plain) == {plain}
        assert found(memory(gateway.process.pid), secret, plain) == {plain}
        shown = run("history", "messages", "r1", "--topics", "secret", "-o", "json", "--gateway", stack.url)
        assert "sealed" in shown
        sealed = tmp_path / "sealed.mcap"
        run("history", "export", str(sealed), "--robot", "r1", "--start", "-10m", "--gateway", stack.url)
    opened = tmp_path / "opened.mcap"
    told = json.loads(run("seal", "open", str(sealed), str(opened), "-k", str(state / "seal.keys"), "-o", "json"))
    kept = payloads(sealed, "/r1/secret")
    assert (told["opened"], told["refused"]) == (len(kept), [])
    assert not any(secret in payload for payload in kept)
    assert len({payload[1:9] for payload in kept}) == 2  # sealed by both keys
    assert all(secret in payload for payload in payloads(opened, "/r1/secret"))
    assert all(plain in payload for payload in payloads(opened, "/r1/plain"))
