"""The catalogue on both databases: what is committed is what is shown, to every gateway of the store."""

from __future__ import annotations

import asyncio
import random  # noqa: TID251 - seeded
from collections import Counter
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest

from gateway.automation.functions.catalogue.catalogue import Catalogue
from gateway.automation.functions.errors import (
    CodeStorageFullError,
    FunctionChangedError,
    FunctionConflictError,
    FunctionInvalidError,
    UnknownFunctionError,
)
from gateway.store import Store
from gateway.store.objects import DirectoryStore
from gateway.store.retention import Retention
from metaros.automation.functions.package import discard
from metaros.clock import ManualClock
from metaros.errors import PackageError
from metaros.limits import LIMITS, Limits
from tests.support.gateways.lambda_gateway import ROLE, zipped
from tests.support.servers.databases import on_both

Open = Callable[..., Any]


class Gateway:
    """A store with its catalogue."""

    def __init__(self, folder: Path, url: str, clock: ManualClock, *, objects: Path, **more: Any) -> None:
        self.store = Store(
            folder, clock=clock, retention=Retention(age_s=86_400.0, size_bytes=1 << 30), queue_bytes=1 << 20, url=url
        )
        self.in_use: set[Path] = set()
        self.objects = DirectoryStore(objects)
        self.catalogue = Catalogue(
            self.store, self.objects, folder / "code", clock=clock, in_use=lambda: self.in_use, **more
        )

    async def start(self) -> Catalogue:
        """Begin."""
        self.store.start()
        await self.catalogue.start()
        return self.catalogue


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
async def opened(tmp_path: Path, store_url: str, clock: ManualClock) -> AsyncIterator[Open]:
    """Starts gateways; where the database is a file, one after the other."""
    running: list[Gateway] = []

    async def start(name: str = "one", **more: Any) -> Gateway:
        gateway = Gateway(tmp_path / name, store_url, clock, objects=tmp_path / "objects", **more)
        running.append(gateway)
        await gateway.start()
        return gateway

    yield start
    for gateway in running:
        await gateway.store.close()


async def make(catalogue: Catalogue, name: str = "f", source: str = "", **members: Any) -> dict[str, Any]:
    """A function."""
    usual = {"Role": ROLE, "Runtime": "python3.12", "Handler": "app.handler"}
    code = {"Code": {"ZipFile": zipped(source or f"def handler(event, context):\n    return '{name}'\n")}}
    return await catalogue.do("CreateFunction", {"FunctionName": name, **usual, **code, **members})


@on_both
async def test_what_was_made_is_there_after_a_restart(opened: Open, tmp_path: Path) -> None:
    first = await opened()
    made = await make(first.catalogue, Environment={"Variables": {"MODE": "x"}}, Publish=True, Timeout=9)
    await first.catalogue.do("CreateAlias", {"FunctionName": "f", "Name": "live", "FunctionVersion": "1"})
    spec = await first.catalogue.spec("f", "1")
    assert ((spec.code_dir / "app.py").exists(), spec.environment, spec.timeout_s) == (True, {"MODE": "x"}, 9.0)
    await first.store.close()
    again = await opened()
    shown = await again.catalogue.do("GetFunctionConfiguration", {"FunctionName": "f", "Qualifier": "live"})
    assert shown == {**made, "FunctionArn": made["FunctionArn"].replace(":1", ":live")}
    assert (await again.catalogue.spec("f", "1")).key == spec.key


async def test_code_that_is_not_here_is_fetched(opened: Open) -> None:
    first = await opened()
    await make(first.catalogue)
    folder = (await first.catalogue.spec("f", "$LATEST")).code_dir
    await first.store.close()
    discard(folder)
    again = await opened()
    spec = await again.catalogue.spec("f", "$LATEST")
    assert spec.code_dir == folder
    assert (folder / "app.py").read_text().startswith("def handler")


@pytest.mark.parametrize("store_url", ["postgres"], indirect=True)  # a file has one gateway
async def test_changes_of_others_are_seen(opened: Open, store_url: str) -> None:
    first, second = await opened("one"), await opened("two")
    reported: list[str] = []
    second.catalogue.on_change(reported.append)
    await make(first.catalogue)
    assert second.catalogue.names() == []
    await second.catalogue.refresh()
    assert (second.catalogue.names(), "f" in reported) == (["f"], True)
    with pytest.raises(FunctionConflictError):  # the transaction decides, not what is remembered
        await make(second.catalogue)
    await second.catalogue.do("DeleteFunction", {"FunctionName": "f"})
    await make(first.catalogue)  # and the other way round
    await second.catalogue.refresh()
    assert second.catalogue.names() == ["f"]


