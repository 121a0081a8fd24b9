"""The grammar of names, as rclpy's functions tell it: which are good, what is said of the others, and where."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from metaros.errors import MetarosError
from metaros.ros2.rclpy.names.expand_topic_name import expand_topic_name
from metaros.ros2.rclpy.names.topic_or_service_is_hidden import topic_or_service_is_hidden
from metaros.ros2.rclpy.names.validate_full_topic_name import validate_full_topic_name
from metaros.ros2.rclpy.names.validate_namespace import validate_namespace
from metaros.ros2.rclpy.names.validate_node_name import validate_node_name
from metaros.ros2.rclpy.names.validate_parameter_name import validate_parameter_name
from metaros.ros2.rclpy.names.validate_topic_name import validate_topic_name

Validate = Callable[..., bool]
GOOD: list[tuple[Validate, str]] = [
    (validate_topic_name, "a /a a/b ~ ~/a {node}/a a/{ns}/b a{node}b _a a__b a//b"),
    (validate_full_topic_name, "/a /a/b /a_1/b2 /_a"),
    (validate_namespace, "/ /a /a/b"),
    (validate_node_name, "a a_1 _a A"),
    (validate_parameter_name, "a a.b a-b"),
]
CHARACTERS, DIGIT, EMPTY = "must not contain characters", "must not start with a number", "must not be empty"
# What is refused, the words that programs look for, and the column of the mark below the name.
BAD: list[tuple[Validate, str, str, int]] = [
    (validate_topic_name, "", EMPTY, 0),
    (validate_topic_name, "/", "must not end with", 0),
    (validate_topic_name, "a/", "must not end with", 1),
    (validate_topic_name, "/a?", CHARACTERS, 2),
    (validate_topic_name, "/ä", CHARACTERS, 1),
    (validate_topic_name, "a/4b", DIGIT, 2),
    (validate_topic_name, "4b", DIGIT, 0),
    (validate_topic_name, "a~", "'~'", 1),
    (validate_topic_name, "~a", "'~'", 1),
    (validate_topic_name, "a/{b", "curly brace", 2),
    (validate_topic_name, "a}", "curly brace", 1),
    (validate_topic_name, "{}", CHARACTERS, 1),
    (validate_topic_name, "{a/b}", CHARACTERS, 1),
    (validate_topic_name, "{4}", DIGIT, 1),
    (validate_full_topic_name, "", EMPTY, 0),
    (validate_full_topic_name, "a", "must be absolute", 0),
    (validate_full_topic_name, "/a/", "must not end with", 2),
    (validate_full_topic_name, "/a?", CHARACTERS, 2),
    (validate_full_topic_name, "/~/a", CHARACTERS, 1),
    (validate_full_topic_name, "/a//b", "in a row", 3),
    (validate_full_topic_name, "/a/4", DIGIT, 3),
    (validate_full_topic_name, "/" + "a" * 247, "longer than 247", 247),
    (validate_namespace, "", EMPTY, 0),
    (validate_namespace, "a", "must be absolute", 0),
    (validate_namespace, "/a/", "must not end with", 2),
    (validate_namespace, "/" + "a" * 245, "longer than 245", 245),
    (validate_node_name, "", EMPTY, 0),
    (validate_node_name, "a.", CHARACTERS, 1),
    (validate_node_name, "/a", CHARACTERS, 0),
    (validate_node_name, "4a", DIGIT, 0),
    (validate_node_name, "a" * 256, "longer than 255", 255),
]
KINDS: dict[tuple[Validate, bool], str] = {
    (validate_topic_name, False): "Topic",
    (validate_topic_name, True): "Service",
    (validate_full_topic_name, True): "Service",
    (validate_namespace, False): "Namespace",
    (validate_node_name, False): "NodeName",
}


def test_good_names_pass() -> None:
    for validate, names in GOOD:
        assert [name for name in names.split() if validate(name) is not True] == [], validate.__name__


def test_bad_names_are_refused_with_the_place() -> None:
    wrong = []
    for validate, name, words, column in BAD:
        try:
            found: object = validate(name)
        except MetarosError as error:
            text = str(error)
            mark = text.rpartition("\n")[2].index("^") - 3
            if words in text and mark == column:
                continue
            found = text
        wrong.append((validate.__name__, name, found))
    assert wrong == []


def test_the_error_says_what_the_name_is_of() -> None:
    found = {}
    for validate, is_service in KINDS:
        with pytest.raises(MetarosError) as raised:
            validate("?", is_service=True) if is_service else validate("?")
        found[validate, is_service] = raised.typename
    assert all(KINDS[key] in name for key, name in found.items()), found
    with pytest.raises(MetarosError, match="Invalid parameter name"):
        validate_parameter_name("")


def test_names_are_expanded() -> None:
    expected = {
        ("a", "n", "/ns"): "/ns/a",
        ("a", "n", "/"): "/a",
        ("/a", "n", "/ns"): "/a",
        ("~/a", "n", "/ns"): "/ns/n/a",
        ("~/a", "n", "/"): "/n/a",
        ("~", "n", "/ns"): "/ns/n",
        ("{node}/a", "n", "/ns"): "/ns/n/a",
        ("/x/{node}", "n", "/ns"): "/x/n",
        ("{ns}/a", "n", "/ns"): "/ns/a",
        ("{namespace}/a", "n", "/x/y"): "/x/y/a",
    }
    assert {given: expand_topic_name(*given) for given in expected} == expected


def test_what_cannot_be_expanded_is_named() -> None:
    refused = {
        ("a", "n?", "/ns"): "node name",
        ("a", "n", ""): "namespace",
        ("a", "n", "ns"): "namespace",
        ("a?", "n", "/ns"): "topic name 'a.' is invalid",
        ("{b}/a", "n", "/ns"): "unknown substitution {b}",
    }
    for given, words in refused.items():
        with pytest.raises(ValueError, match=words):
            expand_topic_name(*given)


def test_hidden_names_have_a_token_with_an_underscore() -> None:
    hidden, shown = "/_a _a /a/_b /_a/b _ /a/_/b", "/a a /a/b_ /a_/b /a_b"
    assert [name for name in hidden.split() if not topic_or_service_is_hidden(name)] == []
    assert [name for name in [*shown.split(), ""] if topic_or_service_is_hidden(name)] == []
