"""RIHS01 against the hashes that the real rosidl generator printed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from metaros.errors import DefinitionError, UnknownTypeError
from metaros.idl import Catalogue, parse_hash, parse_msg, release_catalogue, type_description, type_hash
from tests.support.tables import cases

HASHES = json.loads((Path(__file__).parents[2] / "data" / "ros2_rihs01.json").read_text())["distros"]
TEST_MSGS = {  # of kilted, as rosidl's C generator printed them; what these are made of is covered by them
    "msg/MultiNested": "9ee9cbfb17c2df991a750b761a56def78674034977c829449820ca07efd9758b",
    "msg/Strings": "eee55533636293ac7c94c62432eedb5777eb849847d2a17b4dcead8c4a20ab32",
    "msg/WStrings": "5a2c8ddb2054600023b9a180652f2ba895373217cad4b1f0fc1258c9e4424a79",
    "msg/Builtins": "9e61888e7521dda35c21ac6b6cabbcaff8dae88b6d67b25b9078fdb9abf56303",
    "msg/BoundedPlainSequences": "0670c010d33c1db2c5589ab5bbd208c551b5c72c88a76de80dfd0d2362255889",
    "srv/Arrays": "ae66e13b3ad1520bcd9fa5751c4a4521222bf27c2f845d79de0c76e4cbb41080",
    "action/Fibonacci": "be9273e3557225044b4a040811112491f7079326e3a573f83258b0b4c30bd069",
    "action/NestedMessage": "edd4bac361b0ee01c5e228d7c065f1d64e1b11aa55c5c6efb4e5e10e40fde40a",
}
EXPECTED = {"jazzy": 351, "kilted": 351, "lyrical": 164}


@pytest.mark.parametrize("release", EXPECTED)
def test_every_hash_of_the_real_generator(release: str, record_property: pytest.RecordProperty) -> None:
    hashes = HASHES[release]["hashes"]
    catalogue = release_catalogue(release)
    wrong = [name for name, expected in hashes.items() if type_hash(name, catalogue) != expected]
    matched = len(hashes) - len(wrong)
    rosidl = HASHES[release]["versions"]["rosidl"]
    print(f"{release}: {matched} of {len(hashes)} RIHS01 type hashes equal those of rosidl {rosidl}")
    record_property("types", matched)
    assert wrong == []
    assert matched == EXPECTED[release]


def test_hashes_of_test_msgs() -> None:
    wrong = {name: type_hash(f"test_msgs/{name}") for name in TEST_MSGS}
    assert wrong == {name: f"RIHS01_{digits}" for name, digits in TEST_MSGS.items()}


def test_char_is_hashed_as_uint8() -> None:
    catalogue = Catalogue()
    catalogue.add(parse_msg("char data", "a_msgs/msg/One"))
    description = type_description("a_msgs/msg/One", catalogue)["type_description"]
    assert description["fields"][0]["type"]["type_id"] == 3


@cases(
    ("text", "type_id", "capacity", "string_capacity"),
    [
        ("bool x", 15, 0, 0),
        ("byte x", 16, 0, 0),
        ("wstring x", 18, 0, 0),
        ("string<=7 x", 21, 0, 7),
        ("wstring<=7 x", 22, 0, 7),
        ("float64[3] x", 11 + 48, 3, 0),
        ("char[16] x", 51, 16, 0),
        ("uint64[<=3] x", 9 + 96, 3, 0),
        ("string<=5[<=3] x", 21 + 96, 3, 5),
        ("int8[] x", 2 + 144, 0, 0),
        ("Other[] x", 1 + 144, 0, 0),
    ],
)
def test_type_ids(text: str, type_id: int, capacity: int, string_capacity: int) -> None:
    catalogue = Catalogue()
    catalogue.add(parse_msg("int32 a", "a_msgs/msg/Other"))
    catalogue.add(parse_msg(text, "a_msgs/msg/One"))
    kind = type_description("a_msgs/msg/One", catalogue)["type_description"]["fields"][0]["type"]
    assert (kind["type_id"], kind["capacity"], kind["string_capacity"]) == (type_id, capacity, string_capacity)
    assert kind["nested_type_name"] == ("a_msgs/msg/Other" if "Other" in text else "")


def test_constants_and_defaults_do_not_change_the_hash() -> None:
    plain, rich = Catalogue(), Catalogue()
    plain.add(parse_msg("int32 a", "a_msgs/msg/One"))
    rich.add(parse_msg("int32 LIMIT=3\nint32 a 7 # why", "a_msgs/msg/One"))
    assert type_hash("a_msgs/msg/One", plain) == type_hash("a_msgs/msg/One", rich)


def test_parse_hash() -> None:
    text = type_hash("std_msgs/msg/String")
    assert parse_hash(text).hex() == text[7:]


@cases("text", ["", "RIHS01_", "RIHS02_" + "0" * 64, "RIHS01_" + "0" * 63, "RIHS01_" + "0" * 65, "RIHS01_" + "g" * 64])
def test_bad_hashes_are_refused(text: str) -> None:
    with pytest.raises(DefinitionError, match="no RIHS01 hash"):
        parse_hash(text)


def test_unknown_type() -> None:
    with pytest.raises(UnknownTypeError, match="nosuch_msgs/msg/Thing"):
        type_hash("nosuch_msgs/msg/Thing")
