"""The stream table beside a store that others write to, and that may go back."""

from __future__ import annotations

from gateway.ingest.streams import StreamTable
from metaros._proto import link_pb2


def test_what_another_gateway_stored_is_taken_over() -> None:
    table = StreamTable({(1, 5): 10}, writers={5: "a"})
    table.refresh({(1, 5): 20, (2, 5): 3}, {5: "b", 6: "c"})
    assert table.known() == {(1, 5): 20, (2, 5): 3}
    assert (table.accepted(1, 5), table.stored(2, 5)) == (20, 3)
    assert table.writers == {5: "b", 6: "c"}


def test_a_writer_on_its_way_to_the_store_is_not_forgotten() -> None:
    table = StreamTable({}, writers={5: "a"})
    table.writers[5] = "b"
    table.refresh({}, {5: "a"})
    assert table.writers == {5: "b"}


def test_a_read_may_be_newer_than_a_commit_that_is_reported_late() -> None:
    table = StreamTable({(1, 5): 10})
    table.refresh({(1, 5): 20}, {})
    assert table.confirm(1, 5, 15)
    assert table.stored(1, 5) == 20
    assert not table.confirm(1, 5, 14)  # but our own commits never go back


def test_a_base_is_nothing_that_the_store_has() -> None:
    table = StreamTable({})
    table.begin([link_pb2.StreamState(stream_id=1, epoch=5, first_seq=9, last_seq=20, base_seq=8)])
    assert (table.stored(1, 5), table.base(1, 5), table.known()) == (8, 8, {})
    assert table.confirm(1, 5, 12)
    assert table.known() == {(1, 5): 12}
