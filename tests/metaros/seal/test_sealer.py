"""No nonce is used twice with a data key: not after a reboot, in a clone, or when the clock jumps."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import pytest

from metaros.clock import ManualClock
from metaros.limits import LIMITS
from metaros.seal import Head, Keyring, Opener, Origin, Sealer, SealKey, parse_head

ODOM = Origin(robot="r1", topic="/odom", type_name="nav_msgs/msg/Odometry", type_hash="RIHS01_aa")
FRAMES = 20_000


def used(head: Head) -> tuple[bytes, bytes, int, bytes]:
    """What must be used once only: all that makes the data key, and the nonce."""
    return (head.key_id, head.boot, head.stream, head.nonce)


def test_frames_over_reboots_clones_and_clock_jumps_use_no_nonce_twice() -> None:
    ring = Keyring((SealKey.make(ManualClock()),))
    seen: set[tuple[bytes, bytes, int, bytes]] = set()
    for life in range(20):  # each starts from the same disk with the same or an earlier time, as a clone does
        clock = ManualClock(wall_ns=1_700_000_000_000_000_000 - (life % 3) * 10**15, monotonic_s=5.0)
        sealer = Sealer(ring, clock)
        for number in range(FRAMES // 20):
            if number % 200 == 0:
                clock.jump_wall(-86_400.0)
            sealed = sealer.seal(b"", ODOM, stream=1 + number % 2, epoch=9, seq=1 + number // 2)
            seen.add(used(parse_head(sealed)))
    assert len(seen) == FRAMES


def test_the_same_sample_sealed_again_after_a_failed_write_gets_another_nonce() -> None:
    sealer = Sealer(Keyring((SealKey.make(ManualClock()),)), ManualClock())
    first, again = (sealer.seal(b"same", ODOM, stream=1, epoch=1, seq=1) for _ in range(2))
    assert first != again
    assert parse_head(first).nonce != parse_head(again).nonce


FORK = """
import os
from metaros.clock import ManualClock
from metaros.seal import Keyring, Origin, Sealer, SealKey
origin = Origin(robot="r1", topic="/odom", type_name="nav_msgs/msg/Odometry", type_hash="")
sealer = Sealer(Keyring((SealKey.make(ManualClock()),)), ManualClock())
def said():
    os.write(1, (sealer.seal(b"x", origin, stream=1, epoch=1, seq=1)[:37].hex() + chr(10)).encode())
said()
if os.fork():
    os.wait()
said()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="forks are Unix's")
def test_a_forked_child_does_not_go_on_with_its_parents_nonces() -> None:
    done = subprocess.run([sys.executable, "-c", FORK], capture_output=True, text=True, timeout=60, check=True)
    heads = done.stdout.split()
    assert len(heads) == 3
    assert len(set(heads)) == 3


def test_a_data_key_is_made_anew_before_it_seals_more_than_the_limit() -> None:
    ring = Keyring((SealKey.make(ManualClock()),))
    sealer = Sealer(ring, ManualClock(), limits=replace(LIMITS, seal_frames_per_key=3))
    sealed = [sealer.seal(b"x", ODOM, stream=1, epoch=1, seq=seq) for seq in range(1, 8)]
    boots = [parse_head(each).boot for each in sealed]
    assert [boots.count(boot) for boot in dict.fromkeys(boots)] == [3, 3, 1]
    opener = Opener(ring)
    assert all(opener.open(each, ODOM, seq=seq).payload == b"x" for seq, each in enumerate(sealed, 1))


def test_a_data_key_seals_for_seven_days_at_most() -> None:
    clock = ManualClock()
    sealer = Sealer(Keyring((SealKey.make(clock),)), clock)

    def boot() -> bytes:
        return parse_head(sealer.seal(b"x", ODOM, stream=1, epoch=1, seq=1)).boot

    first = boot()
    clock.advance(LIMITS.seal_key_s - 1)
    assert boot() == first
    clock.advance(1)
    assert boot() != first
    assert LIMITS.seal_key_s == 7 * 86_400
    assert LIMITS.seal_frames_per_key == 2**32


def test_another_keyring_seals_from_the_next_payload_on() -> None:
    clock = ManualClock()
    old = Keyring((SealKey.make(clock),))
    new = old.rotated(SealKey.make(clock))
    sealer = Sealer(old, clock)
    before = sealer.seal(b"a", ODOM, stream=1, epoch=1, seq=1)
    sealer.use(new)
    after = sealer.seal(b"b", ODOM, stream=1, epoch=1, seq=2)
    assert (parse_head(before).key_id, parse_head(after).key_id) == (old.current.key_id, new.current.key_id)
    opener = Opener(new)
    assert (opener.open(before, ODOM).payload, opener.open(after, ODOM).payload) == (b"a", b"b")


def test_streams_and_robots_have_data_keys_of_their_own_and_their_number_is_bounded() -> None:
    sealer = Sealer(Keyring((SealKey.make(ManualClock()),)), ManualClock(), limits=replace(LIMITS, seal_streams=4))
    boots = {parse_head(sealer.seal(b"x", ODOM, stream=n, epoch=1, seq=1)).boot for n in range(10)}
    assert len(boots) == 10
    assert len(sealer._keys) == 4
