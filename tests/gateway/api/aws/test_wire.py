"""Requests become members: from the path, the query, headers and the body; large zip files go by way of files."""

from __future__ import annotations

import base64
import json
import os
from pathlib import Path
from typing import Any

import pytest

from gateway.api.aws.wire import read_members, split_zip
from gateway.functions.errors import FunctionInvalidError, PayloadInvalidError


def test_members_come_from_everywhere() -> None:
    headers = {"x-amz-invocation-type": "Event", "x-amz-log-type": "Tail", "accept": "x"}
    members = read_members("Invoke", {"FunctionName": "f"}, "Qualifier=%24LATEST", headers, b"{}")
    assert members == {
        "FunctionName": "f",
        "Qualifier": "$LATEST",
        "InvocationType": "Event",
        "LogType": "Tail",
        "Payload": b"{}",
    }
    untag = read_members("UntagResource", {"Resource": "r"}, "tagKeys=a&tagKeys=b%20c", {}, b"")
    assert untag == {"Resource": "r", "TagKeys": ["a", "b c"]}
    assert read_members("GetLayerVersion", {"LayerName": "l", "VersionNumber": "7"}, "", {}, b"")["VersionNumber"] == 7
    assert read_members("ListFunctions", {}, "MaxItems=3&Marker=", {}, b"") == {"MaxItems": 3, "Marker": ""}


def test_a_body_cannot_say_what_the_path_says() -> None:
    body = json.dumps({"FunctionName": "other", "Timeout": 5, "Description": None}).encode()
    members = read_members("UpdateFunctionConfiguration", {"FunctionName": "f"}, "", {}, body)
    assert members == {"FunctionName": "f", "Timeout": 5}


def test_code_is_decoded() -> None:
    text = base64.b64encode(b"zip").decode()
    body = json.dumps({"FunctionName": "f", "Code": {"ZipFile": text}}).encode()
    assert read_members("CreateFunction", {}, "", {}, body)["Code"] == {"ZipFile": b"zip"}
    body = json.dumps({"ZipFile": text}).encode()
    assert read_members("UpdateFunctionCode", {"FunctionName": "f"}, "", {}, body)["ZipFile"] == b"zip"


@pytest.mark.parametrize(
    ("operation", "query", "body", "error"),
    [
        ("ListFunctions", "MaxItems=many", b"", FunctionInvalidError),
        ("CreateFunction", "", b"{", PayloadInvalidError),
        ("CreateFunction", "", b"[]", PayloadInvalidError),
        ("CreateFunction", "", b'{"Code": {"ZipFile": "%%%"}}', FunctionInvalidError),
        ("CreateFunction", "", '{"Code": {"ZipFile": "é"}}'.encode(), FunctionInvalidError),
    ],
)
def test_what_cannot_be_read_is_refused(operation: str, query: str, body: bytes, error: type[Exception]) -> None:
    with pytest.raises(error):
        read_members(operation, {}, query, {}, body)


@pytest.mark.parametrize(
    "make", [lambda text: {"Code": {"ZipFile": text}, "Description": '"ZipFile": "x"'}, lambda text: {"ZipFile": text}]
)
def test_a_large_zip_file_becomes_a_file(tmp_path: Path, make: Any) -> None:
    data = os.urandom(9 << 20)
    body, target = tmp_path / "body", tmp_path / "code.zip"
    body.write_text(json.dumps(make(base64.b64encode(data).decode())))
    document = split_zip(body, target)
    assert target.read_bytes() == data
    assert document == make(target)
    body.write_text(body.read_text().replace("/", "\\/"))
    split_zip(body, target)
    assert target.read_bytes() == data


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("{}", PayloadInvalidError),
        ('{"ZipFile": "AAAA", "Code": {"ZipFile": "AAAA"}}', PayloadInvalidError),
        ('{"ZipFile": "A"}', FunctionInvalidError),
        ('{"ZipFile": "AA*A"}', FunctionInvalidError),
        ('{"ZipFile": "AAAA"', PayloadInvalidError),
        ('{"ZipFile": "AAAA', PayloadInvalidError),
        (f'{{"ZipFile": "AAAA", "X": [{"1," * 200_000}1]}}', PayloadInvalidError),
        (f'{{"X": [{"1," * 200_000}1], "ZipFile": "AAAA"}}', PayloadInvalidError),
    ],
)
def test_a_large_body_that_cannot_be_read(tmp_path: Path, text: str, error: type[Exception]) -> None:
    (tmp_path / "body").write_text(text)
    with pytest.raises(error):
        split_zip(tmp_path / "body", tmp_path / "code.zip")
