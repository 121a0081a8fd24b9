"""`metaros gateway store` beside a store that a gateway has left."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from gateway.store.commit import Committer
from gateway.store.objects import DirectoryStore
from gateway.store.sqlite import SqliteEngine
from tests.gateway.store.samples import gap_write, run_write
from tests.support.processes.command_line import Done, call_metaros, program
from tests.support.processes.processes import END_S, started


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A data directory with some messages, none of them compacted."""
    engine = SqliteEngine(tmp_path)
    engine.open()
    bulk = run_write(1, [b"s" * 1000] * 9, stream_id=8, topic="/scan", delivery="bulk")
    Committer(engine).commit([run_write(1, [b"one", b"two"]), gap_write(3, 4), bulk], now_ns=10**18)
    engine.close()
    return tmp_path


def store(folder: Path, command: str, *options: str) -> Done:
    """Run it."""
    return call_metaros("gateway", "store", command, "--data-dir", str(folder), *options)


def test_compact_then_check_then_damage(folder: Path) -> None:
    with started(program("gateway", "store", "compact", "--data-dir", str(folder))) as process:
        assert process.communicate(timeout=END_S) == ("2 batches into 2 segments, 0 objects deleted\n", "")
    assert process.returncode == 0
    code, out, err = store(folder, "check", "--deep")
    assert (code, err) == (0, "")
    assert "nothing is damaged" in out
    (path,) = [path for path in (folder / "objects").rglob("*.mcap") if b"/scan" in path.read_bytes()]
    path.write_bytes(path.read_bytes()[:100])
    objects = DirectoryStore(folder / "objects")
    objects.put("segments/x", io.BytesIO(b"x"), size_bytes=1, sha256=hashlib.sha256(b"x").hexdigest())
    code, out, _ = store(folder, "check", "--output", "json")
    document = json.loads(out)
    assert (code, document["orphans"], document["deleted_orphans"]) == (1, ["segments/x"], 0)
    (damage,) = document["damaged"]
    assert (damage["robot"], damage["topic"], folder / "objects" / damage["object"]) == ("r1", "/scan", path)
    code, out, _ = store(folder, "check", "--delete-orphans")
    assert (code, "1 orphan deleted" in out, "/scan" in out) == (1, True, True)
    assert not (folder / "objects" / "segments" / "x").exists()
    code, out, _ = store(folder, "stats", "--output", "json")
    document = json.loads(out)
    assert [item["topic"] for item in document["damaged"]] == ["/scan"]
    assert document["checked"] is not None


def test_stats_and_retention(folder: Path) -> None:
    code, out, _ = store(folder, "stats")
    assert code == 0
    assert all(word in out for word in ("bulk", "r1", "sample_batches", "total", "disk", "4.29 GB"))
    code, out, _ = store(folder, "retention", "--dry-run")
    assert (code, "would go, and 1 records" in out) == (0, True)
    code, out, _ = store(folder, "retention", "--dry-run", "--retention-days", "1e6", "--event-retention-days", "1e6")
    assert (code, out) == (0, "nothing is too old or too much\n")
    code, out, _ = store(folder, "retention", "--retention", "event=99999d", "--output", "json")
    document = json.loads(out)
    assert [(item["class"], item["why"], item["count"]) for item in document["items"]] == [("bulk", "age", 1)]
    code, out, _ = store(folder, "check")
    assert (code, "nothing is damaged" in out) == (0, True)


def test_nothing_is_deleted_in_the_objects_of_another_store(folder: Path, tmp_path: Path) -> None:
    assert store(folder, "compact")[0] == 0
    objects = DirectoryStore(tmp_path / "others")
    objects.put("segments/x", io.BytesIO(b"x"), size_bytes=1, sha256=hashlib.sha256(b"x").hexdigest())
    for command in (("check", "--delete-orphans"), ("compact",), ("retention",)):
        code, _, err = store(folder, *command, "--objects", (tmp_path / "others").as_uri())
        assert (code, "is not the object store" in err) == (1, True), command
    assert [info.name for info in objects.names()] == ["segments/x"]


@pytest.mark.integration
def test_objects_in_s3(folder: Path, s3_url: Callable[..., str], monkeypatch: pytest.MonkeyPatch) -> None:
    url = s3_url()
    assert store(folder, "compact", "--objects", url)[0] == 0
    assert not (folder / "objects").exists()
    code, out, _ = store(folder, "check", "--deep", "--objects", url)
    assert (code, "3 objects" in out, "nothing is damaged" in out) == (0, True, True)
    code, out, _ = store(folder, "check")  # looked for in the wrong place
    assert (code, "missing" in out) == (1, True)
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "not-the-secret")
    code, _, err = store(folder, "check", "--objects", url)
    assert (code, "SignatureDoesNotMatch" in err, "not-the-secret" in err) == (1, True, False)


def test_there_must_be_a_store(tmp_path: Path) -> None:
    code, _, err = store(tmp_path / "none", "stats")
    assert (code, "there is no store" in err) == (2, True)
    assert not (tmp_path / "none").exists()
    code, _, err = store(tmp_path, "stats", "--retention", "bulk")
    assert (code, "CLASS=AGE,SIZE" in err) == (2, True)
