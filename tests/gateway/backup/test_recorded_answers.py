"""A hundred questions to a gateway; its backup; everything deleted and restored; the same questions again."""

from __future__ import annotations

import asyncio
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from gateway.store.engines import open_engine
from gateway.store.objects import open_objects
from gateway.store.telemetry.merge import merge_step
from tests.gateway.backup.populated import answers, populate, questions
from tests.gateway.harness import client, running_gateway
from tests.support.processes.command_line import ask_metaros
from tests.support.servers.postgres import PostgresServer

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


def settle(store: str, folder: Path) -> None:
    """Rows that wait to be merged are, as the gateway does some seconds later: they take other room then."""
    engine, _ = open_engine(store, folder / "data")
    while merge_step(engine, max_batches=100):
        pass
    engine.close()


def open_to_others(backup: Path) -> list[Path]:
    """What others than its owner may look at."""
    files = (path for path in backup.rglob("*") if path.is_file())
    return [path for path in (backup, *files) if path.stat().st_mode & 0o077]


async def backed_up(folder: Path, backup: Path, *where: str) -> None:
    """A good backup, for nobody else's eyes."""
    code, said = await metaros("gateway", "backup", "take", backup, "--data-dir", folder / "data", *where)
    assert code == 0, said
    assert "master.key is not in it" in said
    assert open_to_others(backup) == []
    assert (await metaros("gateway", "backup", "verify", backup))[0] == 0


async def restored(folder: Path, backup: Path, objects: str, *where: str) -> None:
    """Everything is deleted but the key, and comes back."""
    key = (folder / "data" / "master.key").read_bytes()
    wipe(folder, objects)
    (folder / "data").mkdir(mode=0o700)
    (folder / "data" / "master.key").write_bytes(key)
    (folder / "data" / "master.key").chmod(0o600)
    code, said = await metaros("gateway", "backup", "restore", backup, "--data-dir", folder / "data", *where)
    assert code == 0, said


async def check_answers(
    folder: Path, asked: list[str], before: dict[str, tuple[int, bytes]], objects: str, store: str = ""
) -> None:
    """The same questions have the same answers, and nothing is damaged."""
    async with running_gateway(folder, store_url=store, objects_url=objects, alerts=False) as ready:
        after = await answers(ready, asked)
    for path in asked:
        assert after[path] == before[path], path
    where = [*("--objects", objects), *(("--store", store) if store else ())]
    for words in (("gateway", "store", "check", "--deep"), ("audit", "verify")):
        code, said = await metaros(*words, "--data-dir", folder / "data", *where, "--output", "json")
        assert code == 0, said
        assert json.loads(said).get("orphans", []) == []


async def test_from_postgresql_into_a_file_and_back_with_objects_in_s3(
    tmp_path: Path, postgres: PostgresServer, s3_url: Callable[..., str]
) -> None:
    """While it is asked nobody watches the robots, as alerts go on by the clock."""
    store, again, objects = postgres.schema(), postgres.schema(empty=True), s3_url()
    kept, first, second = ("--objects", objects), tmp_path / "first", tmp_path / "second"
    span = await populate(tmp_path, store_url=store, objects_url=objects)
    data = ("--data-dir", tmp_path / "data")
    assert (await metaros("gateway", "store", "compact", *data, "--store", store, *kept))[0] == 0
    await asyncio.to_thread(settle, store, tmp_path)
    async with running_gateway(tmp_path, store_url=store, objects_url=objects, alerts=False) as ready:
        async with client(ready, key=(ready.data_dir / "local.key").read_text().strip()) as http:
            alerts = [one["id"] for one in (await http.get("/api/v1/alerts")).json()["alerts"]]
            recordings = [one["id"] for one in (await http.get("/api/v1/recordings")).json()["recordings"]]
        asked = questions(recordings, alerts, span)
        before = await answers(ready, asked)
        await backed_up(tmp_path, first, "--store", store, *kept)
    assert len(set(asked)) >= 100
    assert {status for status, _ in before.values()} == {200}
    await restored(tmp_path, first, objects, *kept)
    await check_answers(tmp_path, asked, before, objects)
    await backed_up(tmp_path, second, *kept)
    await restored(tmp_path, second, objects, "--store", again, *kept)
    await check_answers(tmp_path, asked, before, objects, store=again)
