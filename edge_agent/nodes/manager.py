"""The robot's nodes: what the twin wants becomes the supervisor's table, and what the supervisor runs is reported.

The manager decides nothing about a running process: it finds programs, checks them against the robot's own settings,
fetches bundles, and hands the table over. What runs goes on without it.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from edge_agent.config.node_settings import NodeSettings
from edge_agent.nodes.bundles import Bundle, Bundles
from edge_agent.nodes.client import SupervisorConnection
from edge_agent.nodes.errors import NodeRefusedError
from edge_agent.nodes.launch_row import LaunchContext, as_json, check_allowed, launch_row
from edge_agent.nodes.launcher import Launcher
from edge_agent.nodes.ledger import Ledger
from edge_agent.nodes.version_trial import VersionTrial
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.errors import ConfigError, MetarosError
from metaros.fleet.twin import parse
from metaros.fleet.twin.document import NodeSpec
from metaros.limits import LIMITS
from metaros.supervise.node_table_file import Row, TableFile
from metaros.supervise.service import TABLE

__all__ = ["NodeManager"]

LOG = logging.getLogger("metaros.agent.nodes")
AGAIN_S: Final = (5.0, 300.0)  # between tries to fetch a bundle
EVALUATE_S: Final = 1.0  # new versions are looked at so often, and more often where they prove themselves sooner
VERBS: Final = ("start", "stop", "restart", "signal", "retry", "crashes")


class NodeManager:
    """`run` it beside the uplink. `set_nodes` gives the wanted nodes, `reported` says how they are."""

    def __init__(
        self,
        ledger: Ledger,
        *,
        settings: NodeSettings,
        place: LaunchContext,
        clock: Clock,
        bundles: Bundles | None = None,
        launcher: Launcher | None = None,
    ) -> None:
        self.changed: Callable[[], None] = lambda: None
        self._ledger = ledger
        self._settings, self._place, self._clock, self._bundles = settings, place, clock, bundles
        self._launcher = launcher or Launcher(ledger.directory)
        self._evaluate_s = min(EVALUATE_S, settings.health_s / 4)
        self.line = SupervisorConnection(ledger.directory, self._launcher, self._on_list)
        self._wanted: dict[str, NodeSpec] | None = None  # None: nobody has said yet; the table stays as it is
        self._found: dict[str, Any] | None = None
        self._problems: dict[str, tuple[str, str]] = {}  # by node: code and message of its bundle
        self._fetching: set[str] = set()
        self._work = asyncio.Event()
        self._rows = _rows_of(ledger.directory)  # as last given: an old one serves until its new bundle is here
        self._trouble = ""
        self._taken = True  # whether the supervisor has, or could not be given, what is wanted

    # -- the twin's side -------------------------------------------------------------------------------------------

    async def set_nodes(self, nodes: Mapping[str, Any] | None) -> None:
        """Run these, all of them and no others. Bundles that are not here come later, and the node with them.

        Raises:
            NodeRefusedError: one of them may not run on this robot; nothing has changed.
            TwinError: plain rows that are none of a twin's document.
        """
        wanted = dict(_parsed(nodes))
        for node in wanted.values():
            check_allowed(node, self._settings)
            if node.bundle and self._bundles is None:
                raise NodeRefusedError(f"{node.name}: this robot takes no bundles: it is not enrolled")
        self._taken = self._taken and wanted == self._wanted
        self._wanted = wanted
        for name, node in wanted.items():
            if node.bundle:
                self._trial(node).forgive(node.version)
            self._problems.pop(name, None)
        self._work.set()

    @property
    def handed_over(self) -> bool:
        """See NodeTable. While a bundle comes, which may take long, nobody waits for what is wanted beside it."""
        return self._taken or bool(self._fetching)

    def reported(self) -> dict[str, Any]:
        """The nodes as they are, by name: what runs, and what is wanted and does not."""
        found = {node["name"]: node for node in (self._found or {}).get("nodes", [])}
        rows = {name: self._reported(found[name]) for name in found}
        for name, node in (self._wanted or {}).items():
            row = rows.setdefault(name, self._absent(name))
            if node.bundle:
                row["update"] = self._trial(node).update(
                    node.version, fetching=name in self._fetching, problem=self._problems.get(name, ("", ""))
                )
        return rows

    # -- remote requests ---------------------------------------------------------------------------------------------

    async def verb(self, node: str, verb: str, signal: int = 0, *, timeout_s: float = 30.0) -> bytes:
        """One of VERBS; what comes back is nothing, or JSON of `crashes`. Raises SupervisorError, ConfigError."""
        if verb not in VERBS:
            raise ConfigError(f"no verb {verb[:40]!r}: {', '.join(VERBS)}")
        request: dict[str, Any] = {"signal": signal} if verb == "signal" else {}
        found = await self.line.ask(verb, node=node, timeout_s=timeout_s, start=self._launcher.has_table, **request)
        return crash_reports(found["crashes"]) if verb == "crashes" else b""

    async def read_log(
        self, node: str, *, cursor: str = "", max_bytes: int = 0, query: str = "", backwards: bool = False
    ) -> bytes:
        """A page of a node's log as JSON. Raises SupervisorError, ConfigError."""
        found = await self.line.ask(
            "log",
            start=self._launcher.has_table,
            node=node,
            cursor=cursor,
            max_bytes=max_bytes,
            query=query,
            backwards=backwards,
        )
        page = {key: found[key] for key in ("lines", "cursor", "more")}
        return json.dumps(page, ensure_ascii=False).encode(errors="replace")

    async def leases(self, given: list[link_pb2.NodeLease], *, at_s: float) -> None:
        """The leases of migratable nodes; they count from `at_s` of `metaros.clock.boot_s`."""
        rows = [
            {"node": one.node, "lease_id": one.lease_id, "valid_s": one.valid_ms / 1000, "epoch": one.epoch}
            for one in given
        ]
        await self.line.ask("leases", start=self._launcher.has_table, leases=rows, at_s=at_s)

    # -- work ------------------------------------------------------------------------------------------------------

    async def run(self) -> None:
        """Follow the supervisor and bring it to what is wanted, for ever."""
        try:
            async with asyncio.TaskGroup() as group:
                group.create_task(self.line.run())
                group.create_task(self._keep())
                group.create_task(self._evaluate())
        finally:
            await self.line.close()

    async def _keep(self) -> None:
        again_s = AGAIN_S[0]
        while True:
            waiting = bool(self._problems or self._trouble)
            try:
                async with asyncio.timeout(again_s if waiting else None):
                    await self._work.wait()
                again_s = AGAIN_S[0]
            except TimeoutError:
                again_s = min(2 * again_s, AGAIN_S[1])
            self._work.clear()
            if (wanted := self._wanted) is None:
                continue
            try:
                try:
                    await self._apply()
                finally:
                    self._taken = self._wanted == wanted
                self._say("")
                if await self._fetch():
                    self._work.set()
                else:
                    await self._collect()
            except MetarosError as error:
                self._say(str(error))
            self.changed()

    async def _apply(self) -> None:
        """Give the supervisor what can run now, where it has something else."""
        wanted = self._wanted  # while the supervisor is asked, others may be wanted
        assert wanted is not None
        rows = self._rows_now(wanted)
        data = [as_json(row) for row in rows]
        tag = hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()
        if not rows and not self._launcher.has_table:
            return
        self.line.need()
        found = await self.line.ask("list")
        if found["tag"] != tag:
            self._on_list(await self.line.ask("set_table", rows=data, tag=tag, timeout_s=120.0))
        for row in rows:
            if row.version:
                self._trial(wanted[row.name]).begin(row.version)
        self._ledger.keep()

    def _rows_now(self, wanted: Mapping[str, NodeSpec]) -> list[Row]:
        rows: dict[str, Row] = {}
        for name, node in wanted.items():
            bundle = self._bundle_of(node)
            if node.bundle and bundle is None:
                if name in self._rows:
                    rows[name] = self._rows[name]
                continue
            version = self._trial(node).choose(node.version) if node.bundle else ""
            try:
                row = launch_row(node, self._settings, self._place, bundle)
            except NodeRefusedError as error:  # only its bundle says what it is
                self._problems[name] = (error.code, str(error)[:300])
                continue
            rows[name] = replace(row, version=version)
        self._rows = {
            name: replace(row, after=tuple(one for one in row.after if one in rows)) for name, row in rows.items()
        }
        return list(self._rows.values())

    def _bundle_of(self, node: NodeSpec) -> Bundle | None:
        if not node.bundle or self._bundles is None:
            return None
        try:
            return self._bundles.ready(node.bundle, self._trial(node).choose(node.version))
        except MetarosError as error:
            self._problems[node.name] = (error.code, str(error)[:300])
            return None

    async def _fetch(self) -> bool:
        """Bundles that are wanted and not here, one after the other; True where one came."""
        came = False
        for name, node in list((self._wanted or {}).items()):
            if not node.bundle or self._bundles is None or self._bundle_of(node) is not None:
                continue
            self._fetching.add(name)
            self.changed()
            try:
                await self._bundles.get(node.bundle, self._trial(node).choose(node.version))
                self._problems.pop(name, None)
                came = True
            except MetarosError as error:
                self._problems[name] = (error.code, str(error)[:300])
            finally:
                self._fetching.discard(name)
            if self._work.is_set():  # something else is wanted by now
                return True
        return came

    async def _collect(self) -> None:
        """Let bundles go that nothing runs, is to run, or would go back to."""
        if self._bundles is None:
            return
        wanted = [(node, self._trial(node)) for node in (self._wanted or {}).values() if node.bundle]
        keep = {(node.bundle, version) for node, trial in wanted for version in (node.version, trial.good) if version}
        keep |= {(Path(row.cwd).parent.name, row.version) for row in self._rows.values() if row.version}
        try:
            await asyncio.to_thread(self._bundles.collect, keep)
        except OSError as error:
            LOG.warning("bundles that nobody wants stay: %s", error)

    async def _evaluate(self) -> None:
        """New versions of bundles: good, or back to the last good one."""
        while True:
            await asyncio.sleep(self._evaluate_s)
            for node in (self._found or {}).get("nodes", []):
                wanted = (self._wanted or {}).get(node["name"])
                if wanted is None or not wanted.bundle:
                    continue
                trial = self._trial(wanted)
                settled = trial.evaluate(
                    node,
                    now_s=self._clock.monotonic_s(),
                    wall_ns=self._clock.wall_ns(),
                    health_s=self._settings.health_s,
                    trial_s=self._settings.trial_s,
                )
                if settled:
                    LOG.warning("%s: bundle %s is %s", wanted.name, wanted.bundle, settled)
                    self._settled(wanted, trial, settled)

    def _settled(self, node: NodeSpec, trial: VersionTrial, how: str) -> None:
        self._ledger.keep()
        if how == "healthy" and self._bundles is not None:
            try:
                self._bundles.did_well(node.bundle, trial.good)
            except MetarosError as error:
                LOG.warning("%s: %s", node.name, error)
        self._work.set()
        self.changed()

    # -- parts -----------------------------------------------------------------------------------------------------

    def _trial(self, node: NodeSpec) -> VersionTrial:
        return self._ledger.trial(node.name, node.bundle)

    def _on_list(self, found: dict[str, Any] | None) -> None:
        was, self._found = self._found, found
        if found is None or was is None or was["life"] != found["life"]:
            self._work.set()  # a new one may have lost what we gave the old one
        self.changed()

    def _reported(self, node: Mapping[str, Any]) -> dict[str, Any]:
        keys = ("state", "why", "pid", "restarts", "since_ns", "last_exit", "version", "waits_for", "lease_id", "nice")
        row = {key: node[key] for key in (*keys, "safe_stop") if node[key] not in ("", None)}
        row["quarantined"] = node["state"] == "quarantined"
        row["crashes"] = node["crashes_total"]
        return row

    def _absent(self, name: str) -> dict[str, Any]:
        if name in self._fetching:
            return {"state": "fetching"}
        if name in self._problems:
            return {"state": "refused", "last_exit": self._problems[name][1]}
        if self._launcher.stopped_by_hand:
            return {"state": "stopped", "why": "the supervisor was stopped by hand"}
        return {"state": "waiting", "why": self._trouble or "the supervisor has not taken it yet"}

    def _say(self, trouble: str) -> None:
        if trouble and trouble != self._trouble:
            LOG.warning("nodes: %s", trouble)
        self._trouble = trouble


def _rows_of(directory: Path) -> dict[str, Row]:
    """What an agent before this one gave its supervisor; nothing where that cannot be read."""
    try:
        return {row.name: row for row in TableFile(directory / TABLE).table.rows}
    except ConfigError as error:
        LOG.warning("%s", error)
        return {}


def crash_reports(found: list[dict[str, Any]], most_bytes: int = LIMITS.node_answer_bytes) -> bytes:
    """Crash reports as JSON, oldest first; the oldest are left out where they are more than a link's answer takes."""
    while True:
        data = json.dumps({"crashes": found}, ensure_ascii=False).encode(errors="replace")
        if len(data) <= most_bytes or not found:
            return data
        found = found[1:]


def _parsed(nodes: Mapping[str, Any] | None) -> Mapping[str, NodeSpec]:
    """Rows of the twin's document, or what was made of them."""
    if nodes and all(isinstance(node, NodeSpec) for node in nodes.values()):
        return nodes
    return parse({"nodes": dict(nodes or {})}).nodes or {}
