"""One simulated robot: the agent's own session over three lanes, an outbox in memory, and a load.

The session is `edge_agent.uplink.session.AgentSession` as it stands: hello, watermarks, windows, acknowledgements,
budgets, heartbeats, statistics, demand, pauses. Left out is what a robot does beside its link: the disk, Zenoh, topics'
selection, teleop and commands at work (they are answered), the desks of twin, graph, nodes and recordings, and TLS.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from edge_agent.errors import BehindError, LinkError, RefusedError
from edge_agent.forwarding.live_batch import Linger
from edge_agent.forwarding.live_queue import LiveQueue
from edge_agent.link.budget import Budget
from edge_agent.link.frames import CommandArrived
from edge_agent.outbox import Frame, Kind
from edge_agent.uplink.backoff import Backoff
from edge_agent.uplink.queues import Queues
from edge_agent.uplink.session import LANES, AgentSession, Established, Identity
from edge_agent.uplink.uplink import MOST_PATIENCE, OPEN_S
from load_tests.fleet.figures import Counts
from load_tests.fleet.lanes import Lane, LaneCallbacks, OpenLane, Traffic
from load_tests.fleet.load import BULK, LIVE, Load, announce, metric_body, noise, sample_body
from load_tests.fleet.outbox import MemoryOutbox
from metaros._proto import link_pb2
from metaros.errors import FrameError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from random import Random

    from metaros.clock import Clock

__all__ = ["Robot", "Shared"]

STEADY_S: Final = 1.0
CHECK_S: Final = 1.0
PING_S: Final = 5.0
OUTBOX_BYTES: Final = 8 * 1024 * 1024
METRICS: Final = 0  # the stream of metric rows
ANNOUNCE: Final = announce()


@dataclass(slots=True)
class LiveChannel:
    """What the queue of live samples counts on."""

    channel_id: int = LIVE
    live_seq: int = 0
    dropped: int = 0
    video: None = None  # it is none


class SimChannels:
    """The robot's topics, as far as a session asks: announced once, and what viewers want of the live one."""

    __slots__ = ("_on_demand", "live", "revision")

    def __init__(self, on_demand: Any) -> None:
        self.revision = 1
        self.live = LiveChannel()
        self._on_demand = on_demand

    def __iter__(self) -> Iterator[Any]:
        return iter(())  # statistics have no rates of topics

    def announcements(self, after: int) -> Iterator[link_pb2.Announce]:
        """All there is."""
        return iter((ANNOUNCE,))

    def demand(self, entries: Mapping[int, float]) -> None:
        """Whether somebody watches the live topic."""
        self._on_demand(LIVE in entries)


class Shared:
    """What all robots of a run use. `port` is the gateway's for robots: of gRPC, or of HTTP for WebSockets."""

    def __init__(self, *, host: str, port: int, open_lane: OpenLane, rng: Random, clock: Clock) -> None:
        self.host, self.port = host, port
        self.open_lane = open_lane
        self.rng = rng
        self.clock = clock
        self.loop = asyncio.get_running_loop()
        self.counts = Counts()
        self.traffic = Traffic()
        self.on_stored: Callable[[Robot, float], None] | None = None  # how long after it was made a frame was stored


