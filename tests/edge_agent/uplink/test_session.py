"""The agent's half of the link against a small gateway half, in memory, with a manual clock and seeded faults."""

from __future__ import annotations

import random  # noqa: TID251 - seeded

import pytest
from google.protobuf.message import DecodeError
from hypothesis import given, settings
from hypothesis import strategies as st

from edge_agent.errors import LinkDeadError, LinkError, RefusedError
from edge_agent.link.frames import CommandArrived, ControlFrame, TeleopArrived
from edge_agent.uplink.session import BACKFILL, CONTROL, DATA, LANES, Established
from metaros._proto import link_pb2
from metaros.errors import FrameError
from metaros.idl import type_hash
from metaros.link import BACKFILL_BIT
from tests.edge_agent.parts import accept
from tests.edge_agent.session_rig import BATTERY, EPOCH, TOPICS
from tests.edge_agent.session_rig import SessionRig as Rig
from tests.support.gateways.gateway_half import GatewayHalf


def test_hello_says_who_and_what_is_held() -> None:
    rig = Rig()
    rig.put("/event/a", b"x", "event")
    rig.put("/bulk/a", b"x", "bulk")
    accept(rig.outbox)
    assert rig.connect() == [Established("gw", "store")]
    control, data, backfill = rig.gateway.hellos
    assert (control.robot_id, control.session_number, control.labels["site"]) == ("r", 101, "x")
    assert list(control.writers) == [rig.outbox.writer]
    held = [[(s.stream_id, s.epoch, s.first_seq, s.last_seq) for s in h.streams] for h in rig.gateway.hellos]
    assert held == [[(1, rig.epoch, 1, 1)], [], [(2 | BACKFILL_BIT, rig.epoch, 1, 1)]]
    assert data.lane == DATA
    assert backfill.lane == BACKFILL


def test_nothing_is_sent_before_the_welcome() -> None:
    rig = Rig()
    rig.put("/event/a", b"x", "event")
    rig.clock.advance(1)
    for lane in LANES:
        assert rig.session.next_frame(lane) is None
        assert rig.session.wait_s(lane) is None


@pytest.mark.parametrize("missing", LANES)
def test_nothing_durable_is_sent_while_a_lane_is_not_welcomed(missing: link_pb2.Lane) -> None:
    rig = Rig()
    rig.put("/event/a", b"x", "event")
    rig.put("/bulk/a", b"x", "bulk")
    accept(rig.outbox)
    assert rig.connect([lane for lane in LANES if lane != missing]) == []
    rig.clock.advance(1)
    rig.send()
    assert not rig.session.established
    assert not rig.gateway.rows
    rig.clock.advance(15)
    with pytest.raises(LinkDeadError):
        rig.session.check()
    rig.new_session()
    rig.connect()
    rig.settle()
    assert (rig.gateway.all_rows(1), rig.gateway.all_rows(2)) == ([b"x"], [b"x"])


def test_every_class_arrives() -> None:
    rig = Rig()
    rig.connect()
    rig.put("/event/a", b"event", "event")
    rig.put("/bulk/a", b"bulk", "bulk")
    rig.put("/live/a", b"live", "live")
    rig.row(0.5)
    rig.settle()
    assert rig.gateway.rows[1] == {1: b"event"}
    assert rig.gateway.rows[2] == {1: b"bulk"}
    assert rig.gateway.live[4] == [(1, b"live")]
    assert rig.gateway.rows[0] == {1: (1, 7, 0.5)}
    assert rig.waiting() == 0
    assert set(rig.gateway.channels) == {1, 2, 3, 4, 5}


def test_all_lanes_hear_announcements_heartbeats_and_new_channels() -> None:
    rig = Rig()
    rig.connect()
    rig.send()
    assert [rig.gateway.announced[lane] for lane in LANES] == [{1, 2, 3, 4, 5}] * 3
    assert {lane for lane, _ in rig.gateway.heartbeats} == set(LANES)
    rig.channels.observe("/bulk/new", BATTERY, type_hash(BATTERY), qos="", keeps_all=False)
    rig.send()
    assert all(6 in rig.gateway.announced[lane] for lane in LANES)


