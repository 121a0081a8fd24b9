"""What a peer says of its types, also where that is right and yet no type that a program could live with."""

from __future__ import annotations

from typing import Any

import pytest

from metaros.errors import DefinitionError
from metaros.idl import catalogue_of, message_class, type_hash
from metaros.interfaces.type_description_interfaces.srv import GetTypeDescription
from metaros.node.introspection.described import ACTION_PARTS, learn, learn_action
from metaros.node.introspection.type_description import describe
from tests.support.nodes.typed_peer import catalogue_with

CHAIN = {f"deep_msgs/msg/N{number}": f"N{number + 1} next" for number in range(300)} | {
    "deep_msgs/msg/N300": "int8 end"
}
CUBE = {f"wide_msgs/msg/P{number}": f"P{number + 1}[1000] parts" for number in range(4)} | {
    "wide_msgs/msg/P4": "int8 x"
}


def told(name: str, texts: dict[str, str]) -> Any:
    """What an honest node answers about a type."""
    response = GetTypeDescription.Response()
    describe(name, catalogue_with(texts), response)
    return response


@pytest.mark.parametrize(
    ("name", "texts", "why"),
    [
        ("deep_msgs/msg/N0", CHAIN, "nests messages deeper than 32"),
        ("wide_msgs/msg/P0", CUBE, "arrays of fixed size"),
        ("wide_msgs/srv/S", CUBE | {"wide_msgs/srv/S": "---\nP0 all"}, "arrays of fixed size"),
    ],
)
def test_types_that_would_fill_the_memory_or_the_stack_are_not_learned(
    name: str, texts: dict[str, str], why: str
) -> None:
    wanted = type_hash(name, catalogue_with(texts))
    with pytest.raises(DefinitionError, match=why):
        learn(name, wanted, told(name, texts))
    assert catalogue_of(name, wanted) is None


def test_nor_are_such_actions() -> None:
    name = "wide_msgs/action/A"
    texts = CUBE | {name: "---\n---\nP0 all"}
    hashes = {part: type_hash(name + part, catalogue_with(texts)) for part in ACTION_PARTS}
    with pytest.raises(DefinitionError, match="arrays of fixed size"):
        learn_action(name, hashes, {part: told(name + part, texts) for part in ACTION_PARTS})
    assert catalogue_of(name + ACTION_PARTS[0], hashes[ACTION_PARTS[0]]) is None


def test_others_are() -> None:
    texts = {"wide_msgs/msg/Row": "P3 four\nint8 MOST=4", **CUBE}
    wanted = type_hash("wide_msgs/msg/Row", catalogue_with(texts))
    row = message_class("wide_msgs/msg/Row", learn("wide_msgs/msg/Row", wanted, told("wide_msgs/msg/Row", texts)))
    assert (len(row().four.parts), row.MOST, row.__metaros_hash__) == (1000, 4, wanted)
