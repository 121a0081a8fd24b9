"""The catalogue: what is shipped, what is added, derived interfaces, bases."""

from __future__ import annotations

import threading

import pytest

from metaros.errors import ConfigError, DefinitionError, UnknownTypeError
from metaros.idl import (
    ActionDefinition,
    Catalogue,
    MessageDefinition,
    ServiceDefinition,
    default_catalogue,
    message_class,
    parse_definition,
    parse_msg,
    release_catalogue,
    type_hash,
)
from tests.support.tables import cases


def test_what_is_shipped() -> None:
    catalogue = default_catalogue()
    names = catalogue.names()
    assert len(names) == len(catalogue.names("msg")) + len(catalogue.names("srv")) + len(catalogue.names("action"))
    assert len(names) > 230
    for name in names:
        catalogue.dependencies(name)
        assert name in catalogue
    assert "metaros_msgs/msg/HostCpu" in catalogue
    assert "nosuch_msgs/msg/A" not in catalogue
    assert 7 not in catalogue


@cases(
    ("name", "kind"),
    [
        ("std_msgs/msg/String", MessageDefinition),
        ("std_srvs/srv/Trigger", ServiceDefinition),
        ("std_srvs/srv/Trigger_Request", MessageDefinition),
        ("std_srvs/srv/Trigger_Event", MessageDefinition),
        ("example_interfaces/action/Fibonacci", ActionDefinition),
        ("example_interfaces/action/Fibonacci_SendGoal", ServiceDefinition),
        ("example_interfaces/action/Fibonacci_GetResult_Event", MessageDefinition),
        ("example_interfaces/action/Fibonacci_FeedbackMessage", MessageDefinition),
    ],
)
def test_derived_interfaces_have_their_own_names(name: str, kind: type) -> None:
    fresh = Catalogue(base=default_catalogue())
    assert isinstance(fresh.get(name), kind)
    assert fresh.get(name).name == name


@cases("name", ["std_msgs/msg/Nope", "std_srvs/srv/Nope_Request", "x", "", "a/b/c/d"])
def test_unknown_names(name: str) -> None:
    with pytest.raises(UnknownTypeError):
        default_catalogue().get(name)


def test_a_whole_service_is_no_message() -> None:
    with pytest.raises(UnknownTypeError, match="name one of its parts"):
        default_catalogue().message("std_srvs/srv/Trigger")


def test_adding_twice_is_nothing_and_another_definition_an_error() -> None:
    catalogue = Catalogue()
    catalogue.add(parse_msg("int32 a", "p/msg/N"))
    catalogue.add(parse_msg("int32 a # again", "p/msg/N"))
    with pytest.raises(DefinitionError, match="another definition"):
        catalogue.add(parse_msg("int64 a", "p/msg/N"))


def test_a_catalogue_over_another_redefines_without_touching_it() -> None:
    base = Catalogue()
    base.add(parse_msg("int32 a", "p/msg/Inner"))
    base.add(parse_msg("Inner inner", "p/msg/Outer"))
    base.add(parse_msg("int8 b", "p/msg/Apart"))
    over = Catalogue(base=base)
    over.add(parse_msg("int64 a", "p/msg/Inner"))
    assert type_hash("p/msg/Outer", over) != type_hash("p/msg/Outer", base)
    assert message_class("p/msg/Outer", over) is not message_class("p/msg/Outer", base)
    assert message_class("p/msg/Apart", over) is message_class("p/msg/Apart", base)
    assert over.names() == base.names()


def test_a_message_that_contains_itself() -> None:
    catalogue = Catalogue()
    catalogue.add(parse_msg("B[] b", "p/msg/A"))
    catalogue.add(parse_msg("A a", "p/msg/B"))
    with pytest.raises(DefinitionError, match="contains itself"):
        type_hash("p/msg/A", catalogue)
    with pytest.raises(DefinitionError, match="contains itself"):
        message_class("p/msg/B", catalogue)


def test_a_missing_part() -> None:
    catalogue = Catalogue()
    catalogue.add(parse_msg("Nope a", "p/msg/A"))
    with pytest.raises(UnknownTypeError, match="p/msg/Nope"):
        message_class("p/msg/A", catalogue)


def test_parse_definition_wants_a_full_name() -> None:
    with pytest.raises(DefinitionError, match="package/msg/Name"):
        parse_definition("int32 a", "p/N")


def test_releases() -> None:
    name = "lifecycle_msgs/msg/TransitionEvent"
    assert release_catalogue("jazzy") is default_catalogue()
    assert release_catalogue("lyrical").message(name).fields[0].name == "stamp"
    assert default_catalogue().message(name).fields[0].name == "timestamp"
    with pytest.raises(ConfigError, match="jazzy"):
        release_catalogue("foxy")


def test_threads_get_the_same_class() -> None:
    catalogue = Catalogue(base=default_catalogue())
    catalogue.add(parse_msg("sensor_msgs/Imu[] all", "p/msg/Many"))
    found: list[type] = []
    start = threading.Barrier(4)

    def work() -> None:
        start.wait()
        found.append(message_class("p/msg/Many", catalogue))

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 4
    assert len(set(found)) == 1
