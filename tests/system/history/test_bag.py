"""The real simulator, the real recorder, the real player: what is in the file, what is not, what is heard again."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

import metaros
from metaros.record import open_bag, rewrite
from metaros.wire import qos_reliable_all
from tests.support.processes.stack import Stack
from tests.support.waiting import wait_until

WAIT_S = 60.0


def record(stack: Stack, target: Path, *options: str, duration_s: float) -> dict:
    """`metaros bag record --all` for so long, beside what runs; its last line."""
    where = ("--target", str(target), "--duration", str(duration_s), "-o", "json")
    recorder = stack.start("recorder", "bag", "record", "--all", *where, *options)
    wait_until(lambda: recorder.process.poll() is not None, timeout_s=duration_s + WAIT_S)
    assert recorder.process.returncode == 0, recorder.output
    return json.loads(recorder.output.splitlines()[-1])


def numbers(pairs: list[list[int]]) -> set[int]:
    return {number for first, last in pairs for number in range(first, last + 1)}


def check_accounts(folder: Path) -> int:
    """By PyPI's mcap reader alone: each sequence number is in the file or in its account; how many are missing."""
    (file,) = folder.glob("*.mcap")
    sequences: dict[str, list[int]] = defaultdict(list)
    with file.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        for _schema, channel, message in reader.iter_messages():
            sequences[channel.topic].append(message.sequence)
        (gaps,) = [record.metadata for record in reader.iter_metadata() if record.name == "metaros.gaps"]
    accounts: dict[str, list[dict]] = defaultdict(list)
    for key, text in gaps.items():
        accounts[key.split(" ")[0]].append(json.loads(text))
    assert set(sequences) <= set(accounts)
    total = 0
    for topic in accounts:
        found = sequences[topic]  # of a full disk perhaps none
        missing = [numbers(a.get(reason, [])) for a in accounts[topic] for reason in ("lost", "dropped", "disk")]
        total += sum(map(len, missing))
        assert sum(account["received"] for account in accounts[topic]) == len(found)
        span = sum(account["last"] - account["first"] + 1 for account in accounts[topic])
        assert span == len(found) + sum(map(len, missing))
        if len(accounts[topic]) == 1:
            (account,) = accounts[topic]
            assert len(set(found)) == len(found)
            assert set(found) | set().union(*missing) == set(range(account["first"], account["last"] + 1))
    return total


def check_rosbags(folder: Path) -> None:
    """Every topic's first messages are decoded by rosbags from the schemas in the file."""
    decoded: dict[str, int] = defaultdict(int)
    with AnyReader([folder]) as reader:
        for connection, _stamp, raw in reader.messages():
            if decoded[connection.topic] < 3:
                assert reader.deserialize(raw, connection.msgtype) is not None
                decoded[connection.topic] += 1
        assert {connection.topic for connection in reader.connections if connection.msgcount} == set(decoded)


def check_playback(stack: Stack, folder: Path) -> None:
    """`metaros bag play` flat out, heard on a router where nobody else is: the same bytes, in order on every topic."""
    recorded: dict[str, list[bytes]] = defaultdict(list)
    bag = open_bag(folder)
    for message in bag.messages():
        recorded[message.topic.name].append(message.data)
    received: dict[str, list[bytes]] = {name: [] for name in recorded}
    with (
        metaros.Context(connect=f"tcp/127.0.0.1:{stack.zenoh_port}") as context,
        metaros.Node("ears", context=context, enable_rosout=False, enable_parameters=False) as node,
    ):
        for topic in bag.topics:
            sink = received[topic.name]
            node.create_raw_subscription(
                topic.name,
                topic.type_name,
                topic.type_hash,
                qos_reliable_all,
                lambda sample, sink=sink: sink.append(sample.payload.to_bytes()),
            )
        options = ("--rate", "0", "--wait", str(WAIT_S))
        player = stack.start("player", "bag", "play", str(folder), *options, ready=False)
        wait_until(lambda: player.process.poll() is not None, timeout_s=3 * WAIT_S)
        assert player.process.returncode == 0, player.output
        wait_until(lambda: sum(map(len, received.values())) >= bag.message_count, timeout_s=WAIT_S)
    assert received == recorded