@on_both
async def test_of_changes_at_a_time_one_wins(opened: Open) -> None:
    catalogue = (await opened()).catalogue
    made = await asyncio.gather(*(make(catalogue) for _ in range(8)), return_exceptions=True)
    assert Counter(type(item) for item in made) == {dict: 1, FunctionConflictError: 7}
    (revision,) = [item["RevisionId"] for item in made if isinstance(item, dict)]
    asked = {"FunctionName": "f", "RevisionId": revision}
    changes = [catalogue.do("UpdateFunctionConfiguration", {**asked, "Timeout": number}) for number in range(1, 9)]
    done = await asyncio.gather(*changes, return_exceptions=True)
    assert Counter(type(item) for item in done) == {dict: 1, FunctionChangedError: 7}


async def test_listeners_hear_of_every_change(opened: Open) -> None:
    catalogue, reported = (await opened()).catalogue, list[str]()
    catalogue.on_change(reported.append)
    await make(catalogue)
    asked = {"FunctionName": "f", "EventSourceArn": "arn:aws:metaros:::topic/*/battery_state"}
    mapping = await catalogue.do("CreateEventSourceMapping", {**asked, "Enabled": False})
    assert reported == ["f", "f", ""]
    (row,) = catalogue.mappings()
    assert (row.uuid, row.function, row.enabled, row.start) == (mapping["UUID"], "f", False, "LATEST")
    catalogue.note_mapping(row.uuid, "OK")
    found = await catalogue.do("GetEventSourceMapping", {"UUID": row.uuid})
    assert found["LastProcessingResult"] == "OK"
    await catalogue.do("DeleteFunction", {"FunctionName": "f"})
    assert (catalogue.mappings(), catalogue.names(), reported[-2:]) == ([], [], ["f", ""])


async def test_weights_share_the_calls(opened: Open) -> None:
    catalogue = (await opened()).catalogue
    await make(catalogue, Publish=True)
    await catalogue.do("UpdateFunctionConfiguration", {"FunctionName": "f", "Timeout": 5})
    await catalogue.do("PublishVersion", {"FunctionName": "f"})
    await catalogue.do("CreateAlias", {"FunctionName": "f", "Name": "live", "FunctionVersion": "1"})
    assert catalogue.resolve("f", "live").versions == (("1", 1.0),)
    await catalogue.set_weights("f", "live", "1", {"2": 0.2}, by="a test")
    target, rng = catalogue.resolve("f:live"), random.Random(1)
    picked = Counter(target.pick(rng.random()) for _ in range(10_000))
    expected = {"1": 8000, "2": 2000}
    assert sum((picked[version] - count) ** 2 / count for version, count in expected.items()) < 10.8  # 0.1 %
    await catalogue.set_weights("f", "live", "2", {}, by="a test")
    assert catalogue.resolve("f", "live").versions == (("2", 1.0),)
    for wrong in ({"1": 0.2, "2": 0.1}, {"2": 0.5}, {"1": 1.5}):
        with pytest.raises(FunctionInvalidError):
            await catalogue.set_weights("f", "live", "2", wrong, by="a test")


async def test_a_key_changes_with_what_runs_and_only_then(opened: Open) -> None:
    catalogue = (await opened()).catalogue
    await make(catalogue, Publish=True)
    first = await catalogue.spec("f", "$LATEST")
    await catalogue.do("PutFunctionConcurrency", {"FunctionName": "f", "ReservedConcurrentExecutions": 3})
    same = await catalogue.spec("f", "$LATEST")
    assert (same.key, same.reserved) == (first.key, 3)
    await catalogue.do("UpdateFunctionConfiguration", {"FunctionName": "f", "MemorySize": 512})
    assert (await catalogue.spec("f", "$LATEST")).key != first.key
    version = await catalogue.spec("f", "1")
    asked = {"FunctionName": "f", "Qualifier": "1", "ProvisionedConcurrentExecutions": 2}
    await catalogue.do("PutProvisionedConcurrencyConfig", asked)
    warm = await catalogue.spec("f", "1")
    assert (warm.min_workers, warm.key != version.key) == (2, True)


async def test_events_have_their_settings(opened: Open) -> None:
    catalogue = (await opened()).catalogue
    assert catalogue.event_invoke("nobody", "").most_retries == 2
    queue = "arn:aws:sqs:eu-central-1:123456789012:dead"
    await make(catalogue, DeadLetterConfig={"TargetArn": queue})
    asked = {"FunctionName": "f", "MaximumRetryAttempts": 0, "MaximumEventAgeInSeconds": 90}
    ends = {"DestinationConfig": {"OnSuccess": {"Destination": queue}, "OnFailure": {}}}
    await catalogue.do("PutFunctionEventInvokeConfig", {**asked, **ends})
    found = catalogue.event_invoke("f", "")
    assert (found.most_retries, found.most_age_s, found.on_success) == (0, 90.0, queue)
    assert (found.on_failure, found.dead_letter) == ("", queue)


