"""Members are held against botocore's model: what is wrong is named, whatever comes."""

from __future__ import annotations

from typing import Any

import pytest

from gateway.automation.functions.catalogue.shapes import check_input, faults_of, model
from gateway.automation.functions.errors import FunctionInvalidError
from tests.support.tables import refusal

GOOD: dict[str, Any] = {
    "FunctionName": "arn:aws:lambda:local:000000000000:function:f",
    "Role": "arn:aws:iam::000000000000:role/r",
    "Code": {"ZipFile": b"x"},
    "Runtime": "python3.12",
    "Handler": "app.handler",
    "Layers": ["arn:aws:lambda:local:000000000000:layer:shared:1"],
    "Tags": {"team": "Größe / 1"},
}


def test_what_fits_is_taken() -> None:
    check_input("CreateFunction", GOOD)
    check_input("ListFunctions", {})
    check_input("GetAccountSettings", {})


MISFITS: tuple[tuple[str, Any, str], ...] = (
    ("FunctionName", "has blanks", "does not fit"),
    ("FunctionName", 7, "text is wanted"),
    ("Role", "nobody", "Role: 'nobody' does not fit"),
    ("Timeout", 0, "Timeout: 0 is under 1"),
    ("Timeout", 5401, "Timeout: 5401 is over 5400"),
    ("Timeout", True, "a whole number is wanted"),
    ("Timeout", 1.5, "a whole number is wanted"),
    ("Timeout", 1 << 70, "a whole number is wanted"),
    ("Description", "x" * 257, "257 characters is over 256"),
    ("Runtime", "cobol", "is none of nodejs"),
    ("Architectures", [], "0 items is under 1"),
    ("Architectures", "x86_64", "a list is wanted"),
    ("Environment", {"Variables": {"1": "x"}}, "does not fit"),
    ("Environment", [], "an object is wanted"),
    ("EphemeralStorage", {}, "EphemeralStorage.Size: is required"),
    ("Publish", "yes", "true or false is wanted"),
    ("Code", {"ZipFile": "text"}, "Code.ZipFile: bytes are wanted"),
    ("NewThing", 1, "NewThing: is no member"),
)


def test_what_does_not_fit_is_named() -> None:
    said = [
        (member, value, why, refusal(FunctionInvalidError, check_input, "CreateFunction", {**GOOD, member: value}))
        for member, value, why in MISFITS
    ]
    assert [case for case in said if case[2] not in case[3]] == []


def test_what_is_required_and_missing_is_named() -> None:
    with pytest.raises(FunctionInvalidError, match=r"Role: is required; Code: is required"):
        check_input("CreateFunction", {"FunctionName": "f"})


def test_secrets_are_not_in_what_is_said() -> None:
    with pytest.raises(FunctionInvalidError) as refused:
        check_input("CreateFunction", {**GOOD, "Environment": {"Variables": {"PASSWORD": 7, "OTHER": "hunter2" * 999}}})
    assert "hunter2" not in str(refused.value)


def test_numbers_that_are_none() -> None:
    shape = model().operation_model("CreateAlias").input_shape
    asked = {"FunctionName": "f", "Name": "a", "FunctionVersion": "1"}
    for weight, fits in ((0.5, True), (1, True), (1.5, False), (float("nan"), False), ("x", False)):
        routing = {"RoutingConfig": {"AdditionalVersionWeights": {"2": weight}}}
        assert bool(list(faults_of({**asked, **routing}, shape))) is not fits


def test_a_pattern_is_not_tried_on_endless_text() -> None:
    shape = model().operation_model("ListEventSourceMappings").input_shape
    assert list(faults_of({"EventSourceArn": "arn:" + "a" * 1_000_000}, shape))