@pytest.fixture(scope="module")
def robots(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    """Three simulated robots, who are recorded."""
    with Stack(tmp_path_factory.mktemp("robots")) as stack:
        stack.router()
        stack.sim(robots=3)
        yield stack


@pytest.mark.integration
def test_a_recording_under_load(robots: Stack, tmp_path: Path) -> None:
    summary = record(robots, tmp_path / "run", duration_s=4.0)
    assert summary["messages"] > 80
    total = check_accounts(tmp_path / "run")
    assert total == sum(sum(reasons.values()) for reasons in summary["missing"].values())
    check_rosbags(tmp_path / "run")
    with Stack(tmp_path) as quiet:
        quiet.router_program()
        check_playback(quiet, tmp_path / "run")


@pytest.mark.integration
def test_killed_while_recording(robots: Stack, tmp_path: Path) -> None:
    recorder = robots.start("recorder", "bag", "record", "--all", "--target", str(tmp_path / "run"))
    file = tmp_path / "run" / "run_0.mcap"
    wait_until(lambda: file.stat().st_size > 200_000, timeout_s=WAIT_S)
    recorder.kill()
    bag = open_bag(tmp_path / "run")
    assert "did not close" in bag.files[0].damage
    kept = sum(1 for _ in bag.messages())
    assert kept == bag.message_count > 50
    done = rewrite(bag, tmp_path / "sound.mcap")
    assert done.messages == kept
    with done.path.open("rb") as stream:
        assert sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages()) == kept


def can_mount() -> bool:
    """Whether this machine lets us have a tiny disk of our own."""
    if sys.platform != "linux" or shutil.which("unshare") is None:
        return False
    probe = ["unshare", "-Urm", "sh", "-c", "mount -t tmpfs -o size=64k none /mnt"]
    return subprocess.run(probe, capture_output=True).returncode == 0


@pytest.mark.integration
@pytest.mark.skipif(not can_mount(), reason="needs unshare and tmpfs")
def test_the_disk_is_full(robots: Stack, tmp_path: Path) -> None:
    """A disk of 300 kB: a clear error, a sound file, and the account says what did not fit."""
    disk, out = tmp_path / "disk", tmp_path / "out"
    disk.mkdir(), out.mkdir()
    script = 'mount -t tmpfs -o size=300k none "$1"; d=$1; o=$2; shift 2; "$@"; c=$?; cp -r "$d"/. "$o"; exit $c'
    command = [sys.executable, "-m", "metaros", "bag", "record", "--all", "--target", str(disk / "run")]
    done = subprocess.run(
        ["unshare", "-Urm", "sh", "-c", script, "sh", str(disk), str(out), *command],
        capture_output=True,
        text=True,
        timeout=WAIT_S,
        env={**os.environ, "METAROS_ZENOH_PORT": str(robots.zenoh_port)},
    )
    assert done.returncode == 1, done.stderr
    assert "the disk is full" in done.stderr
    assert "closed and sound" in done.stderr
    assert check_accounts(out / "run") > 0
    assert not open_bag(out / "run").files[0].damage


@pytest.mark.integration
def test_the_last_seconds_on_request(robots: Stack, tmp_path: Path) -> None:
    box = tmp_path / "box"
    recorder = robots.start("recorder", "bag", "record", "--all", "--ring", "30", "--target", str(box))
    where = {**os.environ, "METAROS_ZENOH_PORT": str(robots.zenoh_port)}
    command = [sys.executable, "-m", "metaros", "bag", "save"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=WAIT_S, env=where)
    assert done.stdout.strip() == str(box / "box_0.mcap"), done.stderr
    if sys.platform != "win32":

        def saved_more() -> bool:
            recorder.process.send_signal(signal.SIGUSR1)
            return any(open_bag(file).message_count for file in box.glob("box_?.mcap"))

        wait_until(saved_more, timeout_s=WAIT_S, every_s=0.5)
        wait_until(lambda: "saved " in recorder.output, timeout_s=WAIT_S)
    recorder.process.send_signal(signal.SIGINT)
    recorder.process.wait(WAIT_S)
