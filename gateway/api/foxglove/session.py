"""One Foxglove client: its requests, and what it is sent without a request.

Samples go past this class: the hub writes them into the send queue, made once for all clients (encoding.py). Here is
the rest: the lists of channels, services and parameters, the graph and the time, and actions, by `RobotAccess`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from gateway.api.foxglove import requests, texts
from gateway.api.foxglove.assets import read_asset
from gateway.api.foxglove.binary import (
    ClientData,
    PlaybackControl,
    ServiceCall,
    asset_failure,
    asset_response,
    message_head,
    read_binary,
    time_message,
)
from gateway.api.foxglove.calling import KnownServices, answer_call
from gateway.api.foxglove.directory import Directory, Offered, channel_facts
from gateway.api.foxglove.encoding import MessageData
from gateway.api.foxglove.graph import graph_view
from gateway.api.foxglove.playback import Player, PlayerContext
from gateway.api.foxglove.publishing import Publishing
from gateway.api.foxglove.requests import Parameter
from gateway.api.foxglove.texts import ERROR, INFO, WARNING, GraphView
from gateway.api.foxglove.values import Values
from gateway.api.robot_access import RobotAccess, Topic
from gateway.api.rosbridge.driving import DriveLeases
from gateway.api.ws.send_queue import SendQueue
from gateway.domain.channel import Channel
from gateway.domain.qos import is_latched
from gateway.errors import InvalidRequestError
from gateway.live.subscription import TopicSubscription
from metaros.errors import MetarosError
from metaros.limits import LIMITS

__all__ = ["Session"]

FUTURE_NS = 60 * 10**9  # a robot's clock may be ahead
LATCHED_S = (0.0, 0.2, 0.5, 1.0)  # waits before each look for a latched sample
REFRESH_S = 0.25  # how often it is looked at what changed, and a live client is told the time
POLL_S = 2.0  # how often parameters are read that a client watches
STORED_ROBOTS = 256  # robots that announced nothing yet of which a client of the fleet is told what is stored
TOGETHER = 128  # channels in one message
FULL = "Send buffer limit reached"  # the very words for which Lichtblick has a hint


@dataclass(eq=False, slots=True)
class _Watched:
    """Parameters that a client wants to hear of; `names` empty: all."""

    on: bool = False
    names: set[str] = field(default_factory=set)
    last: dict[str, Parameter] = field(default_factory=dict)


class Session:
    """Made when the socket is open; `run` until it is cancelled, `handle` for each message, then `close`."""

    def __init__(
        self,
        access: RobotAccess,
        send_queue: SendQueue,
        *,
        span_ns: tuple[int, int] | None,
        lease_id: str = "",
        holder: str = "",
    ) -> None:
        """`span_ns`: what is stored, as far as the client may play it; `lease_id`: the teleop lease it has; `holder`:
        the name under which it takes one when it publishes on an actuator, "": it takes none.
        """
        services = access.services
        self._access = access
        self._services = services
        self._send_queue = send_queue
        self._span_ns = span_ns
        self._lease_id = lease_id
        self._viewer = services.hub.join(send_queue, on_dropped=lambda *_: self._note(WARNING, FULL, "send-buffer"))
        self._directory = Directory(LIMITS.foxglove_channels)
        self._subscriptions: dict[int, Offered] = {}
        self._stored: dict[str, list[Topic]] = {}  # of robots that may be away: what was announced goes before it
        self._known = KnownServices()
        self._values = Values(access)
        self._publishing = Publishing(
            access,
            self._start,
            lambda topic, why: self._note(ERROR, f"{topic}: {why}", f"publish {topic}"),
            lease_id=lease_id,
            drive_leases=DriveLeases(access, holder) if holder else None,
        )
        self._watched, self._fetching = _Watched(), asyncio.Lock()
        self._graph_wanted, self._graph_sent, self._graph = False, False, GraphView({}, {}, {})
        self._channels_stale = self._graphs_stale = True
        self._changed: set[str] = set()  # robots whose channels are others than the client was told
        self._tasks: set[asyncio.Task[None]] = set()
        self._unwatch = (services.hub.watch_channels(self._on_channels), services.graphs.watch(self._on_graph))
        side = PlayerContext(
            history=services.history,
            out=send_queue,
            clock=services.clock,
            wanted=self._wanted,
            set_live=self._set_live,
            notify=lambda text: self._note(WARNING, text, "history"),
        )
        self._player = Player(side, start_ns=span_ns[0] if span_ns is not None else 0)
        self._handlers: dict[type, Callable[[Any], None]] = {
            requests.Subscribe: self._subscribe,
            requests.Unsubscribe: self._unsubscribe,
            requests.Advertise: self._publishing.advertise,
            requests.Unadvertise: self._publishing.unadvertise,
            requests.GetParameters: lambda asked: self._task(self._get(asked.names, asked.id)),
            requests.SetParameters: lambda asked: self._task(self._set(asked)),
            requests.WatchParameters: self._watch,
            requests.WatchGraph: self._watch_graph,
            requests.FetchAsset: lambda asked: self._task(self._fetch(asked)),
            ClientData: self._publishing.publish,
            ServiceCall: lambda asked: self._task(self._call(asked)),
            PlaybackControl: self._control,
        }

    async def run(self, *, name: str, session: str, metadata: Mapping[str, str]) -> None:
        """Say hello, then tell what changes."""
        assets = self._services.settings.assets_dir is not None
        self._send_queue.text(
            texts.server_info(name, session=session, metadata=metadata, span_ns=self._span_ns, assets=assets)
        )
        if self._span_ns is not None:
            self._start(self._send_stored())
        async with asyncio.TaskGroup() as group:
            group.create_task(self._refresh())
            group.create_task(self._poll())
            group.create_task(self._player.run())

    def handle(self, message: Mapping[str, Any]) -> None:
        """One message of the client; what is wrong with it is told, and the connection stays."""
        try:
            text = message.get("text")
            asked = requests.read_text(text) if text is not None else read_binary(message.get("bytes") or b"")
            self._handlers[type(asked)](asked)
        except MetarosError as error:
            self._send_queue.text(texts.status(ERROR, str(error)[:500]))

    async def close(self) -> None:
        """The socket is over: nothing of it goes on, and what it drives stops."""
        for unwatch in self._unwatch:
            unwatch()
        self._viewer.close()
        self._access.close()
        for task in self._tasks:
            task.cancel()
        await self._publishing.close()

    # -- samples ---------------------------------------------------------------------------------------------------

    def _subscribe(self, asked: requests.Subscribe) -> None:
        for number, channel_id in asked.pairs:
            offered = self._directory.channels.get(channel_id)
            if offered is None:
                raise InvalidRequestError(f"Unknown channel ID: {channel_id}")
            if number in self._subscriptions:
                raise InvalidRequestError(f"Subscription ID {number} is in use")
            if self._player.live:
                self._listen(number, offered.channel)
                if is_latched(offered.channel.qos):
                    self._start(self._latched(number, offered))
            elif len(self._subscriptions) >= LIMITS.subscriptions_per_viewer:
                raise InvalidRequestError(f"a client has at most {LIMITS.subscriptions_per_viewer} subscriptions")
            self._subscriptions[number] = offered
            if not self._player.live:
                self._player.changed()

    def _unsubscribe(self, asked: requests.Unsubscribe) -> None:
        for number in asked.ids:
            if self._subscriptions.pop(number, None) is None:
                raise InvalidRequestError(f"Unknown subscription ID: {number}")
            if self._player.live:
                self._viewer.unsubscribe(number)
            else:
                self._player.changed()

    def _listen(self, number: int, channel: Channel) -> None:
        """Live samples of a channel, however often its robot announces it again."""
        identity, encoding = channel.identity, MessageData(number)
        self._viewer.subscribe(TopicSubscription(number, lambda found: found.identity == identity, lambda _: encoding))

    async def _latched(self, number: int, offered: Offered) -> None:
        """The last sample of a topic that goes on holding for whoever comes later, unless a newer one has come.

        It may be on its way to the store still: then it is looked for again.
        """
        robot, topic = offered.channel.robot, offered.channel.topic
        for wait_s in LATCHED_S:
            await asyncio.sleep(wait_s)
            now_ns = self._services.clock.wall_ns()
            instant = await self._services.history.at(robot, [topic], t_ns=now_ns + FUTURE_NS, max_age_ns=now_ns)
            record = self._services.registry.find(robot)
            states = record.topics() if record is not None else []
            newest_ns = max((state.last_stamp_ns or 0 for state in states if state.channel.topic == topic), default=0)
            if self._subscriptions.get(number) is not offered or not self._player.live:
                return
            if instant.messages and instant.messages[0].stamp_ns >= newest_ns:
                message = instant.messages[0]
                self._send_queue.binary(message_head(number, message.stamp_ns) + message.payload)
                return

    def _set_live(self, live: bool) -> None:
        for number, offered in self._subscriptions.items():
            if live:
                self._listen(number, offered.channel)
            else:
                self._viewer.unsubscribe(number)

    def _wanted(self) -> dict[tuple[str, str], tuple[int, Channel]]:
        return {
            (item.channel.robot, item.channel.topic): (number, item.channel)
            for number, item in self._subscriptions.items()
        }

    def _control(self, asked: PlaybackControl) -> None:
        if self._span_ns is None:
            raise InvalidRequestError("there is no history that could be played")
        self._player.control(asked)

    # -- what there is ---------------------------------------------------------------------------------------------

    def _on_channels(self, robot: str) -> None:
        if self._access.names.covers(robot):
            self._changed.add(robot)

    def _on_graph(self, robot: str) -> None:
        self._graphs_stale = self._graphs_stale or self._access.names.covers(robot)

    async def _refresh(self) -> None:
        while True:
            if self._channels_stale or self._changed:
                robots, self._changed = None if self._channels_stale else self._changed, set()
                self._channels_stale = False
                await self._send_channels(robots)
            if self._graphs_stale:
                self._graphs_stale = False
                await self._send_services()
                self._send_graph()
            if self._player.live and self._send_queue.ready():
                self._send_queue.binary(time_message(self._services.clock.wall_ns()))
            await asyncio.sleep(REFRESH_S)

    async def _send_stored(self) -> None:
        """A robot that has not been here since the gateway began has a past all the same, which can be played."""
        names, most = self._access.names, LIMITS.foxglove_channels
        away = [item.robot.id for item in self._access.robots() if names.robot is not None or not item.topics()]
        for robot in away[:STORED_ROBOTS]:
            found = await self._services.history.channels(robot, most=most)
            self._stored[robot] = [Topic(names.shown(robot, channel.topic), channel) for channel in found]
            self._changed.add(robot)
            if (most := most - len(found)) <= 0:
                return

    async def _send_channels(self, robots: set[str] | None) -> None:
        """What changed of those robots, or of all; others that were left out come where places became free."""
        changes = self._directory.update_channels(self._found(robots), robots=robots)
        self._channels_stale = bool(robots is not None and changes.gone and changes.left_out)
        if changes.gone:
            for number in [n for n, item in self._subscriptions.items() if item.number in changes.gone]:
                self._unsubscribe(requests.Unsubscribe((number,)))
            self._send_queue.text(texts.unadvertise(changes.gone))
        for start in range(0, max(1, len(changes.new)), TOGETHER):
            await self._send_queue.drain()
            self._send_queue.text(
                texts.advertise([channel_facts(item) for item in changes.new[start : start + TOGETHER]])
            )
        self._send_left_out("sealed", changes.unreadable, "topics are sealed or of unknown types, and not shown")
        self._send_left_out("channels", changes.left_out, "further topics are not shown: open /foxglove/ROBOT instead")

    def _found(self, robots: set[str] | None) -> Iterator[tuple[str, Channel]]:
        """What was announced, and then what is stored, by the client's names."""
        names, find = self._access.names, self._services.registry.find
        chosen = self._access.robots() if robots is None else filter(None, map(find, sorted(robots)))
        for record in chosen:
            robot = record.robot.id
            for state in record.topics():
                yield names.shown(robot, state.channel.topic), state.channel
            for topic in self._stored.get(robot, ()):
                yield topic.shown, topic.channel

    def _send_left_out(self, about: str, count: int, text: str) -> None:
        self._note(INFO, f"{count} {text}" if count else "", about)

    async def _send_services(self) -> None:
        new, gone = self._directory.update_services(self._known.of(self._access.graphs(), self._access.names))
        if gone:
            self._send_queue.text(texts.unadvertise_services(gone))
        for start in range(0, len(new), TOGETHER):
            await self._send_queue.drain()
            self._send_queue.text(texts.advertise_services(new[start : start + TOGETHER]))

    def _watch_graph(self, asked: requests.WatchGraph) -> None:
        self._graph_wanted, self._graph_sent = asked.on, False
        self._send_graph()

    def _send_graph(self) -> None:
        if self._graph_wanted:
            now = graph_view(self._access.graphs(), self._access.names)
            update = texts.graph_update(self._graph if self._graph_sent else None, now)
            self._graph, self._graph_sent = now, True
            if update is not None:
                self._send_queue.text(update)

    # -- parameters ------------------------------------------------------------------------------------------------

    def _watch(self, asked: requests.WatchParameters) -> None:
        """No names: all of them, or none any more."""
        watched = self._watched
        watched.on = asked.on or bool(asked.names and watched.names - set(asked.names))
        watched.names = (watched.names | set(asked.names)) if asked.on else (watched.names - set(asked.names))
        if asked.on and not asked.names:
            watched.names = set()
        if len(watched.names) > LIMITS.parameters_per_node:
            watched.names, watched.on = set(), False
            raise InvalidRequestError(f"at most {LIMITS.parameters_per_node} parameters are watched")

    async def _poll(self) -> None:
        while True:
            await asyncio.sleep(POLL_S)
            watched = self._watched
            if not watched.on:
                watched.last = {}
                continue
            try:
                found = {item.name: item for item in await self._values.read(sorted(watched.names))}
            except MetarosError:
                continue
            changed = [item for name, item in found.items() if name in watched.last and watched.last[name] != item]
            watched.last = found
            if changed:
                self._send_queue.text(texts.parameter_values(changed))

    async def _get(self, names: tuple[str, ...], answer_to: str | None) -> None:
        found = await self._values.read(names)
        await self._send_queue.drain()
        self._send_queue.text(texts.parameter_values(found, answer_to=answer_to))

    async def _set(self, asked: requests.SetParameters) -> None:
        for fault in await self._values.write(asked.parameters):
            self._send_queue.text(texts.status(ERROR, fault[:500]))
        if asked.id is not None:
            await self._get(tuple(item.name for item in asked.parameters), asked.id)

    # -- deeds -----------------------------------------------------------------------------------------------------

    async def _call(self, asked: ServiceCall) -> None:
        view = self._directory.services.get(asked.service_id)
        answer = await answer_call(self._access, view, asked, lease_id=self._lease_id)
        await self._send_queue.drain()
        if isinstance(answer, bytes):
            self._send_queue.binary(answer)
        else:
            self._send_queue.text(answer)

    async def _fetch(self, asked: requests.FetchAsset) -> None:
        async with self._fetching:  # one file at a time is in memory, and the next when the client has taken it
            await self._send_queue.drain()
            try:
                data = await asyncio.to_thread(read_asset, self._services.settings.assets_dir, asked.uri)
                answer = asset_response(asked.request_id, data)
            except MetarosError as error:
                answer = asset_failure(asked.request_id, str(error))
            self._send_queue.binary(answer)

    def _task(self, work: Coroutine[Any, Any, None]) -> None:
        if not self._start(work):
            raise InvalidRequestError(f"{LIMITS.foxglove_tasks} requests are under way: wait for an answer")

    def _start(self, work: Coroutine[Any, Any, None]) -> bool:
        if len(self._tasks) >= LIMITS.foxglove_tasks:
            work.close()
            return False
        task = asyncio.create_task(self._guarded(work))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return True

    async def _guarded(self, work: Coroutine[Any, Any, None]) -> None:
        try:
            await work
        except MetarosError as error:
            self._send_queue.text(texts.status(ERROR, str(error)[:500]))

    def _note(self, level: int, text: str, about: str) -> None:
        """A note that takes the place of the one before about the same; none: that one does not hold any more."""
        self._send_queue.text(texts.status(level, text[:500], note_id=about) if text else texts.remove_status(about))
