"""Attachments: 33 bytes, the 77 bytes of older releases, and nothing else."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from metaros.errors import AttachmentError
from metaros.wire import Attachment, pack_attachment, parse_attachment

SEQ = st.integers(0, 2**63 - 1)
GID = st.binary(min_size=16, max_size=16)


def old_form(seq: int, source_ns: int, gid: bytes) -> bytes:
    return (
        b"\x0fsequence_number" + struct.pack("<q", seq) + b"\x10source_timestamp" + struct.pack("<q", source_ns)
    ) + (b"\x0asource_gid\x10" + gid)


@given(SEQ, SEQ, GID)
def test_what_is_packed_is_read(seq, source_ns, gid):
    data = pack_attachment(seq, source_ns, gid)
    assert len(data) == 33
    assert parse_attachment(data) == Attachment(seq, source_ns, gid)


@given(SEQ, SEQ, GID)
def test_the_form_of_older_releases_is_read(seq, source_ns, gid):
    data = old_form(seq, source_ns, gid)
    assert len(data) == 77
    assert parse_attachment(data) == Attachment(seq, source_ns, gid)


@given(st.one_of(st.binary(max_size=80), st.binary(min_size=33, max_size=33), st.binary(min_size=77, max_size=77)))
def test_any_bytes_are_an_attachment_or_an_attachment_error(data):
    try:
        attachment = parse_attachment(data)
    except AttachmentError:
        return
    assert attachment.seq >= 0
    assert attachment.source_ns >= 0
    assert len(attachment.gid) == 16


@pytest.mark.parametrize("cut", [0, 1, 16, 32])
def test_a_truncated_attachment_is_refused(cut):
    with pytest.raises(AttachmentError, match="33 are required"):
        parse_attachment(pack_attachment(1, 2, bytes(16))[:cut])


def test_negative_numbers_are_refused_both_ways():
    with pytest.raises(AttachmentError, match="negative"):
        parse_attachment(struct.pack("<qqB", -1, 1, 16) + bytes(16))
    with pytest.raises(AttachmentError, match="negative"):
        parse_attachment(old_form(1, -1, bytes(16)))
    with pytest.raises(AttachmentError, match="int64"):
        pack_attachment(-1, 1, bytes(16))
    with pytest.raises(AttachmentError, match="gid"):
        pack_attachment(1, 1, b"short")


def test_an_old_form_with_other_names_is_refused():
    with pytest.raises(AttachmentError, match="old"):
        parse_attachment(old_form(1, 1, bytes(16)).replace(b"source_gid", b"source_gix"))
