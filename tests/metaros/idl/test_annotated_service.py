"""`@service` and `@action` classes: the same interfaces as .srv and .action texts, of annotated classes."""

from __future__ import annotations

import pickle
from enum import IntEnum
from typing import Any

import pytest

import metaros
from metaros.cdr import codec
from metaros.errors import FieldError
from metaros.idl import (
    Action,
    Catalogue,
    Service,
    catalogue_of,
    default_catalogue,
    definition_text,
    message_class,
    parse_definition,
    type_hash,
)
from metaros.interfaces.geometry_msgs.msg import Pose
from tests.support.tables import cases


@metaros.message(name="dock_test/msg/Battery")
class Battery:
    """A message inside."""

    volts: float = 12.0


class Side(IntEnum):
    """Of the dock."""

    LEFT = 0
    RIGHT = 1


@metaros.service(name="dock_test/srv/Dock")
class Dock:
    """Drives into the dock."""

    class Why(IntEnum):
        """The reason."""

        NONE = 0
        BLOCKED = 3

    @metaros.message
    class Request:
        """Where to."""

        pose: Pose
        battery: Battery
        side: Side
        speed: metaros.float32 = 0.2

        def slower(self) -> float:
            return self.speed / 2

    class Response:
        done: bool
        batteries: list[Battery]
        why: Dock.Why


@metaros.action(name="dock_test/action/Drive")
class Drive:
    class Goal:
        battery: Battery
        metres: float = 1.0

    class Result:
        driven: float


DOCK: Any = Dock
DRIVE: Any = Drive


service: Any = metaros.service

SRV = """uint8 SIDE_LEFT=0
uint8 SIDE_RIGHT=1
geometry_msgs/Pose pose
Battery battery
int64 side
float32 speed 0.2
---
uint8 WHY_NONE=0
uint8 WHY_BLOCKED=3
bool done
Battery[] batteries
int64 why
"""
ACTION = "dock_test/Battery battery\nfloat64 metres 1.0\n---\nfloat64 driven\n---\n"


def by_text() -> Catalogue:
    made = Catalogue(base=default_catalogue())
    texts = {"dock_test/msg/Battery": "float64 volts", DOCK.__metaros_name__: SRV, DRIVE.__metaros_name__: ACTION}
    own = Catalogue(base=made)
    own.add_all([parse_definition(text, name) for name, text in texts.items() if name != "dock_test/msg/Battery"])
    return own


def test_hashes_are_those_of_the_texts() -> None:
    texts = by_text()
    endings: dict[Any, tuple[str, ...]] = {
        DOCK: ("", "_Request", "_Response", "_Event"),
        DRIVE: ("", "_Goal", "_Result", "_Feedback", "_SendGoal", "_GetResult", "_FeedbackMessage"),
    }
    for kind, parts in endings.items():
        name = kind.__metaros_name__
        assert kind.__metaros_hash__ == type_hash(name, kind.__metaros_catalogue__)
        for part in parts:
            wanted = type_hash(name + part, texts)
            assert type_hash(name + part, kind.__metaros_catalogue__) == wanted
            found = catalogue_of(name + part, wanted)
            assert found is not None
            assert message_class(name + part, found) is message_class(name + part, kind.__metaros_catalogue__)
    assert definition_text(default_catalogue().get("dock_test/action/Drive")) == ACTION


def test_parts_are_message_classes() -> None:
    request: Any = DOCK.Request(speed=1.0, side=1)
    assert (request.slower(), request.side, request.battery) == (0.5, Side.RIGHT, Battery(volts=12.0))
    assert repr(DRIVE.Result(driven=2.0)) == "Drive.Result(driven=2.0)"
    assert (issubclass(Dock, Service), issubclass(Drive, Action), DOCK.__doc__) == (True, True, "Drives into the dock.")
    code = codec(DOCK.Request)
    again = code.decode(code.encode(request))
    assert (type(again), again, type(again.side), type(again.battery)) == (DOCK.Request, request, Side, Battery)
    assert pickle.loads(pickle.dumps(request)) == request
    response = DOCK.Response(batteries=[Battery(volts=1.0)])
    assert codec(DOCK.Response).decode(codec(DOCK.Response).encode(response)) == response
    event = DOCK.Event(request=[request])
    assert codec(type(event)).decode(codec(type(event)).encode(event)).request == [request]
    assert DRIVE.Feedback() == DRIVE.Feedback()


def test_the_catalogue_knows_them_by_name() -> None:
    assert message_class("dock_test/srv/Dock") is DOCK
    assert message_class("dock_test/srv/Dock_Request") is DOCK.Request
    assert message_class("dock_test/action/Drive_Goal") is DRIVE.Goal
    send = message_class("dock_test/action/Drive_SendGoal", DRIVE.__metaros_catalogue__)
    assert type(send.Request().goal) is DRIVE.Goal


def test_names_without_a_name() -> None:
    @service
    class Reset:
        class Request:
            pass

    made: Any = Reset
    assert made.__metaros_name__ == "tests/srv/Reset"
    assert made.Response() == made.Response()
    own = Catalogue()
    with pytest.raises(FieldError, match="service_msgs"):  # events are made of it

        @metaros.service(name="dock_test/srv/Lonely", catalogue=own)
        class Lonely:
            class Request:
                pass


def test_two_of_one_name_are_told_apart_by_hash() -> None:
    def make(kind: Any) -> Any:
        class Same:
            class Request:
                value: kind

        return metaros.service(name="dock_test/srv/Same")(Same)

    first, second = make(int), make(str)
    assert message_class("dock_test/srv/Same") is first
    found = catalogue_of("dock_test/srv/Same", second.__metaros_hash__)
    assert message_class("dock_test/srv/Same", found) is second


@cases(
    ("make", "said"),
    [
        (lambda: service(3), "@service is for classes"),
        (lambda: metaros.service(type("Empty", (), {})), "inner classes Request, Response"),
        (
            lambda: metaros.action(type("A", (), {"Goal": type("Goal", (), {}), "x": 1, "Request": int})),
            "Request is no part",
        ),
        (lambda: metaros.service(type("A", (), {"Request": int})), "cannot be a message"),
        (lambda: metaros.service(type("A", (), {"Request": type("R", (), {}), "Response": 3})), "a class is needed"),
        (
            lambda: metaros.service(type("A", (), {"Request": type("R", (), {}), "__annotations__": {"x": int}})),
            "fields belong into its inner classes",
        ),
        (
            lambda: metaros.service(type("A", (), {"Request": type("R", (), {"__annotations__": {"x": dict}})})),
            "R.x: dict",
        ),
        (lambda: metaros.service(Dock), "it is an interface already"),
        (lambda: metaros.service(name="a/msg/B")(type("A", (), {"Request": type("R", (), {})})), "no service name"),
        (lambda: metaros.action(type("lower", (), {"Goal": type("R", (), {})})), "give @action a name="),
    ],
)
def test_what_is_no_interface(make: Any, said: str) -> None:
    with pytest.raises(FieldError, match=said):
        make()