def test_linger_fills_live_batches() -> None:
    rig = Rig()
    rig.connect()
    rig.clock.advance(0.01)
    rig.send()
    frames = rig.gateway.frames
    for _ in range(10):
        rig.put("/live/a", b"x", "live")
        assert rig.session.next_frame(DATA) is None
    wait_s = rig.session.wait_s(DATA)
    assert wait_s == pytest.approx(0.005)
    rig.clock.advance(wait_s)
    assert rig.send() == 1
    assert rig.gateway.frames == frames + 1
    assert len(rig.gateway.live[4]) == 10


def test_the_window_stops_data_and_an_ack_opens_it() -> None:
    rig = Rig(GatewayHalf(window_batches=2))
    rig.connect()
    for _ in range(5):
        rig.put("/bulk/a", bytes(600_000), "bulk")
    rig.send()
    assert len(rig.gateway.rows[2]) == 2
    rig.put("/live/a", b"still", "live")
    rig.clock.advance(0.01)
    rig.send()
    assert rig.gateway.live[4], "live is not subject to the window"
    for expected in (4, 5):
        rig.gateway.ack()
        rig.deliver()
        rig.send()
        assert len(rig.gateway.rows[2]) == expected


def test_the_window_in_bytes() -> None:
    rig = Rig(GatewayHalf(window_bytes=1_000_000))
    rig.connect()
    for _ in range(5):
        rig.put("/bulk/a", bytes(600_000), "bulk")
    rig.send()
    assert len(rig.gateway.rows[2]) == 2


def test_a_sample_over_a_batch_travels_in_pieces() -> None:
    rig = Rig()
    rig.connect()
    large = bytes(range(256)) * 12_000
    rig.put("/bulk/a", large, "bulk")
    rig.put("/bulk/a", b"after", "bulk")
    rig.put("/live/a", large, "live")
    rig.settle()
    assert rig.gateway.rows[2] == {1: large, 2: b"after"}
    assert rig.gateway.live[4] == [(1, large)]


def test_overflow_is_declared() -> None:
    rig = Rig(bulk=600_000)
    for number in range(40):
        rig.put("/bulk/a", bytes([number]) * 60_000, "bulk")
        accept(rig.outbox)
    rig.connect()
    rig.settle()
    late = 2 | BACKFILL_BIT
    rows, gaps = set(rig.gateway.rows[late]), set(rig.gateway.gaps[late])
    assert not rows & gaps
    assert rows | gaps == set(range(1, 41))
    assert gaps
    assert set(rig.gateway.gaps[late].values()) == {"outbox_full"}


def test_resume_after_a_loss_sends_each_row_once() -> None:
    rig = Rig()
    rig.connect()
    for number in range(10):
        rig.put("/bulk/a", bytes([number]), "bulk")
    rig.clock.advance(0.01)
    rig.send()
    rig.new_session()
    rig.put("/bulk/a", b"late", "bulk")
    accept(rig.outbox)
    rig.connect()
    rig.settle()
    assert [row for _, row in sorted(rig.gateway.rows[2].items())] == [bytes([n]) for n in range(10)]
    assert rig.gateway.rows[2 | BACKFILL_BIT] == {1: b"late"}
    assert rig.gateway.duplicates == 0
    assert rig.gateway.hellos[-1].session_number == 102


def test_fresh_samples_go_before_what_piled_up() -> None:
    rig = Rig(GatewayHalf(window_batches=1))
    for _ in range(5):
        rig.put("/bulk/a", b"history", "bulk")
        accept(rig.outbox)
    rig.connect()
    rig.put("/bulk/a", b"now", "bulk")
    rig.clock.advance(0.01)
    rig.send()
    assert rig.gateway.rows[2] == {1: b"now"}
    assert len(rig.gateway.rows[2 | BACKFILL_BIT]) < 5
    rig.settle()
    assert len(rig.gateway.rows[2 | BACKFILL_BIT]) == 5