class Robot:
    """Callbacks and timers of the event loop; a task only while it connects."""

    def __init__(self, shared: Shared, name: str, load: Load) -> None:
        self.name = name
        self.load = load
        self.rows = self.samples = 0  # handed over
        self._shared, self._clock, self._counts = shared, shared.clock, shared.counts
        self._backoff = Backoff(shared.rng)
        self._number = shared.clock.wall_ns() // 1_000_000
        self._store_id = ""
        self._session: AgentSession | None = None
        self._lanes: dict[Any, Lane] = {}
        self._opening: asyncio.Future[None] | None = None
        self._task: asyncio.Task[None] | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._timer_at = 0.0
        self._feeding: asyncio.TimerHandle | None = None
        self._live_timer: asyncio.TimerHandle | None = None
        self._since_s: float | None = None
        self._up_s = 0.0
        self._patience = 1  # as the agent's: see edge_agent.uplink.uplink
        self._check_s = self._ping_s = 0.0
        self._stopped = False
        self.outbox = MemoryOutbox(
            epoch=shared.rng.getrandbits(63) | 1,
            writer=f"{name}-{self._number}",
            quota_bytes=OUTBOX_BYTES,
            on_stored=self._stored,
        )
        self.channels = SimChannels(self._watched)
        made: Any = self.channels
        outbox: Any = self.outbox
        self._queues = Queues(made, outbox, LiveQueue(), Linger(), Budget(now_s=self._clock.monotonic_s()))
        self._who = Identity(
            robot_id=name,
            session_id=shared.rng.randbytes(16),
            agent_version="load",
            namespace=f"/{name}",
            hostname=name,
        )

    # -- its life ---------------------------------------------------------------------------------------------------

    @property
    def up(self) -> bool:
        """Whether its link is up."""
        return self._session is not None and self._session.established

    def start(self) -> None:
        """Connect, and begin to hand over its load."""
        self._attempt()
        if self.load.rows or self.load.samples:
            first_s = self._shared.rng.random() * self.load.period_s
            self._feeding = self._shared.loop.call_later(first_s, self._feed)

    def stop_load(self) -> None:
        """No more of its load; what is held goes on to the gateway."""
        self.load = Load(name="stopped")
        if self._feeding is not None:
            self._feeding.cancel()

    def cut(self, *, for_s: float = 0.0) -> None:
        """Its network goes, for so long at least."""
        if self._session is not None:
            self._down("cut", hold_s=for_s)

    def stop(self) -> None:
        """For good."""
        self._stopped = True
        self.stop_load()
        if self._task is not None:
            self._task.cancel()
        if self._session is not None:
            self._down("stopped")

    # -- the link ---------------------------------------------------------------------------------------------------

    def _attempt(self) -> None:
        if not self._stopped:
            if self._since_s is None:
                self._since_s = self._clock.monotonic_s()
            self._task = self._shared.loop.create_task(self._connect())

    async def _connect(self) -> None:
        """All lanes, one after the other, from Hello to Welcome, as the agent's uplink opens them."""
        self._number += 1
        session = self._session = AgentSession(
            self._who, self._number, self._queues, clock=self._clock, store_id=self._store_id
        )
        shared = self._shared
        try:
            for lane in LANES:
                async with asyncio.timeout(OPEN_S * self._patience):
                    callbacks = LaneCallbacks(
                        partial(self._frame, session, lane),
                        lambda why: self._over(session, why),
                        self._pump,
                    )
                    self._lanes[lane] = await shared.open_lane(shared.host, shared.port, callbacks, shared.traffic)
                    welcomed = self._opening = shared.loop.create_future()
                    self._lanes[lane].write(session.hello(lane).SerializeToString())
                    await welcomed
        except TimeoutError:
            waited_s = OPEN_S * self._patience
            self._patience = min(2 * self._patience, MOST_PATIENCE)
            self._over(session, f"no answer within {waited_s:g} s")
        except OSError as error:
            self._over(session, f"connect: {type(error).__name__}")
        except LinkError:
            pass  # it is down already

    def _frame(self, session: AgentSession, lane: Any, data: bytes) -> None:
        """A frame of the gateway."""
        if session is not self._session:
            return
        frame = link_pb2.GatewayFrame.FromString(data)
        kind = frame.WhichOneof("frame")
        if kind == "retry_later":
            self._counts.put_off[frame.retry_later.reason] += 1
        try:
            for event in session.receive(lane, frame):
                self._happened(session, event)
        except RefusedError as error:
            self._counts.goodbyes[error.reason] += 1
            self._over(session, f"goodbye: {error.reason}", hold_s=error.retry_after_s)
            return
        except (LinkError, FrameError, BehindError) as error:
            self._over(session, type(error).__name__)
            return
        if kind == "heartbeat" and (trip_s := session.offset.last_round_trip_s) is not None:
            self._counts.beat_s.add(trip_s)
        if kind == "welcome" and self._opening is not None and not self._opening.done():
            self._opening.set_result(None)
        self._pump()

    def _happened(self, session: AgentSession, event: Any) -> None:
        if isinstance(event, Established):
            now_s = self._clock.monotonic_s()
            self._store_id, self.outbox.online = event.store_id, True
            self._queues.budget.new_link(now_s)
            self._counts.up += 1
            self._counts.ups += 1
            self._counts.up_s.add(now_s - (self._since_s if self._since_s is not None else now_s))
            self._since_s, self._up_s, self._patience = None, now_s, 1
        elif isinstance(event, CommandArrived):
            self._counts.commands += 1
            session.answer(link_pb2.CommandResult(command_id=event.command.command_id, ok=True))

    def _over(self, session: AgentSession, why: str, *, hold_s: float = 0.0) -> None:
        """The session ended: come back after the back-off."""
        if session is self._session:
            self._down(why, hold_s=hold_s)

    def _down(self, why: str, *, hold_s: float = 0.0) -> None:
        session, self._session = self._session, None
        if session is not None and session.established:
            self._counts.up -= 1
            if self._clock.monotonic_s() - self._up_s >= STEADY_S:
                self._backoff.reset()
        self._counts.downs[why] += 1
        self.outbox.online = False
        self.channels.demand({})
        self._queues.live.clear()
        for lane in self._lanes.values():
            lane.close()
        self._lanes.clear()
        if self._opening is not None and not self._opening.done():
            self._opening.set_exception(LinkError(why))
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if not self._stopped:
            self._shared.loop.call_later(max(hold_s, self._backoff.next_s()), self._attempt)

    # -- what goes out ----------------------------------------------------------------------------------------------

    def _pump(self) -> None:
        """Write what the session has for its lanes, and come back when time alone makes more of it."""
        session = self._session
        if session is None:
            return
        wait_s = CHECK_S
        try:
            for lane, connection in list(self._lanes.items()):
                while not connection.full and (frame := session.next_frame(lane)) is not None:
                    connection.write(frame)
                    if session is not self._session:
                        return
                if not connection.full and (lane_s := session.wait_s(lane)) is not None:
                    wait_s = min(wait_s, lane_s)
        except LinkError as error:
            self._over(session, type(error).__name__)
            return
        at = self._shared.loop.time() + max(wait_s, 0.001)
        if self._timer is None or at < self._timer_at - 0.0005:
            if self._timer is not None:
                self._timer.cancel()
            self._timer, self._timer_at = self._shared.loop.call_at(at, self._due), at

    def _due(self) -> None:
        """The timer: what is due, and from time to time a look at whether the gateway lives."""
        self._timer = None
        session, now_s = self._session, self._clock.monotonic_s()
        if session is None:
            return
        if now_s >= self._check_s and session.established:
            self._check_s = now_s + CHECK_S
            try:
                session.check()
            except LinkError as error:
                self._over(session, type(error).__name__)
                return
        if now_s >= self._ping_s:
            self._ping_s = now_s + PING_S
            for lane in self._lanes.values():
                lane.ping()
        self._pump()

    def _feed(self) -> None:
        """One period's load."""
        load, now_ns = self.load, self._clock.wall_ns()
        self._feeding = self._shared.loop.call_later(load.period_s, self._feed)
        if load.rows:
            body = metric_body(self.rows + 1, load.rows, now_ns, period_ns=round(load.period_s * 1e9))
            self.outbox.append("metric", METRICS, Kind.METRICS, load.rows, body, now_ns=now_ns)
            self.rows += load.rows
            self._counts.rows += load.rows
        if load.samples:
            body = sample_body(self.samples + 1, load.samples, load.sample_bytes, now_ns)
            self.outbox.append("bulk", BULK, Kind.SAMPLES, load.samples, body, now_ns=now_ns)
            self.samples += load.samples
            self._counts.samples += load.samples
        self._pump()

    def _watched(self, wanted: bool) -> None:
        if wanted and self._live_timer is None and self.load.live_hz:
            self._live_timer = self._shared.loop.call_later(self._shared.rng.random() / self.load.live_hz, self._live)
        elif not wanted and self._live_timer is not None:
            self._live_timer.cancel()
            self._live_timer = None

    def _live(self) -> None:
        """One live sample; its stamp is when it was made."""
        if not self.load.live_hz:
            self._live_timer = None
            return
        self._live_timer = self._shared.loop.call_later(1.0 / self.load.live_hz, self._live)
        channel: Any = self.channels.live
        self._queues.live.append(channel, self._clock.wall_ns(), noise(channel.live_seq + 1, self.load.live_bytes))
        self._queues.linger.add(self.load.live_bytes, self._clock.monotonic_s())
        self._counts.live += 1
        self._pump()

    def _stored(self, frame: Frame) -> None:
        self._counts.stored += 1
        if frame.stream_id < 1 << 31:  # of the back-fill it says how long the link was away
            took_s = max(0.0, (self._clock.wall_ns() - frame.wall_ns) / 1e9)
            self._counts.acknowledged(took_s)
            if self._shared.on_stored is not None:
                self._shared.on_stored(self, took_s)
