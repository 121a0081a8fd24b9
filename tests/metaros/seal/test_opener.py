"""What came before is told; data keys are bounded."""

from __future__ import annotations

import pytest

from metaros.clock import ManualClock
from metaros.errors import ReplayError
from metaros.seal import Keyring, Opener, Origin, Sealer, SealKey, SeenFrames

ODOM = Origin(robot="r1", topic="/odom", type_name="nav_msgs/msg/Odometry", type_hash="")
RING = Keyring((SealKey.make(ManualClock()),))


def test_a_frame_that_came_before_is_a_replay_and_each_number_is_its_own() -> None:
    sealer, opener, seen = Sealer(RING, ManualClock()), Opener(RING), SeenFrames()
    frames = [sealer.seal(b"x", ODOM, stream=1, epoch=1, seq=seq) for seq in (1, 2, 8, 9, 4095, 4096, 4097)]
    for frame in reversed(frames):  # late ones are no replays
        seen.note(opener.open(frame, ODOM).head, ODOM)
    for frame in frames:
        with pytest.raises(ReplayError, match="came before"):
            seen.note(opener.open(frame, ODOM).head, ODOM)
    seen.note(opener.open(sealer.seal(b"x", ODOM, stream=1, epoch=2, seq=1), ODOM).head, ODOM)
    seen.note(opener.open(sealer.seal(b"x", ODOM, stream=2, epoch=1, seq=1), ODOM).head, ODOM)


def test_an_opener_keeps_a_bounded_number_of_data_keys_and_opens_them_all() -> None:
    opener = Opener(RING, streams=2)
    frames = [Sealer(RING, ManualClock()).seal(b"x", ODOM, stream=n, epoch=1, seq=1) for n in range(5)]
    assert [opener.open(frame, ODOM).payload for frame in frames * 2] == [b"x"] * 10
    assert len(opener._ciphers) == 2
