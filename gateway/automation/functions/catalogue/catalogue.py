"""The catalogue: every function with its versions, aliases, layers and settings, and the operations on them.

All records are in memory, so that a call needs no database. A change is one transaction on the writer's thread, where
whoever changes has their turn; other gateways of the store see it within `POLL_S`.
"""

from __future__ import annotations

import asyncio
import logging
import secrets
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from gateway.automation.functions.catalogue.aliases import change_alias, shares
from gateway.automation.functions.catalogue.code import CodeStore
from gateway.automation.functions.catalogue.layers import forget_layers
from gateway.automation.functions.catalogue.links import CodeLinks
from gateway.automation.functions.catalogue.lookup import check_revision, named, unknown
from gateway.automation.functions.catalogue.mappings import mapping_row
from gateway.automation.functions.catalogue.names import LATEST, function_arn, parse_function
from gateway.automation.functions.catalogue.operations import OPERATIONS, REFUSED, Operation
from gateway.automation.functions.catalogue.records import ALIAS, ASYNC, FUNCTION, MAPPING, VERSION, Draft, RecordCache
from gateway.automation.functions.catalogue.settings import layer_of
from gateway.automation.functions.catalogue.shapes import check_input, model
from gateway.automation.functions.catalogue.spec import event_settings, make_spec
from gateway.automation.functions.directory import EventInvoke, MappingRow, Resolved
from gateway.automation.functions.errors import FunctionInvalidError, NotImplementedHereError
from gateway.errors import GatewayError
from gateway.store import Store
from gateway.store.automation.functions import Record, link_secret, read_change, read_records
from gateway.store.engine import StoreEngine
from gateway.store.objects import ObjectStore
from metaros.automation.functions.calls import FunctionSpec
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["Catalogue"]

log = logging.getLogger(__name__)
POLL_S = 2.0
SWEEP_S = 600.0


