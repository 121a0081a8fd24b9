"""The ledger on both databases and both object stores: no crash leaves an object that nobody knows."""

from __future__ import annotations

import hashlib
import io
from pathlib import Path

import pytest

from gateway.errors import ObjectStoreError, StoreError, UnstorableError
from gateway.store.engine import StoreEngine
from gateway.store.ledger import announce, doom, in_transaction, refresh, stored, sweep_objects
from gateway.store.objects import DirectoryStore, ObjectStore

S = 10**9
START_NS = 1_700_000_000 * S
SHA = hashlib.sha256(b"data").hexdigest()


def put(objects: ObjectStore, name: str) -> None:
    """Upload four bytes."""
    objects.put(name, io.BytesIO(b"data"), size_bytes=4, sha256=SHA)


def rows(engine: StoreEngine) -> dict[str, str]:
    """State by name."""
    with engine.transaction(write=False):
        return {row[0]: row[1] for row in engine.fetch("SELECT name, state FROM objects ORDER BY name")}


def names(objects: ObjectStore) -> list[str]:
    """What the store holds."""
    return sorted(info.name for info in objects.names())


def test_an_objects_life(engine: StoreEngine, objects: ObjectStore) -> None:
    run = in_transaction(engine)
    run(lambda e: announce(e, "a", kind="segment", now_ns=START_NS))
    put(objects, "a")
    run(lambda e: refresh(e, "a", START_NS + 1))
    run(lambda e: stored(e, "a", size_bytes=4, sha256=SHA, now_ns=START_NS + 2))
    assert sweep_objects(run, objects, now_ns=START_NS + 10_000 * S) == 0
    assert (rows(engine), names(objects)) == ({"a": "stored"}, ["a"])
    run(lambda e: doom(e, "a", START_NS + 3))
    assert sweep_objects(run, objects, now_ns=START_NS + 3) == 1
    assert (rows(engine), names(objects)) == ({}, [])
    with pytest.raises(StoreError):
        run(lambda e: stored(e, "a", size_bytes=4, sha256=SHA, now_ns=START_NS))
    with pytest.raises(StoreError):
        run(lambda e: refresh(e, "a", START_NS))


def test_a_name_is_announced_once(engine: StoreEngine) -> None:
    run = in_transaction(engine)
    run(lambda e: announce(e, "a", kind="segment", now_ns=START_NS))
    with pytest.raises(UnstorableError):
        run(lambda e: announce(e, "a", kind="recording", now_ns=START_NS))
    run(lambda e: stored(e, "a", size_bytes=4, sha256=SHA, now_ns=START_NS))
    with pytest.raises(StoreError):
        run(lambda e: stored(e, "a", size_bytes=4, sha256=SHA, now_ns=START_NS))


def test_a_lost_uploader_leaves_nothing_even_when_it_was_only_slow(engine: StoreEngine, objects: ObjectStore) -> None:
    run = in_transaction(engine)
    run(lambda e: announce(e, "a", kind="segment", now_ns=START_NS))
    assert sweep_objects(run, objects, now_ns=START_NS + 600 * S) == 0
    assert rows(engine) == {"a": "uploading"}
    given_up_ns = START_NS + 601 * S
    assert sweep_objects(run, objects, now_ns=given_up_ns) == 0
    assert rows(engine) == {"a": "doomed"}
    put(objects, "a")  # the upload ends after all, and finds that it was given up
    with pytest.raises(StoreError, match="given up"):
        run(lambda e: stored(e, "a", size_bytes=4, sha256=SHA, now_ns=given_up_ns))
    assert sweep_objects(run, objects, now_ns=given_up_ns + 599 * S) == 0
    assert sweep_objects(run, objects, now_ns=given_up_ns + 600 * S) == 1
    assert (rows(engine), names(objects)) == ({}, [])


def test_an_upload_that_failed_may_end_all_the_same(engine: StoreEngine, objects: ObjectStore) -> None:
    run = in_transaction(engine)
    run(lambda e: announce(e, "a", kind="segment", now_ns=START_NS))
    run(lambda e: doom(e, "a", START_NS))
    assert sweep_objects(run, objects, now_ns=START_NS + 599 * S) == 0
    put(objects, "a")
    run(lambda e: doom(e, "a", START_NS + 500 * S))  # once more changes nothing
    assert sweep_objects(run, objects, now_ns=START_NS + 600 * S) == 1
    assert (rows(engine), names(objects)) == ({}, [])


def test_a_refreshed_upload_is_nobodys_business(engine: StoreEngine, objects: ObjectStore) -> None:
    run = in_transaction(engine)
    run(lambda e: announce(e, "a", kind="segment", now_ns=START_NS))
    for minute in range(5, 60, 5):
        run(lambda e, at=START_NS + minute * 60 * S: refresh(e, "a", at))  # type: ignore[misc]
        assert sweep_objects(run, objects, now_ns=START_NS + (minute + 9) * 60 * S) == 0
    assert rows(engine) == {"a": "uploading"}


def test_a_sweep_that_fails_half_way_goes_on_later(engine: StoreEngine, tmp_path: Path) -> None:
    class Failing(DirectoryStore):
        """Deletes one object, then is gone."""

        left = 1

        def delete(self, name: str) -> None:
            """Once."""
            if not self.left:
                raise ObjectStoreError("gone")
            self.left -= 1
            super().delete(name)

    run = in_transaction(engine)
    objects = Failing(tmp_path / "objects")
    for position, name in enumerate("abc"):
        run(lambda e, name=name: announce(e, name, kind="segment", now_ns=START_NS))  # type: ignore[misc]
        put(objects, name)
        run(lambda e, name=name: stored(e, name, size_bytes=4, sha256=SHA, now_ns=START_NS))  # type: ignore[misc]
        run(lambda e, name=name, at=START_NS + position: doom(e, name, at))  # type: ignore[misc]
    with pytest.raises(ObjectStoreError):
        sweep_objects(run, objects, now_ns=START_NS + 9)
    assert (rows(engine), names(objects)) == ({"b": "doomed", "c": "doomed"}, ["b", "c"])
    objects.left = 9
    assert sweep_objects(run, objects, now_ns=START_NS + 9) == 2
    assert (rows(engine), names(objects)) == ({}, [])
