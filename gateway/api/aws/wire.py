"""Requests and answers of the Lambda API: members from path, query, headers and body, and back, by botocore's model."""

from __future__ import annotations

import base64
import binascii
import mmap
import re
from collections.abc import Callable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs

import orjson

from gateway.automation.functions.catalogue.shapes import model
from gateway.automation.functions.errors import FunctionInvalidError, PayloadInvalidError

__all__ = ["read_members", "split_zip"]

_ZIP = re.compile(rb'(?<!\\)"ZipFile"\s*:\s*"')
_AROUND_BYTES = 256 << 10  # of the document around a zip file: it is parsed at one go
_PIECE_BYTES = 256 << 10  # looked through or decoded at a time: on a thread, but nothing else runs meanwhile
_TRUE = {"true": True, "false": False}


def read_members(
    operation: str, uri: Mapping[str, str], query: str, headers: Mapping[str, str], body: Any
) -> dict[str, Any]:
    """What is asked, by the names of the model's members; `body` is bytes, or a document that was read already.

    Raises:
        FunctionInvalidError: a number in the path or query is none.
        PayloadInvalidError: the body is no JSON object.
    """
    shape = model().operation_model(operation).input_shape
    if shape is None:
        return {}
    said = parse_qs(query, keep_blank_values=True)
    payload = shape.serialization.get("payload")
    members: dict[str, Any] = {}
    for name, member in shape.members.items():
        place, key = member.serialization.get("location"), member.serialization.get("name", name)
        if place == "uri":
            members[name] = _scalar(name, uri[key], member.type_name)
        elif place == "querystring" and key in said:
            values = said[key]
            members[name] = values if member.type_name == "list" else _scalar(name, values[-1], member.type_name)
        elif place == "header" and key.lower() in headers:
            members[name] = headers[key.lower()]
    if payload is not None:
        members[payload] = body
        return members
    document = _object(body) if isinstance(body, bytes) else body
    inside = {name for name, member in shape.members.items() if not member.serialization.get("location")}
    located = set(shape.members) - inside
    members |= {name: value for name, value in document.items() if value is not None and name not in located}
    _decode_blobs(members)
    return members


def split_zip(body: Path, target: Path) -> dict[str, Any]:
    """A large body's document, with its zip file written to `target`, which stands in its place; blocks.

    Raises:
        PayloadInvalidError: it is no JSON object, has more than one zip file, or much beside it.
        FunctionInvalidError: the zip file is no base64.
    """
    with body.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as text:
        start, end = _place_of_zip(text)
        rest = b""
        with target.open("wb") as zipped:
            for at in range(start, end, _PIECE_BYTES):
                rest += text[at : min(at + _PIECE_BYTES, end)].replace(b"\\", b"")  # some write "/" as "\\/"
                whole = len(rest) // 4 * 4
                zipped.write(_decoded(rest[:whole]))
                rest = rest[whole:]
            zipped.write(_decoded(rest))
        document = _object(text[:start] + text[end:])
    holder = next((value for value in document.values() if isinstance(value, dict) and "ZipFile" in value), document)
    holder["ZipFile"] = target
    return document


def _place_of_zip(text: mmap.mmap) -> tuple[int, int]:
    """Where the one zip file begins and ends. It is looked for in the document's beginning and in its end only."""
    found = _ZIP.search(text, 0, _AROUND_BYTES)
    start = found.end() if found else len(text)
    pieces = range(start, len(text), _PIECE_BYTES)
    end = next((at for piece in pieces if (at := text.find(b'"', piece, piece + _PIECE_BYTES)) >= 0), len(text))
    if start + len(text) - end > _AROUND_BYTES or found is None or _ZIP.search(text, end):
        raise PayloadInvalidError(
            "the body of a large request is a JSON object with one ZipFile, and at most"
            f" {_AROUND_BYTES} bytes around it"
        )
    return start, end


def _decode_blobs(members: dict[str, Any]) -> None:
    """Zip files are the only bytes in a body."""
    for holder in (members, members.get("Code"), members.get("Content")):
        if isinstance(holder, dict) and isinstance(holder.get("ZipFile"), str):
            holder["ZipFile"] = _decoded(holder["ZipFile"].encode("utf-8", "surrogatepass"))


def _decoded(text: bytes) -> bytes:
    try:
        return base64.b64decode(text, validate=True)
    except binascii.Error as error:
        raise FunctionInvalidError(f"ZipFile is no base64: {error}") from error


def _object(body: bytes) -> dict[str, Any]:
    if not body:
        return {}
    try:
        document = orjson.loads(body)
    except orjson.JSONDecodeError as error:
        raise PayloadInvalidError(f"Could not parse request body into json: {error}") from error
    if not isinstance(document, dict):
        raise PayloadInvalidError("Could not parse request body into json: an object is wanted")
    return document


def _scalar(name: str, text: str, kind: str) -> Any:
    try:
        return _SCALARS.get(kind, str)(text)
    except (ValueError, KeyError, OverflowError) as error:
        raise FunctionInvalidError(f"{name}: {text[:80]!r} is no {kind}") from error


_SCALARS: dict[str, Callable[[str], Any]] = {
    "integer": int,
    "long": int,
    "boolean": lambda text: _TRUE[text.lower()],
    "timestamp": datetime.fromisoformat,
}
