"""Fragments in both directions, however they are cut, and pictures of JSON."""

from __future__ import annotations

import base64
import io
import json
import random  # noqa: TID251 - seeded
from dataclasses import replace
from typing import Any

import pytest
from PIL import Image

from gateway.api.rosbridge.encodings import encoding_of
from gateway.api.rosbridge.fragmentation import Assembler, fragments, png_message
from gateway.api.rosbridge.protocol import shaped
from gateway.api.rosbridge.requests import Shape
from gateway.domain.channel import Channel
from gateway.domain.records import Record
from gateway.errors import BodyTooLargeError, InvalidRequestError
from gateway.live.encoding import view_of
from metaros.cdr import codec
from metaros.idl import schema_text, type_hash
from metaros.interfaces.std_msgs.msg import String
from metaros.limits import LIMITS

SEEDS = range(30)
ALPHABET = 'abc {}[]":,\\é漢🤖\n\t0123'


def random_message(rng: random.Random, name: str) -> dict[str, Any]:
    text = "".join(rng.choice(ALPHABET) for _ in range(rng.randrange(300)))
    return {"op": "publish", "id": name, "topic": "/chat", "msg": {"data": text, "n": rng.random()}}


def cut(rng: random.Random, text: str) -> list[str]:
    """The text in pieces of any length."""
    ends = sorted(rng.sample(range(1, len(text)), rng.randrange(min(40, len(text) - 1))))
    return [text[start:end] for start, end in zip([0, *ends], [*ends, len(text)], strict=True)]


def test_messages_cut_anywhere_and_mixed_come_together() -> None:
    for seed in SEEDS:
        mixed_and_joined(random.Random(seed))


def mixed_and_joined(rng: random.Random) -> None:
    """Three messages in pieces, in any order and each twice."""
    sent = {f"m{number}": random_message(rng, f"m{number}") for number in range(3)}
    pieces = []
    for name, message in sent.items():
        parts = cut(rng, json.dumps(message, ensure_ascii=rng.random() < 0.5))
        shared = {"op": "fragment", "id": name, "total": len(parts)}
        pieces += [{**shared, "num": number, "data": part} for number, part in enumerate(parts)]
    rng.shuffle(pieces)
    assembler, whole = Assembler(), []
    for piece in pieces:
        if (text := assembler.add(piece, now_s=0.0)) is not None:
            whole.append(json.loads(text))
        assert assembler.add(piece, now_s=0.0) is None or text is not None or piece["total"] == 1  # once more: nothing
    found = {message["id"]: message for message in whole}
    assert found == sent


def test_what_goes_out_in_pieces_comes_together_as_roslib_does_it() -> None:
    for seed in SEEDS:
        sent_in_pieces(random.Random(seed))


def sent_in_pieces(rng: random.Random) -> None:
    """One message, put together as roslib does it."""
    message, size = random_message(rng, "out"), rng.randrange(1, 200)
    frames = [json.loads(data) for _, data in shaped(message, Shape(fragment_size=size), name="x")]
    if len(frames) == 1 and frames[0]["op"] == "publish":
        assert frames == [message]
        return
    rng.shuffle(frames)
    buffer: list[str] = [""] * frames[0]["total"]
    for frame in frames:
        assert frame["op"] == "fragment"
        assert len(frame["data"]) <= size
        buffer[frame["num"]] = frame["data"]
    assert json.loads("".join(buffer)) == message


def test_pieces_that_do_not_fit_are_refused() -> None:
    good = {"op": "fragment", "id": "a", "data": "x", "num": 0, "total": 2}
    for wrong in (
        {"id": None},
        {"id": ""},
        {"data": 5},
        {"num": -1},
        {"num": 2},
        {"num": True},
        {"total": 0},
        {"total": 1e9},
    ):
        with pytest.raises(InvalidRequestError):
            Assembler().add({**good, **wrong}, now_s=0.0)
    assembler = Assembler()
    assembler.add(good, now_s=0.0)
    with pytest.raises(InvalidRequestError, match="total was 2"):
        assembler.add({**good, "num": 1, "total": 3}, now_s=0.0)
    assert assembler.waiting_chars == 0


def test_unfinished_messages_are_bounded_in_bytes_number_and_time() -> None:
    assembler = Assembler(limits=replace(LIMITS, rosbridge_message_bytes=100, rosbridge_fragment_s=10.0))
    good = {"op": "fragment", "id": "a", "data": "x" * 60, "num": 0, "total": 2}
    assembler.add(good, now_s=0.0)
    with pytest.raises(BodyTooLargeError):
        assembler.add({**good, "id": "b"}, now_s=1.0)
    assert assembler.waiting_chars == 60
    assembler.add({**good, "id": "c", "data": "y"}, now_s=11.0)
    assert assembler.waiting_chars == 1  # the first was too old by then
    for number in range(200):
        assembler.add({**good, "id": str(number), "data": "z"}, now_s=12.0)
    assert assembler.waiting_chars == 64


def test_a_text_that_fits_is_not_cut() -> None:
    assert fragments("abc", size=3, name="x") == [b"abc"]
    assert len(fragments("abcd", size=3, name="x")) == 2


def test_a_long_text_is_not_cut_into_its_letters() -> None:
    """A client may ask for pieces of one character, of a picture of megabytes, thirty times a second."""
    found = [json.loads(piece) for piece in fragments("ab" * 50_000, size=1, name="x")]
    assert len(found) <= 1024
    assert "".join(piece["data"] for piece in found) == "ab" * 50_000


def test_a_picture_is_a_view_that_a_thread_can_make() -> None:
    channel = Channel(
        robot="r",
        channel_id=1,
        topic="/chat",
        schema_name="std_msgs/msg/String",
        type_hash=type_hash("std_msgs/msg/String"),
        schema_encoding="ros2msg",
        schema=schema_text("std_msgs/msg/String").encode(),
    )
    view = view_of(encoding_of("/chat", Shape(compression="png")))
    assert view is not None
    payload = codec("std_msgs/msg/String").encode(String(data="hi"))
    made = view(channel, Record(seq=1, stamp_ns=1, receive_ns=1, payload=payload))
    assert json.loads(made)["op"] == "png"
    assert view is view_of(encoding_of("/chat", Shape(compression="png", fragment_size=99)))


def test_a_picture_holds_the_text() -> None:
    for length in (1, 2, 3, 4, 100, 1001, 50_000):
        text = json.dumps({"data": "é" * length}).encode()
        found = json.loads(png_message(text))
        with Image.open(io.BytesIO(base64.b64decode(found["data"]))) as image:
            assert found["op"] == "png", length
            assert image.mode == "RGB", length
            assert json.loads(image.tobytes()) == json.loads(text), length
