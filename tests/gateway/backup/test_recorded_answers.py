"""A hundred questions to a gateway; its backup; everything deleted and restored; the same questions again."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from gateway.objects import open_objects
from tests.gateway.backup.populated import answers, populate, questions
from tests.gateway.harness import client, running_gateway
from tests.support.command_line import ask_metaros
from tests.support.postgres import PostgresServer

pytestmark = pytest.mark.integration


async def metaros(*words: str | Path) -> tuple[int, str]:
    """Run it beside everything else; exit code and what it printed."""
    done = await ask_metaros(*map(str, words))
    return done.code, done.out + done.err


def wipe(folder: Path, objects: str) -> None:
    """Nothing is left of the store on this machine, and nothing in the object store."""
    kept = open_objects(objects, folder / "data")
    for info in list(kept.names()):
        kept.delete(info.name)
    kept.close()
    shutil.rmtree(folder / "data")


async def there_and_back(folder: Path, *, store: str = "", again: str = "", objects: str = "") -> None:
    """All of it: `store` and `objects` are the gateway's, `again` is the database where it comes to life again.

    While it is asked nobody watches the robots, as alerts go on by the clock.
    """
    backup, at, back = folder / "backup", ["--store", store] * bool(store), ["--store", again] * bool(again)
    kept = ["--objects", objects] * bool(objects)
    span = await populate(folder, store_url=store, objects_url=objects)
    assert (await metaros("gateway", "store", "compact", "--data-dir", folder / "data", *at, *kept))[0] == 0
    async with running_gateway(folder, store_url=store, objects_url=objects, alerts=False) as ready:
        async with client(ready, key=(ready.data_dir / "local.key").read_text().strip()) as http:
            alerts = [one["id"] for one in (await http.get("/api/v1/alerts")).json()["alerts"]]
            recordings = [one["id"] for one in (await http.get("/api/v1/recordings")).json()["recordings"]]
        asked = questions(recordings, alerts, span)
        before = await answers(ready, asked)
        taken = await metaros("gateway", "backup", "take", backup, "--data-dir", folder / "data", *at, *kept)
        assert taken[0] == 0, taken[1]
        assert "master.key is not in it" in taken[1]
    assert len(set(asked)) >= 100
    assert {status for status, _ in before.values()} == {200}
    assert backup.stat().st_mode & 0o077 == 0
    assert not [path for path in backup.rglob("*") if path.is_file() and path.stat().st_mode & 0o077]
    assert (await metaros("gateway", "backup", "verify", backup))[0] == 0
    key = (folder / "data" / "master.key").read_bytes()
    wipe(folder, objects)
    (folder / "data").mkdir(mode=0o700)
    (folder / "data" / "master.key").write_bytes(key)
    (folder / "data" / "master.key").chmod(0o600)
    code, said = await metaros("gateway", "backup", "restore", backup, "--data-dir", folder / "data", *back, *kept)
    assert code == 0, said
    async with running_gateway(folder, store_url=again, objects_url=objects, alerts=False) as ready:
        after = await answers(ready, asked)
    for path in asked:
        assert after[path] == before[path], path
    for words in (("gateway", "store", "check", "--deep"), ("audit", "verify")):
        code, said = await metaros(*words, "--data-dir", folder / "data", *back, *kept, "--output", "json")
        assert code == 0, said
        assert json.loads(said).get("orphans", []) == []


async def test_from_a_file_into_postgresql(tmp_path: Path, postgres: PostgresServer) -> None:
    await there_and_back(tmp_path, again=postgres.schema(empty=True))


async def test_from_postgresql_and_s3_into_a_file(
    tmp_path: Path, postgres: PostgresServer, s3_url: Callable[..., str]
) -> None:
    await there_and_back(tmp_path, store=postgres.schema(), objects=s3_url())
