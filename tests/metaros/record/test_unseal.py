"""Sealed recordings become readable ones; what was tampered with is left out and told."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from metaros.clock import ManualClock
from metaros.mcap import McapFile
from metaros.record import open_bag
from metaros.record.unseal import Unsealed, unseal
from metaros.seal import SEALED_CDR, Keyring, Origin, Sealer, SealKey

TYPE, HASH = "std_msgs/msg/String", "RIHS01_00"
RING = Keyring((SealKey.make(ManualClock()),))
Frame = tuple[int, bytes]  # sequence and payload


def origin(topic: str, robot: str = "r1") -> Origin:
    return Origin(robot=robot, topic=topic, type_name=TYPE, type_hash=HASH)


def frames(topic: str, count: int, *, robot: str = "r1") -> list[Frame]:
    sealer = Sealer(RING, ManualClock())
    return [
        (seq, sealer.seal(b"%s %d" % (topic.encode(), seq), origin(topic, robot), stream=1, epoch=1, seq=seq))
        for seq in range(1, count + 1)
    ]


def write(path: Path, channels: dict[str, list[Frame]], *, metadata: Callable[[str], dict[str, str]]) -> None:
    """A recording with these sealed channels, by their names in the file, and a clear one."""
    with path.open("xb", buffering=0) as stream:
        file: McapFile[None] = McapFile(stream)
        schema = file.add_schema(TYPE, b"string data")
        clear = file.add_channel("/clear", schema, {"type_hash": HASH})
        file.write(clear, 1, 1, 1, b"readable", None)
        for name, found in channels.items():
            number = file.add_channel(name, schema, {"type_hash": HASH, **metadata(name)}, encoding=SEALED_CDR)
            for place, (seq, payload) in enumerate(found):
                file.write(number, 10 + place, 10 + place, seq, payload, None)
        file.finish(list, lambda notes: None)


def opened(tmp_path: Path, channels: dict[str, list[Frame]], ring: Keyring = RING, **more: str) -> Unsealed:
    write(tmp_path / "in.mcap", channels, metadata=lambda name: {"robot": "r1", "topic": name.removeprefix("/r1")})
    return unseal(open_bag(tmp_path / "in.mcap"), tmp_path / "out.mcap", ring, **more)


def read(tmp_path: Path) -> list[tuple[str, str, int, bytes]]:
    found = open_bag(tmp_path / "out.mcap").messages()
    return [(item.topic.name, item.topic.encoding, item.sequence, item.data) for item in found]


def test_a_sealed_recording_becomes_readable_and_the_rest_is_copied(tmp_path: Path) -> None:
    done = opened(tmp_path, {"/a": frames("/a", 3), "/r1/b": frames("/b", 1)})
    assert (done.opened, done.refused, done.file.messages) == (4, {}, 5)
    assert sorted(read(tmp_path)) == [
        ("/a", "cdr", 1, b"/a 1"),
        ("/a", "cdr", 2, b"/a 2"),
        ("/a", "cdr", 3, b"/a 3"),
        ("/clear", "cdr", 1, b"readable"),
        ("/r1/b", "cdr", 1, b"/b 1"),
    ]


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda good: [(1, good[0][1][:-1] + bytes([good[0][1][-1] ^ 1])), *good[1:]], "seal_broken"),
        (lambda good: [*good, good[0]], "seal_replayed"),
        (lambda good: [(9, good[0][1]), *good[1:]], "seal_broken"),
        (lambda good: [(1, b"short"), *good[1:]], "malformed_seal"),
        (lambda good: [frames("/b", 1)[0], *good[1:]], "seal_broken"),
        (lambda good: [frames("/a", 1, robot="r2")[0], *good[1:]], "seal_broken"),
    ],
    ids=["changed", "replayed", "renumbered", "short", "other topic", "other robot"],
)
def test_what_was_tampered_with_is_left_out_and_reported(
    tmp_path: Path, change: Callable[[list[Frame]], list[Frame]], code: str
) -> None:
    good = frames("/a", 3)
    found = change(good)
    done = opened(tmp_path, {"/a": found})
    assert done.refused == {("/a", code): 1}
    assert done.opened == len(found) - 1
    assert {data for topic, _, _, data in read(tmp_path) if topic == "/a"} <= {b"/a 1", b"/a 2", b"/a 3"}


def test_a_channel_renamed_in_the_file_does_not_open_even_when_it_names_its_origin(tmp_path: Path) -> None:
    write(tmp_path / "in.mcap", {"/brakes": frames("/a", 2)}, metadata=lambda _: {"robot": "r1", "topic": "/a"})
    done = unseal(open_bag(tmp_path / "in.mcap"), tmp_path / "out.mcap", RING)
    assert (done.opened, done.refused) == (0, {("/brakes", "seal_broken"): 2})


def test_another_keyring_and_another_robot_open_nothing(tmp_path: Path) -> None:
    done = opened(tmp_path, {"/a": frames("/a", 2)}, Keyring((SealKey.make(ManualClock()),)))
    assert done.refused == {("/a", "seal_key_unknown"): 2}
    (tmp_path / "out.mcap").unlink()
    done = unseal(open_bag(tmp_path / "in.mcap"), tmp_path / "out.mcap", RING, robot="r2")
    assert done.refused == {("/a", "seal_broken"): 2}


def test_sealed_and_clear_messages_of_one_topic_are_kept_apart(tmp_path: Path) -> None:
    done = opened(tmp_path, {"/clear": frames("/clear", 1)})
    assert (done.opened, done.refused) == (1, {})
    assert sorted(data for _, _, _, data in read(tmp_path)) == [b"/clear 1", b"readable"]


@pytest.mark.parametrize(
    ("patterns", "refused"), [((), {}), (("/cle*",), {("/clear", "not_sealed"): 1}), (("/a",), {})]
)
def test_a_topic_that_must_be_sealed_and_is_not_is_refused(
    tmp_path: Path, patterns: tuple[str, ...], refused: dict[tuple[str, str], int]
) -> None:
    write(tmp_path / "in.mcap", {"/a": frames("/a", 2)}, metadata=lambda _: {"robot": "r1", "topic": "/a"})
    done = unseal(open_bag(tmp_path / "in.mcap"), tmp_path / "out.mcap", RING, sealed=patterns)
    assert (done.opened, done.refused) == (2, refused)
    assert (b"readable" in [item[3] for item in read(tmp_path)]) is (not refused)