@pytest.mark.parametrize("seed", range(12))
def test_random_faults_leave_rows_and_gaps_disjoint_and_complete(seed: int) -> None:
    rng = random.Random(seed)
    rig = Rig(bulk=600_000, event=600_000, metric=600_000)
    rig.connect()
    for _ in range(300):
        rig.clock.advance(rng.choice([0.0, 0.002, 0.01]))
        match rng.randrange(9):
            case 0 | 1 | 2:
                for _ in range(rng.randrange(1, 12)):
                    stream = rng.choice([1, 2, 3])
                    size = rng.choice([1, 20, 20_000])
                    rig.put(TOPICS[stream - 1], bytes(size), "event" if stream == 1 else "bulk")
            case 3:
                for _ in range(rng.randrange(1, 12)):
                    rig.row(rng.random())
            case 4 | 5:
                rig.send(limit=rng.randrange(1, 6))
            case 6:
                rig.gateway.ack()
                rig.deliver()
            case 7 if rng.random() < 0.3:
                lane = rng.choice(LANES)
                if lane not in rig.gateway.refusing:
                    rig.gateway.ack()  # a gateway forgets what it has not stored, and acknowledges what it has
                    rig.gateway.refuse(lane, rng.getrandbits(32) + 1)
            case 8 if rng.random() < 0.3:
                rig.new_session()
                rig.connect()
    rig.settle()
    for held in rig.outbox.ranges():
        rows, gaps = set(rig.gateway.rows[held.stream_id]), set(rig.gateway.gaps[held.stream_id])
        assert not rows & gaps
        assert rows | gaps == set(range(1, held.last_seq + 1))
    assert rig.gateway.rows


def test_demand_reaches_the_channels() -> None:
    rig = Rig()
    rig.connect()
    demand = link_pb2.Demand(revision=1, entries=[link_pb2.DemandEntry(channel_id=4, max_rate_hz=5)])
    rig.session.receive(CONTROL, link_pb2.GatewayFrame(demand=demand))
    channel = rig.channels.by_id(4)
    assert channel is not None
    assert channel.selector.demand_hz == 5


def test_commands_and_teleop_become_events() -> None:
    rig = Rig()
    rig.connect()
    command = link_pb2.Command(command_id=b"1" * 16)
    (event,) = rig.session.receive(CONTROL, link_pb2.GatewayFrame(command=command))
    assert event == CommandArrived(command, rig.clock.monotonic_s())
    rig.session.answer(link_pb2.CommandResult(command_id=b"1" * 16, ok=True))
    rig.send()
    assert [result.ok for result in rig.gateway.results] == [True]
    teleop = link_pb2.Teleop(seq=1, sent_ns=rig.clock.wall_ns())
    rig.session.receive(CONTROL, link_pb2.GatewayFrame(teleop=teleop))
    rig.clock.advance(0.4)
    (event,) = rig.session.receive(CONTROL, link_pb2.GatewayFrame(teleop=teleop))
    assert isinstance(event, TeleopArrived)
    assert event.age_s == pytest.approx(0.4)


def test_heartbeats_measure_and_answer_a_peer_without_a_round_trip() -> None:
    rig = Rig()
    rig.connect()
    rig.send()
    before = len(rig.gateway.heartbeats)
    first = rig.gateway.heartbeats[0][1]
    rig.clock.advance(0.02)
    beat = link_pb2.Heartbeat(sent_ns=rig.clock.wall_ns(), echo_ns=first.sent_ns, held_ns=0)
    rig.session.receive(CONTROL, link_pb2.GatewayFrame(heartbeat=beat))
    assert rig.session.offset.round_trip_s == pytest.approx(0.02)
    rig.send()
    assert len(rig.gateway.heartbeats) == before
    fresh = link_pb2.Heartbeat(sent_ns=rig.clock.wall_ns())
    rig.session.receive(CONTROL, link_pb2.GatewayFrame(heartbeat=fresh))
    rig.send()
    assert rig.gateway.heartbeats[-1][1].echo_ns == fresh.sent_ns


