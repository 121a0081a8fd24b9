"""Names in every form."""

from __future__ import annotations

import pytest

from gateway.automation.functions.catalogue.names import (
    function_arn,
    layer_arn,
    mapping_arn,
    parse_function,
    parse_layer,
    parse_layer_version,
    parse_resource,
)
from gateway.automation.functions.errors import FunctionInvalidError, UnknownFunctionError
from tests.support.tables import refusal

UUID = "00000000-0000-4000-8000-000000000000"


NAMED = (
    ("f", "f", ""),
    ("f:1", "f", "1"),
    ("f:live", "f", "live"),
    ("f:$LATEST", "f", "$LATEST"),
    ("function:f", "f", ""),
    ("000000000000:function:f:2", "f", "2"),
    ("arn:aws:lambda:local:000000000000:function:f", "f", ""),
    ("arn:aws:lambda:eu-central-1:000000000000:function:f:live", "f", "live"),
    ("a" * 64, "a" * 64, ""),
)


def test_a_function_is_named() -> None:
    found = [(text, parse_function(text), (name, qualifier)) for text, name, qualifier in NAMED]
    assert [case for case in found if case[1] != case[2]] == []


def test_what_is_no_name() -> None:
    texts = ("", "a b", "a" * 65, "f:", "f:a:b", "../x", "f\n", "arn:aws:s3:::f", "é", "f:" + "q" * 129)
    assert [text for text in texts if not refusal(FunctionInvalidError, parse_function, text)] == []


def test_a_qualifier_stands_in_one_place() -> None:
    assert parse_function("f", "live") == ("f", "live")
    assert parse_function("f:live", "live") == ("f", "live")
    with pytest.raises(FunctionInvalidError, match="qualifier"):
        parse_function("f:live", "1")


def test_another_account_is_not_here() -> None:
    for text in ("123456789012:function:f", "arn:aws:lambda:local:123456789012:function:f"):
        with pytest.raises(UnknownFunctionError):
            parse_function(text)


def test_arns_are_read_back() -> None:
    assert parse_function(function_arn("f", "live")) == ("f", "live")
    assert parse_layer(layer_arn("shared")) == ("shared", 0)
    assert parse_layer_version(layer_arn("shared", 7)) == ("shared", 7)
    assert parse_resource(function_arn("f")) == ("function", "f")
    assert parse_resource(mapping_arn(UUID)) == ("mapping", UUID)
    for arn in ("shared:7", layer_arn("shared")):
        with pytest.raises(FunctionInvalidError):
            parse_layer_version(arn)
    for arn in ("f", function_arn("f", "1"), layer_arn("shared", 1)):
        with pytest.raises(FunctionInvalidError):
            parse_resource(arn)
