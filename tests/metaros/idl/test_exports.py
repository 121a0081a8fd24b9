"""What `metaros.idl` exports is there, documented, and frozen where it is a table."""

from __future__ import annotations

import dataclasses

import pytest

import metaros.idl as idl
from tests.support.tables import cases


@cases("name", idl.__all__)
def test_every_name_is_there_and_documented(name: str) -> None:
    assert getattr(idl, name).__doc__ or name == "Definition"


def test_definitions_are_frozen() -> None:
    definition = idl.parse_msg("int32 a", "p/msg/N")
    with pytest.raises(dataclasses.FrozenInstanceError):
        definition.name = "other"  # type: ignore[misc]
