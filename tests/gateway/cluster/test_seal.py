"""What crosses between gateways opens for its receiver alone, once, in order."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from gateway.cluster.keys import BOOT_BYTES, MeshKeys, Process
from gateway.cluster.seal import ForgedError, Opener, Sealer, sender_of
from gateway.cluster.wire import MESSAGE_BYTES, PIECE_BYTES, Joiner, Kind, Message, pieces
from gateway.identity import rekey
from gateway.identity.master import MASTER_KEY, MasterKey

A, B, C = (Process(name, name.encode() * BOOT_BYTES) for name in "abc")
KEYS = MeshKeys(MasterKey(b"m" * 32), "store")


def sealer(sender: Process = A, receiver: Process = B, keys: MeshKeys = KEYS) -> Sealer:
    """Of one process for another."""
    return Sealer(sender.boot, keys.between(sender, receiver))


def opener(sender: Process = A, receiver: Process = B, keys: MeshKeys = KEYS) -> Opener:
    """Its other end."""
    return Opener(keys.between(sender, receiver))


def test_it_opens_in_order_and_tells_what_is_missing() -> None:
    one, other = sealer(), opener()
    frames = [one.seal(b"%d" % number) for number in range(5)]
    assert other.open(frames[0]) == (b"0", False)
    assert other.open(frames[1]) == (b"1", False)
    assert other.open(frames[3]) == (b"3", True)
    for early in frames[:4]:
        with pytest.raises(ForgedError):
            other.open(early)
    assert other.open(frames[4]) == (b"4", False)


def test_no_two_frames_are_alike_and_nothing_of_it_is_in_the_open() -> None:
    one = sealer()
    frames = [one.seal(b"the same secret") for _ in range(3)]
    assert len({frame[25:] for frame in frames}) == 3
    assert not any(b"secret" in frame for frame in frames)
    assert sender_of(frames[0]) == A.boot


@pytest.mark.parametrize(
    "stranger",
    [
        opener(A, C),
        opener(C, B),
        opener(B, A),
        opener(A, Process("b", b"x" * BOOT_BYTES)),
        opener(Process("c", A.boot), B),
        opener(keys=MeshKeys(MasterKey(b"o" * 32), "store")),
        opener(keys=MeshKeys(MasterKey(b"m" * 32), "another store")),
    ],
    ids=["another receiver", "another sender", "sent back", "a later life", "another name", "master key", "store"],
)
def test_it_opens_for_nobody_else(stranger: Opener) -> None:
    with pytest.raises(ForgedError):
        stranger.open(sealer().seal(b"x"))


def test_a_changed_byte_is_refused_and_the_next_good_one_opens() -> None:
    one, other = sealer(), opener()
    frame = one.seal(b"x" * 20)
    for place in range(17, len(frame)):
        changed = bytearray(frame)
        changed[place] ^= 1
        with pytest.raises(ForgedError):
            other.open(bytes(changed))
    assert other.open(frame) == (b"x" * 20, False)


@pytest.mark.parametrize("frame", [b"", b"\x01" * 20, b"\x02" + bytes(80)])
def test_what_is_no_frame(frame: bytes) -> None:
    with pytest.raises(ForgedError):
        sender_of(frame)


def test_the_proof_of_a_name_is_of_one_life() -> None:
    assert KEYS.proves(A, KEYS.proof(A))
    assert not KEYS.proves(A, KEYS.proof(B))
    assert not KEYS.proves(Process("a", B.boot), KEYS.proof(A))
    assert not KEYS.proves(A, MeshKeys(MasterKey(b"o" * 32), "store").proof(A))
    assert not KEYS.proves(A, "")


def test_gateways_follow_a_change_of_the_master_key_one_after_the_other(tmp_path: Path) -> None:
    """The new key is given to the second one later; nothing between them is lost meanwhile."""
    files = [tmp_path / name / MASTER_KEY for name in ("one", "two")]
    masters = [MasterKey.load_or_make(files[0].parent)]
    files[1].parent.mkdir()
    files[1].write_bytes(files[0].read_bytes())
    files[1].chmod(0o600)
    masters.append(MasterKey.load_or_make(files[1].parent))
    keys = [MeshKeys(master, "store") for master in masters]
    there, back = (sealer(keys=keys[0]), opener(keys=keys[1])), (sealer(B, A, keys[1]), opener(B, A, keys[0]))

    def both_ways(now_s: float) -> None:
        for own in keys:
            own.look(now_s=now_s)
        there[0].use(keys[0].between(A, B))
        there[1].use(keys[1].between(A, B))
        back[0].use(keys[1].between(B, A))
        back[1].use(keys[0].between(B, A))
        assert there[1].open(there[0].seal(b"x")) == (b"x", False)
        assert back[1].open(back[0].seal(b"x")) == (b"x", False)

    both_ways(1.0)
    rekey.begin(files[0])
    both_ways(2.0)
    second = files[1].with_name("master.key.next")
    second.write_bytes(files[0].with_name("master.key.next").read_bytes())
    second.chmod(0o600)
    both_ways(3.0)
    rekey.finish(files[0])
    both_ways(4.0)
    rekey.finish(files[1])
    both_ways(5.0)
    before = keys[0].roots
    assert len(before) == 2
    both_ways(5000.0)
    assert keys[0].roots == before[:1], "the old key opens nothing for ever"


@pytest.mark.parametrize("size", [0, 1, PIECE_BYTES, PIECE_BYTES + 1, 3 * PIECE_BYTES])
def test_a_message_in_pieces_is_the_same_again(size: int) -> None:
    sent = Message(Kind.ASK, 3, 4, number=2**40, timeout_ms=1500, name="verb", payload=os.urandom(size))
    joiner = Joiner()
    *first, last = list(pieces(sent))
    assert [joiner.take(piece) for piece in first] == [None] * len(first)
    assert joiner.take(last) == sent
    assert len(first) == max(0, -(-size // PIECE_BYTES) - 1)


def test_a_message_over_the_bound_is_neither_sent_nor_taken() -> None:
    with pytest.raises(ValueError, match="17825792"):
        list(pieces(Message(Kind.TELL, 1, 1, payload=bytes(MESSAGE_BYTES + 1))))
    joiner, piece = Joiner(), next(pieces(Message(Kind.TELL, 1, 1, payload=bytes(PIECE_BYTES + 1))))
    for _ in range(68):
        assert joiner.take(piece) is None
    with pytest.raises(ValueError, match="more than"):
        joiner.take(piece)


@pytest.mark.parametrize("piece", [b"", b"short", b"\x00" * 30, b"\x63" * 30])
def test_what_is_no_message(piece: bytes) -> None:
    with pytest.raises(ValueError):
        Joiner().take(piece)