def test_statistics_every_second_while_there_is_news() -> None:
    rig = Rig()
    rig.connect()
    for _ in range(50):
        rig.queues.live.dropped += 1
        rig.send()
        rig.clock.advance(0.1)
    assert len(rig.gateway.statistics) == 5
    assert len(rig.gateway.statistics[-1].topics) == len(TOPICS)


def test_statistics_without_news_are_rare() -> None:
    rig = Rig()
    rig.connect()
    for _ in range(80):
        rig.send()
        rig.clock.advance(0.25)
    assert len(rig.gateway.statistics) == 2
    rig.queues.live.dropped += 1
    rig.clock.advance(1.0)
    rig.send()
    assert len(rig.gateway.statistics) == 3
    assert next(depth for depth in rig.gateway.statistics[-1].link.classes if depth.name == "live").lost == 1


def test_lanes_beside_control_beat_more_rarely() -> None:
    rig = Rig()
    rig.connect()
    for _ in range(400):
        rig.send()
        rig.clock.advance(0.1)
    lanes = [lane for lane, _ in rig.gateway.heartbeats]
    assert lanes.count(CONTROL) == 8
    assert lanes.count(DATA) == lanes.count(BACKFILL) == 2


def test_silence_kills_the_session() -> None:
    rig = Rig()
    rig.connect()
    rig.clock.advance(14.9)
    rig.session.check()
    rig.clock.advance(0.2)
    with pytest.raises(LinkDeadError, match="nothing received"):
        rig.session.check()


def test_missing_acks_kill_the_session() -> None:
    rig = Rig()
    rig.connect()
    rig.put("/bulk/a", b"x", "bulk")
    rig.clock.advance(0.01)
    rig.send()
    rig.clock.advance(15.1)
    rig.session.receive(CONTROL, link_pb2.GatewayFrame(heartbeat=link_pb2.Heartbeat(sent_ns=1, echo_ns=1)))
    with pytest.raises(LinkDeadError, match="acknowledgement"):
        rig.session.check()


def test_goodbye_ends_the_session_with_its_reason() -> None:
    rig = Rig()
    rig.connect()
    goodbye = link_pb2.Goodbye(code="fenced", message="a newer agent is here", retry_after_ms=5000)
    with pytest.raises(RefusedError, match="fenced: a newer agent") as caught:
        rig.session.receive(DATA, link_pb2.GatewayFrame(goodbye=goodbye))
    assert (caught.value.reason, caught.value.retry_after_s) == ("fenced", 5.0)


def test_another_store_is_refused() -> None:
    rig = Rig()
    rig.connect()
    rig.gateway.welcome.store_id = "other"
    rig.new_session()
    with pytest.raises(RefusedError, match="other_store"):
        rig.connect()


def test_lanes_that_reach_different_gateways_are_no_session() -> None:
    rig = Rig()
    rig.session.receive(CONTROL, link_pb2.GatewayFrame(welcome=rig.gateway.welcome))
    other = link_pb2.Welcome()
    other.CopyFrom(rig.gateway.welcome)
    other.gateway_id = "another"
    with pytest.raises(RefusedError, match="split: its lanes reached the gateways"):
        rig.session.receive(DATA, link_pb2.GatewayFrame(welcome=other))
    rig.new_session()
    rig.connect()
    assert rig.session.established


def test_a_frame_of_a_newer_gateway_is_passed_over() -> None:
    rig = Rig()
    rig.connect()
    unknown = link_pb2.GatewayFrame.FromString(b"\x9a\x06\x02\x08\x01")  # field 99
    assert rig.session.receive(CONTROL, unknown) == []
    assert rig.send() > 0


def test_frames_of_the_managers_are_handed_on() -> None:
    rig = Rig()
    rig.connect()
    rig.settle()
    desired = link_pb2.GatewayFrame(twin=link_pb2.TwinDesired(revision=4))
    leases = link_pb2.GatewayFrame(node_leases=link_pb2.NodeLeases(since_ns=7))
    assert rig.session.receive(CONTROL, desired) == [ControlFrame(desired, rig.clock.monotonic_s())]
    assert rig.session.receive(CONTROL, leases) == [ControlFrame(leases, rig.clock.monotonic_s())]


