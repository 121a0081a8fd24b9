"""Random types: compiled and reference codec agree, both byte orders; damaged bytes are a value or `DecodeError`."""

from __future__ import annotations

import contextlib
import math
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from metaros.cdr import Codec, codec, field_reader
from metaros.cdr.decoder import build_fast_decoder
from metaros.cdr.encoder import build_encoder
from metaros.cdr.reference import ReferenceDecoder, ReferenceEncoder
from metaros.errors import DecodeError
from metaros.idl import Catalogue, FieldType
from metaros.idl.arrays import DTYPES
from tests.metaros.cdr.strategies import catalogues, messages

NAME = "p/msg/M2"
QUICK = settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))


def reference_bytes(message: Any, catalogue: Catalogue) -> bytes:
    encoder = ReferenceEncoder(catalogue)
    encoder.message(catalogue.message(NAME), message, "")
    return b"\0\1\0\0" + bytes(encoder.body)


def big_endian(message: Any, catalogue: Catalogue) -> bytes:
    """The bytes of a big-endian sender, by the reference encoder in the other order."""
    encoder = ReferenceEncoder(catalogue, order=">")
    encoder.message(catalogue.message(NAME), message, "")
    return b"\0\0\0\0" + bytes(encoder.body)


@QUICK
@given(catalogues(), st.data())
def test_round_trip(catalogue: Catalogue, data: st.DataObject) -> None:
    message = data.draw(messages(NAME, catalogue))
    compiled = codec(NAME, catalogue)
    encoded = compiled.encode(message)
    assert encoded == reference_bytes(message, catalogue)
    assert compiled.decode(encoded) == message
    assert compiled.decode(memoryview(encoded)) == message
    assert compiled.decode(bytearray(encoded) + bytes(3)) == message
    assert compiled.decode(big_endian(message, catalogue)) == message
    found = ReferenceDecoder(catalogue, memoryview(encoded)[4:], order="<").message(catalogue.message(NAME), "")
    assert found == message
    assert compiled.encode(compiled.decode(encoded)) == encoded


def never(_: Any) -> Any:
    raise AssertionError("good input was handed to the slow codec")


@QUICK
@given(catalogues(), st.data())
def test_good_input_stays_on_the_fast_path(catalogue: Catalogue, data: st.DataObject) -> None:
    message = data.draw(messages(NAME, catalogue))
    encoded = build_encoder(NAME, catalogue, never)(message)
    assert build_fast_decoder(NAME, catalogue, never)(encoded) == message


@QUICK
@given(catalogues(), st.data())
def test_field_readers_read_what_the_decoder_decodes(catalogue: Catalogue, data: st.DataObject) -> None:
    message = data.draw(messages(NAME, catalogue))
    known = list(numeric_paths(FieldType(NAME), "", catalogue))
    paths = data.draw(st.lists(st.sampled_from(known), max_size=4)) if known else []
    encoded = codec(NAME, catalogue).encode(message)
    read = field_reader(NAME, paths, catalogue)
    for bytes_ in (encoded, memoryview(encoded), big_endian(message, catalogue)):
        for path, value in zip(paths, read(bytes_), strict=True):
            expected = look_up(message, path)
            assert value == expected or (math.isnan(expected) and math.isnan(value)), path


def numeric_paths(kind: FieldType, path: str, catalogue: Catalogue) -> Any:
    if kind.array:
        for index in range(min(kind.capacity or 3, 3)):
            yield from numeric_paths(kind.element, f"{path}[{index}]", catalogue)
    elif kind.is_nested:
        for field in catalogue.message(kind.base).fields:
            yield from numeric_paths(field.type, f"{path}.{field.name}" if path else field.name, catalogue)
    elif kind.base in DTYPES:
        yield path


def look_up(message: Any, path: str) -> float:
    value = message
    for part in path.replace("]", "").replace("[", ".").split("."):
        if part.isdigit():
            if int(part) >= len(value):
                return math.nan
            value = value[int(part)]
        else:
            value = getattr(value, part)
    return float(value)


def decode_or_refuse(compiled: Codec, damaged: bytes) -> None:
    with contextlib.suppress(DecodeError):
        message = compiled.decode(damaged)
        assert type(message).__metaros_name__ == NAME


@QUICK
@given(catalogues(), st.data())
def test_damaged_bytes(catalogue: Catalogue, data: st.DataObject) -> None:
    compiled = codec(NAME, catalogue)
    encoded = compiled.encode(data.draw(messages(NAME, catalogue)))
    known = list(numeric_paths(FieldType(NAME), "", catalogue))[:8]
    read = field_reader(NAME, known, catalogue)
    for _ in range(8):
        damaged = bytearray(encoded[: data.draw(st.integers(0, len(encoded)))] if data.draw(st.booleans()) else encoded)
        for _ in range(data.draw(st.integers(0, 3)) if damaged else 0):
            damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.sampled_from([0, 1, 127, 255]))
        decode_or_refuse(compiled, bytes(damaged))
        with contextlib.suppress(DecodeError):
            read(bytes(damaged))


@QUICK
@given(catalogues(), st.lists(st.binary(max_size=64), min_size=1, max_size=10))
def test_random_bytes(catalogue: Catalogue, tails: list[bytes]) -> None:
    compiled = codec(NAME, catalogue)
    for tail in tails:
        for header in (b"", b"\0\1\0\0", b"\0\0\0\0"):
            decode_or_refuse(compiled, header + tail)


@QUICK
@given(catalogues(), st.data())
def test_truncation_is_always_found(catalogue: Catalogue, data: st.DataObject) -> None:
    compiled = codec(NAME, catalogue)
    encoded = compiled.encode(data.draw(messages(NAME, catalogue)))
    for size in range(len(encoded)):
        try:
            compiled.decode(encoded[:size])
        except DecodeError:
            continue
        raise AssertionError(f"{size} of {len(encoded)} bytes were accepted")
