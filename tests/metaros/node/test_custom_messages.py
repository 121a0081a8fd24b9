"""`@message` classes between nodes: mismatches are told, and definitions of peers are checked before they are used."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

import metaros
from metaros.cdr import codec
from metaros.errors import UnknownTypeError
from metaros.idl import Catalogue, message_class, parse_msg, type_description, type_hash
from metaros.interfaces.type_description_interfaces.msg import (
    Field,
    FieldType,
    IndividualTypeDescription,
    TypeDescription,
    TypeSource,
)
from metaros.interfaces.type_description_interfaces.srv import GetTypeDescription
from metaros.node.introspection import fetch_type, fetch_type_async, users_of
from tests.support.waiting import wait_until

Answer = Callable[[Any, Any], Any]


@metaros.message(name="zoo_msgs/msg/Legs")
class FourLegs:
    """One version."""

    front: int = 2
    back: int = 2


@metaros.message(name="zoo_msgs/msg/Legs")
class SixLegs:
    """The other one."""

    pairs: metaros.uint8 = 3


def test_classes_of_one_name_with_other_fields_do_not_match_and_both_sides_say_so(here, there):
    got: list[Any] = []
    with metaros.Node("a", context=here) as a, metaros.Node("b", context=there) as b:
        publisher = a.create_publisher(FourLegs, "/legs")
        wrong = b.create_subscription(SixLegs, "/legs", got.append, dedicated=True)
        right = b.create_subscription(FourLegs, "/legs", got.append, dedicated=True)
        wait_until(lambda: publisher.mismatched == 1 and wrong.mismatched == 1)
        wait_until(lambda: (publisher.publish(FourLegs(front=1)), got)[1])
        assert right.mismatched == 0
    assert set(map(type, got)) == {FourLegs}
    assert got[0] == FourLegs(front=1)


@contextmanager
def teller(context: metaros.Context, name: str, answer: Answer | None) -> Iterator[metaros.Node]:
    """A node that describes types in its own way, spun on a thread."""
    with metaros.Node(name, context=context, enable_parameters=False) as node:
        if answer is not None:
            node.create_service(GetTypeDescription, "~/get_type_description", answer)
        executor = metaros.SingleThreadedExecutor()
        executor.add_node(node)
        thread = threading.Thread(target=executor.spin)
        thread.start()
        try:
            yield node
        finally:
            executor.shutdown()
            thread.join()


def described(name: str, text: str, *, sources: bool) -> tuple[str, Answer]:
    """The hash of a definition, and an answer that tells it."""
    catalogue = Catalogue()
    catalogue.add(parse_msg(text, name))
    description = type_description(name, catalogue)["type_description"]
    fields = [Field(name=item["name"], type=FieldType(**item["type"])) for item in description["fields"]]

    def answer(request: Any, response: Any) -> None:
        response.successful = True
        response.type_description = TypeDescription(
            type_description=IndividualTypeDescription(type_name=name, fields=fields)
        )
        if sources:
            response.type_sources = [TypeSource(type_name=name, encoding="msg", raw_file_contents=text)]

    return type_hash(name, catalogue), answer


@pytest.mark.parametrize("sources", [True, False])
def test_a_definition_is_learned_from_sources_or_from_fields_alone(here, there, sources):
    name = f"far_msgs/msg/Told{sources}"
    text = "uint8 BIG=9\nfloat32[<=4] x\nstring<=5 y\nchar c\n"
    wanted, answer = described(name, text, sources=sources)
    with teller(there, "teller", answer) as far, metaros.Node("asker", context=here) as node:
        far.create_raw_publisher("/told", name, wanted)
        wait_until(lambda: users_of(node, name, wanted) == ["/teller"])
        catalogue = fetch_type(node, name, wanted, timeout_s=60.0)
        cls = message_class(name, catalogue)
        message = cls(x=[1, 2], y="ok", c=3)
        assert codec(cls).decode(codec(cls).encode(message)) == message
        assert getattr(cls, "BIG", None) == (9 if sources else None)
        assert fetch_type(node, name, wanted) is catalogue


def forged(**change: Any) -> Answer:
    """An answer whose one field is not what the grammar allows."""

    def answer(request: Any, response: Any) -> None:
        field = Field(name=change.get("name", "x"), type=FieldType(type_id=change.get("type_id", 8)))
        part = IndividualTypeDescription(type_name=request.type_name, fields=[field])
        response.type_description = TypeDescription(type_description=part)
        text = change.get("text", "")
        response.type_sources = [TypeSource(type_name=request.type_name, encoding="msg", raw_file_contents=text)]
        response.successful = change.get("successful", True)
        response.failure_reason = "it is a secret"

    return answer


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (forged(), "does not lead to the hash"),
        (forged(name="x: print(1)\n    import os"), "does not lead to the hash"),
        (forged(type_id=12), "does not lead to the hash"),
        (forged(type_id=255), "does not lead to the hash"),
        (forged(text="int64 x\nint64 x"), "does not lead to the hash"),
        (forged(successful=False), "it is a secret"),
        (None, "no server of /liar/get_type_description"),
    ],
)
def test_what_does_not_lead_to_the_hash_is_not_believed(here, there, answer, reason):
    name, wanted = "far_msgs/msg/Forged", f"RIHS01_{'1' * 64}"
    with teller(there, "liar", answer) as far, metaros.Node("asker", context=here) as node:
        far.create_raw_publisher("/forged", name, wanted)
        wait_until(lambda: users_of(node, name, wanted))
        with pytest.raises(UnknownTypeError, match=reason):
            fetch_type(node, name, wanted, timeout_s=0.2 if answer is None else 60.0)


def test_coroutines_ask_too_and_somebody_must_be_there(here, there):
    name = "far_msgs/msg/Awaited"
    wanted, answer = described(name, "int8 x", sources=True)
    with teller(there, "teller", answer) as far, metaros.Node("asker", context=here) as node:
        with pytest.raises(UnknownTypeError, match="no node that uses it is in the graph"):
            fetch_type(node, name, wanted)
        far.create_raw_publisher("/told", name, wanted)
        wait_until(lambda: users_of(node, name, wanted))
        catalogue = asyncio.run(fetch_type_async(node, name, wanted, timeout_s=60.0))
        assert type_hash(name, catalogue) == wanted
