"""What a client was told that there is: numbers that stay, changes that are told, and one channel a topic."""

from __future__ import annotations

from dataclasses import replace

from gateway.api.foxglove.directory import Directory, channel_facts
from gateway.domain.channel import Channel
from metaros.idl import schema_text, type_hash

STRING = "std_msgs/msg/String"


def made(topic: str, *, schema_name: str = STRING, schema: bytes = b"string data", encoding: str = "cdr") -> Channel:
    return Channel(
        robot="r1",
        channel_id=1,
        topic=topic,
        schema_name=schema_name,
        type_hash="",
        encoding=encoding,
        schema_encoding="ros2msg",
        schema=schema,
    )


def test_numbers_stay_and_are_never_given_again() -> None:
    directory = Directory(10)
    first = directory.update_channels([("/a", made("/a")), ("/b", made("/b"))])
    assert [(item.number, item.topic) for item in first.new] == [(1, "/a"), (2, "/b")]
    again = directory.update_channels([("/a", replace(made("/a"), channel_id=9)), ("/b", made("/b"))])
    assert (again.new, again.gone) == ([], [])
    other = directory.update_channels([("/b", made("/b", schema=b"int32 data"))])
    assert other.gone == [1, 2]
    assert [(item.number, item.topic) for item in other.new] == [(3, "/b")]


def test_one_channel_a_topic_and_no_more_than_there_may_be() -> None:
    directory = Directory(2)
    twice = [("/a", made("/a")), ("/a", made("/a", schema_name="x/msg/Y")), ("/b", made("/b")), ("/c", made("/c"))]
    changes = directory.update_channels(twice)
    assert [item.channel.schema_name for item in changes.new] == [STRING, STRING]
    assert changes.left_out == 1


def test_a_change_of_one_robot_is_reported_without_the_others() -> None:
    directory = Directory(3)
    others = [(f"/r2/{name}", replace(made(f"/{name}"), robot="r2")) for name in "abcd"]
    assert directory.update_channels([("/r1/a", made("/a")), *others]).left_out == 2
    first = [item.number for item in directory.channels.values() if item.channel.robot == "r2"]
    changes = directory.update_channels([("/r1/b", made("/b")), ("/r1/c", made("/c"))], robots={"r1"})
    assert ([item.topic for item in changes.new], changes.gone, changes.left_out) == (["/r1/b"], [1], 3)
    assert [item.number for item in directory.channels.values() if item.channel.robot == "r2"] == first
    assert directory.update_channels([], robots={"r1"}).left_out == 2
    whole = directory.update_channels(others)
    assert ([item.topic for item in whole.new], whole.left_out) == (["/r2/c"], 1)


def test_what_no_viewer_could_read_is_counted_and_not_shown() -> None:
    found = [
        ("/sealed", made("/sealed", encoding="sealed/cdr")),
        ("/bare", made("/bare", schema=b"", schema_name="no_such/msg/Type")),
        ("/json", made("/json", schema=b"", schema_name="", encoding="json")),
    ]
    changes = Directory(10).update_channels(found)
    assert ([item.topic for item in changes.new], changes.unreadable) == (["/json"], 2)


def test_the_schema_is_the_robots_or_the_shipped_one() -> None:
    directory = Directory(10)
    bare = replace(made("/b", schema=b""), type_hash=type_hash(STRING))
    facts = {
        item.topic: channel_facts(item) for item in directory.update_channels([("/a", made("/a")), ("/b", bare)]).new
    }
    assert facts["/a"]["schema"] == "string data"
    assert (facts["/b"]["schemaEncoding"], facts["/b"]["schema"]) == ("ros2msg", schema_text(STRING))
    assert facts["/a"]["metadata"] == {"robot": "r1"}


def test_services_change_by_name() -> None:
    directory = Directory(10)
    new, gone = directory.update_services([("/s", "a/srv/B", "", "bool ok"), ("/t", "a/srv/B", "", "bool ok")])
    assert ([item.name for item in new], gone) == (["/s", "/t"], [])
    new, gone = directory.update_services([("/s", "a/srv/C", "", "bool ok")])
    assert ([(item.id, item.type_name) for item in new], sorted(gone)) == ([(3, "a/srv/C")], [1, 2])
