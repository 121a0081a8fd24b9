"""Decoding by what the robot announced, and what is said where that does not work."""

from __future__ import annotations

from dataclasses import replace

from gateway.domain.channel import Channel
from gateway.domain.decoder import MAX_CATALOGUES, Decoder
from metaros.cdr import codec
from metaros.idl import Catalogue, add_schema_text, message_class, schema_text, type_hash
from metaros.limits import LIMITS

OWN = "my_robot_msgs/msg/Gripper"
TEXT = "float64 width\nstring[] fingers\n"


def announced(name: str, text: str = "", hash_: str = "") -> Channel:
    return Channel(
        robot="r1",
        channel_id=1,
        topic="/x",
        schema_name=name,
        type_hash=hash_,
        schema_encoding="ros2msg" if text else "",
        schema=text.encode(),
    )


def own_payload() -> bytes:
    catalogue = Catalogue()
    add_schema_text(OWN, TEXT, catalogue)
    return codec(OWN, catalogue).encode(message_class(OWN, catalogue)(width=0.5, fingers=["a", "b"]))


def code(channel: Channel, payload: bytes) -> str:
    view = Decoder().view(channel, payload)
    assert view["message"] is None
    return str(view["error"]["code"])


def test_a_type_of_the_robots_own() -> None:
    decoder = Decoder()
    for _ in range(2):
        shown = decoder.decode(announced(OWN, TEXT, "RIHS01_x"), own_payload())
        assert shown == {"width": 0.5, "fingers": ["a", "b"]}


def test_a_type_that_differs_from_ours_is_read_as_the_robot_has_it() -> None:
    name = "std_msgs/msg/Bool"
    catalogue = Catalogue()
    add_schema_text(name, "uint8 other\n", catalogue)
    payload = codec(name, catalogue).encode(message_class(name, catalogue)(other=7))
    assert Decoder().decode(announced(name, "uint8 other\n", "RIHS01_other"), payload) == {"other": 7}
    assert code(announced(name, "", "RIHS01_other"), payload) == "type_hash_mismatch"


def test_what_cannot_be_shown_says_why() -> None:
    string = announced("std_msgs/msg/String", schema_text("std_msgs/msg/String"), type_hash("std_msgs/msg/String"))
    assert code(string, b"\x00\x01\x00\x00\xff\xff\xff\x7f") == "malformed_cdr"
    assert code(string, bytes(LIMITS.history_decoded_bytes + 1)) == "too_large"
    assert code(announced("no_such/msg/Type"), b"") == "unknown_type"
    assert code(announced(OWN, "float64 ="), own_payload()) == "invalid_definition"
    assert code(replace(string, encoding="json"), b"{}") == "unknown_type"


def test_a_sealed_message_is_said_to_be_sealed_and_not_decoded() -> None:
    string = announced("std_msgs/msg/String", schema_text("std_msgs/msg/String"), type_hash("std_msgs/msg/String"))
    sealed = replace(string, encoding="sealed/cdr")
    assert code(sealed, b"\x00\x01\x00\x00\x03\x00\x00\x00hi\x00") == "sealed"
    assert code(sealed, bytes(LIMITS.history_decoded_bytes + 1)) == "sealed"


def test_catalogues_are_bounded() -> None:
    decoder = Decoder()
    for number in range(MAX_CATALOGUES + 10):
        text = f"float64 width{number}\nstring[] fingers\n"  # a channel that is gone at once, and its id free again
        assert decoder.decode(announced(OWN, text), own_payload())[f"width{number}"] == 0.5
    assert len(decoder._learned) == len(decoder._readers) == MAX_CATALOGUES
