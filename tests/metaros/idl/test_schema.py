"""ros2msg texts."""

from __future__ import annotations

import pytest

from metaros.errors import DefinitionError, UnknownTypeError
from metaros.idl import (
    Catalogue,
    add_schema_text,
    default_catalogue,
    definition_text,
    parse_definition,
    schema_text,
    type_hash,
)
from tests.support.tables import cases


def test_the_layout_of_a_schema() -> None:
    lines = schema_text("std_msgs/msg/Header").splitlines()
    assert lines == [
        "builtin_interfaces/Time stamp",
        "string frame_id",
        "=" * 80,
        "MSG: builtin_interfaces/Time",
        "int32 sec",
        "uint32 nanosec",
    ]


@cases("kind", ["msg", "srv", "action"])
def test_every_shipped_interface_survives_its_text(kind: str) -> None:
    catalogue = default_catalogue()
    for name in catalogue.names(kind):
        assert parse_definition(definition_text(catalogue.get(name)), name) == catalogue.get(name)


def test_every_shipped_message_survives_its_schema() -> None:
    for name in default_catalogue().names("msg"):
        learnt = Catalogue()
        add_schema_text(name, schema_text(name), learnt)
        assert type_hash(name, learnt) == type_hash(name)


def test_parts_of_services_survive_too() -> None:
    name = "example_interfaces/action/Fibonacci_GetResult_Response"
    assert "MSG: example_interfaces/action/Fibonacci_Result" in schema_text(name)


def test_a_schema_is_learnt_whole_or_not_at_all() -> None:
    catalogue = Catalogue()
    with pytest.raises(UnknownTypeError, match="q/msg/Missing"):
        add_schema_text("p/msg/A", "q/B b\n" + "=" * 80 + "\nMSG: q/B\nMissing m\n", catalogue)
    assert catalogue.names() == []


def test_what_is_known_already_stays() -> None:
    catalogue = Catalogue(base=default_catalogue())
    add_schema_text("std_msgs/msg/String", "string data", catalogue)
    assert catalogue.home("std_msgs/msg/String") is default_catalogue()
    add_schema_text("std_msgs/msg/Bool", "uint8 data", catalogue)
    assert catalogue.home("std_msgs/msg/Bool") is catalogue


def test_a_separator_without_title() -> None:
    with pytest.raises(DefinitionError, match="MSG: package/Name"):
        add_schema_text("p/msg/A", "int32 a\n" + "=" * 80 + "\nint32 b\n", Catalogue())