@pytest.mark.parametrize(
    "frame",
    [
        link_pb2.GatewayFrame(welcome=link_pb2.Welcome(store_id="store")),
        link_pb2.GatewayFrame(ack=link_pb2.Ack(watermarks=[link_pb2.Watermark(stream_id=1, epoch=EPOCH, seq=9)])),
    ],
)
def test_what_breaks_the_protocol_is_a_frame_error(frame: link_pb2.GatewayFrame) -> None:
    rig = Rig()
    rig.put("/event/a", b"x", "event")
    accept(rig.outbox)
    assert rig.epoch == EPOCH
    rig.connect()
    with pytest.raises(FrameError):
        rig.session.receive(DATA, frame)


def parsed_or_empty(data: bytes) -> link_pb2.GatewayFrame:
    try:
        return link_pb2.GatewayFrame.FromString(data)
    except DecodeError:
        return link_pb2.GatewayFrame()


NUMBERS = st.sampled_from([0, 1, 2, 7, 2**31, 2**31 + 2, 2**32 - 1])
WIDE = st.sampled_from([0, 1, 2, EPOCH, 2**63, 2**64 - 1])
SIGNED = st.sampled_from([0, -1, 1, -(2**63), 2**63 - 1])
MARKS = st.builds(link_pb2.Watermark, stream_id=NUMBERS, epoch=WIDE, seq=WIDE)
FLOATS = st.floats(allow_nan=True, allow_infinity=True)
FRAMES = st.one_of(
    st.builds(lambda marks: link_pb2.GatewayFrame(ack=link_pb2.Ack(watermarks=marks)), st.lists(MARKS, max_size=3)),
    st.builds(
        lambda entries: link_pb2.GatewayFrame(demand=link_pb2.Demand(entries=entries)),
        st.lists(st.builds(link_pb2.DemandEntry, channel_id=NUMBERS, max_rate_hz=FLOATS), max_size=3),
    ),
    st.builds(
        lambda *beat: link_pb2.GatewayFrame(
            heartbeat=link_pb2.Heartbeat(sent_ns=beat[0], echo_ns=beat[1], held_ns=beat[2])
        ),
        SIGNED,
        SIGNED,
        SIGNED,
    ),
    st.builds(lambda sent: link_pb2.GatewayFrame(teleop=link_pb2.Teleop(sent_ns=sent)), SIGNED),
    st.builds(
        lambda marks, window, beat: link_pb2.GatewayFrame(
            welcome=link_pb2.Welcome(watermarks=marks, window_bytes=window, heartbeat_s=beat)
        ),
        st.lists(MARKS, max_size=3),
        WIDE,
        FLOATS,
    ),
    st.builds(
        lambda token, after: link_pb2.GatewayFrame(
            retry_later=link_pb2.RetryLater(token=token, retry_after_ms=after, reason="x")
        ),
        WIDE,
        NUMBERS,
    ),
    st.binary(max_size=60).map(parsed_or_empty),
)


@settings(deadline=None)
@given(st.lists(st.tuples(st.sampled_from(LANES), FRAMES), max_size=8))
def test_any_gateway_is_survived(frames: list[tuple[link_pb2.Lane, link_pb2.GatewayFrame]]) -> None:
    rig = Rig()
    for topic, delivery in (("/event/a", "event"), ("/bulk/a", "bulk")):
        rig.put(topic, b"x", delivery)
    accept(rig.outbox)
    try:
        for lane, frame in frames:
            rig.session.receive(lane, frame)
            rig.clock.advance(0.01)
            for each in LANES:
                for _ in range(20):
                    if rig.session.next_frame(each) is None:
                        break
                wait_s = rig.session.wait_s(each)
                assert wait_s is None or wait_s >= 0
            rig.session.check()
    except (FrameError, LinkError):
        return