@on_both
async def test_code_that_nothing_has_is_swept(opened: Open, clock: ManualClock, tmp_path: Path) -> None:
    catalogue = (await opened()).catalogue
    await make(catalogue, "a")
    await make(catalogue, "b")
    layer = {"LayerName": "shared", "Content": {"ZipFile": zipped("x = 1")}}
    arn = (await catalogue.do("PublishLayerVersion", layer))["LayerVersionArn"]
    await catalogue.do("UpdateFunctionConfiguration", {"FunctionName": "b", "Layers": [arn]})
    await catalogue.do("DeleteLayerVersion", {"LayerName": "shared", "VersionNumber": 1})
    zips = lambda: len(list((tmp_path / "objects").rglob("*.zip")))  # noqa: E731
    assert zips() == 3
    await catalogue.do("DeleteFunction", {"FunctionName": "a"})
    await catalogue.sweep()
    assert zips() == 3  # it may be about to be used again
    clock.advance(2 * 3600)
    await catalogue.sweep()
    assert zips() == 2  # a function has the layer still
    await catalogue.do("UpdateFunctionConfiguration", {"FunctionName": "b", "Layers": []})
    await catalogue.sweep()
    assert zips() == 1
    await make(catalogue, "a")
    assert zips() == 2


async def test_folders_go_when_there_are_too_many(opened: Open, clock: ManualClock) -> None:
    limits = Limits(function_cache_bytes=250)
    gateway = await opened(limits=limits)
    catalogue, folders = gateway.catalogue, {}
    for name in ("a", "b"):
        await make(catalogue, name, f"# {name * 100}\n")
        folders[name] = (await catalogue.spec(name, "$LATEST")).code_dir
    gateway.in_use.add(folders["a"])
    clock.advance(600)
    await make(catalogue, "c", f"# {'c' * 100}\n")
    assert (folders["a"].is_dir(), folders["b"].is_dir()) == (True, False)  # one is open, and one is not
    gateway.in_use.clear()
    assert (await catalogue.spec("b", "$LATEST")).code_dir.is_dir()  # it is fetched again
    assert not folders["a"].is_dir()


async def test_all_code_together_has_a_bound(opened: Open) -> None:
    size = len(zipped("x = 1"))
    catalogue = (await opened(limits=Limits(function_codes_bytes=2 * size))).catalogue
    for name in ("a", "b", "c"):
        await make(catalogue, name, "x = 1")  # the same zip file is kept once
    await make(catalogue, "d", "x = 2")
    with pytest.raises(CodeStorageFullError):
        await make(catalogue, "e", "x = 3")
    assert catalogue.names() == ["a", "b", "c", "d"]


async def test_what_is_no_code_changes_nothing(opened: Open) -> None:
    catalogue = (await opened()).catalogue
    for code, error in ((b"none", PackageError), (b"", FunctionInvalidError)):
        with pytest.raises(error):
            await make(catalogue, Code={"ZipFile": code})
    assert catalogue.names() == []
    for operation in ("GetFunction", "DeleteFunction", "PublishVersion", "UpdateFunctionConfiguration"):
        with pytest.raises(UnknownFunctionError):
            await catalogue.do(operation, {"FunctionName": "f"})
    with pytest.raises(UnknownFunctionError):
        await catalogue.spec("f", "$LATEST")


async def test_functions_have_a_bound(opened: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gateway.automation.functions.catalogue.functions.LIMITS", Limits(functions=1))
    catalogue = (await opened()).catalogue
    await make(catalogue, "a")
    with pytest.raises(FunctionInvalidError, match="bound"):
        await make(catalogue, "b")
    assert LIMITS.functions == 1000


async def test_a_link_is_good_for_a_while(opened: Open, clock: ManualClock) -> None:
    catalogue = (await opened()).catalogue
    await make(catalogue)
    sha256 = (await catalogue.do("GetFunction", {"FunctionName": "f"}))["Code"]["Location"]
    token = catalogue.links.make(sha256)
    assert catalogue.links.read(token) == sha256
    size, pieces = await catalogue.pieces(sha256)
    assert len(b"".join(await asyncio.to_thread(list, pieces))) == size
    for wrong in (token[:-1], token[:-1] + "x", f"{'0' * 64}{token[64:]}", token.replace("-", "-9", 1), ""):
        assert catalogue.links.read(wrong) is None
    clock.advance(LIMITS.lambda_link_s + 1)
    assert catalogue.links.read(token) is None
