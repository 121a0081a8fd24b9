"""Requests become members: from the path, the query, headers and the body; large zip files go by way of files."""

from __future__ import annotations

import base64
import json
import os
from collections.abc import Callable
from pathlib import Path

from gateway.api.aws.wire import read_members, split_zip
from gateway.automation.functions.errors import FunctionInvalidError, PayloadInvalidError
from tests.support.tables import refusal


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


UNREADABLE: tuple[tuple[str, str, bytes, type[Exception]], ...] = (  # operation, query, body, how it is refused
    ("ListFunctions", "MaxItems=many", b"", FunctionInvalidError),
    ("CreateFunction", "", b"{", PayloadInvalidError),
    ("CreateFunction", "", b"[]", PayloadInvalidError),
    ("CreateFunction", "", b'{"Code": {"ZipFile": "%%%"}}', FunctionInvalidError),
    ("CreateFunction", "", '{"Code": {"ZipFile": "é"}}'.encode(), FunctionInvalidError),
)


def test_what_cannot_be_read_is_refused() -> None:
    for operation, query, body, error in UNREADABLE:
        assert refusal(error, read_members, operation, {}, query, {}, body), (operation, query, body)


def test_a_large_zip_file_becomes_a_file(tmp_path: Path) -> None:
    data = os.urandom(3 << 20)
    text = base64.b64encode(data).decode()
    body, target = tmp_path / "body", tmp_path / "code.zip"
    makes: tuple[Callable[[object], dict[str, object]], ...] = (
        lambda content: {"Code": {"ZipFile": content}, "Description": '"ZipFile": "x"'},
        lambda content: {"ZipFile": content},
    )
    for make in makes:
        body.write_text(json.dumps(make(text)))
        assert split_zip(body, target) == make(target)
        assert target.read_bytes() == data
        body.write_text(body.read_text().replace("/", "\\/"))
        split_zip(body, target)
        assert target.read_bytes() == data


LARGE: tuple[tuple[str, type[Exception]], ...] = (
    ("{}", PayloadInvalidError),
    ('{"ZipFile": "AAAA", "Code": {"ZipFile": "AAAA"}}', PayloadInvalidError),
    ('{"ZipFile": "A"}', FunctionInvalidError),
    ('{"ZipFile": "AA*A"}', FunctionInvalidError),
    ('{"ZipFile": "AAAA"', PayloadInvalidError),
    ('{"ZipFile": "AAAA', PayloadInvalidError),
    (f'{{"ZipFile": "AAAA", "X": [{"1," * 200_000}1]}}', PayloadInvalidError),
    (f'{{"X": [{"1," * 200_000}1], "ZipFile": "AAAA"}}', PayloadInvalidError),
)


def test_a_large_body_that_cannot_be_read(tmp_path: Path) -> None:
    for text, error in LARGE:
        (tmp_path / "body").write_text(text)
        assert refusal(error, split_zip, tmp_path / "body", tmp_path / "code.zip"), text[:80]