class Catalogue:
    """What functions there are; a `Directory` for whoever calls them."""

    def __init__(
        self,
        store: Store,
        objects: ObjectStore,
        folder: Path,
        *,
        clock: Clock,
        in_use: Callable[[], Collection[Path]] = frozenset,
        limits: Limits = LIMITS,
    ) -> None:
        """`folder` is for unpacked code; `in_use` tells which folders of it workers have open."""
        self._store = store
        self._clock = clock
        self._code = CodeStore(store, objects, folder, clock=clock, in_use=in_use, limits=limits)
        self.links = CodeLinks(clock=clock)
        self._cache = RecordCache()
        self._change = -1
        self._listeners: list[Callable[[str], None]] = []
        self._results: dict[str, str] = {}  # of mappings, by UUID

    async def start(self) -> None:
        """Learn what there is."""
        await asyncio.to_thread(model)
        await asyncio.to_thread(self._code.open)
        fresh = secrets.token_hex(32)
        self.links.learn(await self._store.run(lambda engine: link_secret(engine, fresh)))
        await self.refresh()

    async def run(self) -> None:
        """See what other gateways change, and delete code that nobody has, until cancelled."""
        swept_s = self._clock.monotonic_s()
        while True:
            await asyncio.sleep(POLL_S)
            try:
                if self._store.shared:
                    await self.refresh()
                if self._clock.monotonic_s() - swept_s >= SWEEP_S:
                    swept_s = self._clock.monotonic_s()
                    await self.sweep()
            except GatewayError as error:
                log.warning("functions cannot be looked after now: %s", error)

    async def do(self, operation: str, asked: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """One operation of AWS Lambda, with its members; the answer has those that AWS's has.

        Raises:
            NotImplementedHereError: it is not here; FunctionInvalidError: a member does not fit.
            UnknownFunctionError, FunctionConflictError, FunctionChangedError: by the state of things.
        """
        row, asked = self.operation(operation), dict(asked or {})
        check_input(operation, asked)
        if row.run is None:
            raise NotImplementedHereError(f"{operation} is a call: it is not the catalogue's")
        if row.code is not None:
            asked = await self._with_code(row, asked)
        if not row.writes:
            return self._finished(operation, row.run(self._cache, asked))
        run = row.run
        return self._finished(operation, await self._write(lambda draft: run(draft, asked)))

    @staticmethod
    def operation(name: str) -> Operation:
        """The row of an operation; NotImplementedHereError, which says why, for one that is refused."""
        if (row := OPERATIONS.get(name)) is not None:
            return row
        why = REFUSED.get(name, "this version does not know it")
        raise NotImplementedHereError(f"{name} is not implemented by Meta-ROS: {why}")

    def resolve(self, name: str, qualifier: str = "") -> Resolved:
        """What a name or ARN means now."""
        owner, said = parse_function(name, qualifier)
        named(self._cache, owner)
        arn = function_arn(owner, said)
        if said in ("", LATEST):
            return Resolved(owner, said, arn, ((LATEST, 1.0),))
        if said.isdigit():
            self._version(owner, said)
            return Resolved(owner, said, arn, ((said, 1.0),))
        alias = self._cache.get(ALIAS, owner, said)
        if alias is None:
            raise unknown(owner, said)
        return Resolved(owner, said, arn, shares(alias))

    async def spec(self, name: str, version: str) -> FunctionSpec:
        """A version as the engine runs it, its code unpacked."""
        record = self._version(name, version or LATEST)
        layers = [layer_of(arn, self._cache) for arn in record.document["settings"]["Layers"]]
        folders = [await self._code.folder(item.code) for item in (record, *layers)]
        return make_spec(record, self._cache, code_dir=folders[0], layer_dirs=tuple(folders[1:]))

    def names(self) -> list[str]:
        """Every function."""
        return [record.owner for record in self._cache.all(FUNCTION)]

    def event_invoke(self, name: str, qualifier: str) -> EventInvoke:
        """The settings of a function's events."""
        latest = self._cache.get(FUNCTION, name, LATEST)
        return event_settings(latest, self._cache.get(ASYNC, name, qualifier or LATEST))

    def mappings(self) -> Sequence[MappingRow]:
        """Every event source mapping."""
        return [mapping_row(record) for record in self._cache.all(MAPPING)]

    def note_mapping(self, uuid: str, result: str) -> None:
        """What came of its last batch; in memory only."""
        self._results[uuid] = result

    async def set_weights(self, name: str, alias: str, version: str, weights: Mapping[str, float], *, by: str) -> None:
        """Let an alias lead to a version, and to others with these shares."""
        asked = {"FunctionVersion": version, "RoutingConfig": {"AdditionalVersionWeights": dict(weights)}}

        def job(draft: Draft) -> dict[str, Any]:
            record = draft.get(ALIAS, name, alias)
            if record is None:
                raise unknown(name, alias)
            change_alias(draft, record, asked)
            return {}

        await self._write(job)
        log.info("%s: the alias %s leads to %s with %s, by %s", name, alias, version, dict(weights) or "no other", by)

    async def files(self, name: str, version: str) -> Path:
        """Where a version's code is unpacked."""
        return await self._code.folder(self._version(name, version or LATEST).code)

    async def pieces(self, sha256: str) -> tuple[int, Iterator[bytes]]:
        """A zip file's size and pieces, which block; UnknownFunctionError."""
        return await self._code.pieces(sha256)

    def on_change(self, listener: Callable[[str], None]) -> None:
        """Tell of each function that is made, changed or deleted; "" where event source mappings are."""
        self._listeners.append(listener)

    async def sweep(self) -> None:
        """Delete code that nothing has any more."""

        def job(draft: Draft) -> dict[str, Any]:
            forget_layers(draft)
            return {}

        await self._write(job)
        await self._code.sweep()

    async def _with_code(self, row: Operation, asked: dict[str, Any]) -> dict[str, Any]:
        """The members with the zip file's facts in its place, once it is checked, unpacked and kept."""
        holder = asked[row.code] if row.code else asked
        for name in ("ImageUri", "S3Bucket", "S3Key", "S3ObjectVersion", "S3ObjectStorageMode", "SourceKMSKeyArn"):
            if holder.get(name):
                raise NotImplementedHereError(
                    f"{name} is not implemented by Meta-ROS: code comes as ZipFile; the gateway fetches nothing with"
                    " credentials of its own"
                )
        source = holder.get("ZipFile")
        if not source:
            raise FunctionInvalidError("ZipFile is required: a zip file of at most 50 MiB")
        if row.name == "CreateFunction" or row.code == "":
            self._check_early(row, asked)
        facts = await self._code.check(source)
        if not asked.get("DryRun"):
            await self._code.keep(source, facts)
        return {**asked, row.code or "Code": facts}

    def _check_early(self, row: Operation, asked: Mapping[str, Any]) -> None:
        """What can be told before the code is stored; the transaction decides."""
        name = parse_function(asked["FunctionName"]).name
        if row.name == "UpdateFunctionCode":
            check_revision(named(self._cache, name), asked)

    async def _write(self, job: Callable[[Draft], dict[str, Any]]) -> dict[str, Any]:
        now_ns = self._clock.wall_ns()

        def run(engine: StoreEngine) -> tuple[Draft, dict[str, Any]]:
            draft = Draft(engine, now_ns=now_ns)
            return draft, job(draft)

        draft, answer = await self._store.run(run)
        if draft.change == self._change + 1 or not self._store.shared:
            self._cache.apply(draft)
            self._change = draft.change
        else:
            await self.refresh()
        self._report(draft.owners, mappings=MAPPING in draft.kinds)
        return answer

    async def refresh(self) -> None:
        """Read everything again where somebody has changed something."""

        def job(engine: StoreEngine) -> tuple[int, list[Record] | None]:
            with engine.transaction(write=False):
                change = read_change(engine)
                return change, None if change == self._change else read_records(engine)

        change, records = await self._store.read(job)
        if records is None or change <= self._change:
            return
        cache, old = RecordCache(records), self._cache
        self._cache, self._change = cache, change
        owners = {record.owner for record in (*cache.all(FUNCTION), *old.all(FUNCTION))}
        self._report({owner for owner in owners if _build(cache, owner) != _build(old, owner)}, mappings=True)

    def _report(self, owners: Collection[str], *, mappings: bool) -> None:
        for listener in self._listeners:
            for owner in sorted(owners):
                listener(owner)
            if mappings:
                listener("")

    def _version(self, name: str, version: str) -> Record:
        record = self._cache.get(FUNCTION if version == LATEST else VERSION, name, version)
        if record is None:
            raise unknown(name, version)
        return record

    def _finished(self, operation: str, answer: dict[str, Any]) -> dict[str, Any]:
        """A mapping with what came of its last batch."""
        if "EventSourceMapping" in operation:
            for item in answer.get("EventSourceMappings", [answer]):
                item["LastProcessingResult"] = self._results.get(item["UUID"], "No records processed")
        return answer


def _build(cache: RecordCache, owner: str) -> list[Record]:
    """All that is known of a function."""
    return [record for kind in (FUNCTION, VERSION, ALIAS, ASYNC) for record in cache.all(kind, owner)]
