"""The window: what is out is counted until it is acknowledged."""

from __future__ import annotations

import random  # noqa: TID251 - seeded

import pytest

from edge_agent.uplink.window import Window


def test_it_closes_by_batches_or_bytes_and_opens_with_acknowledgements() -> None:
    window = Window(max_bytes=1000, max_batches=2)
    assert window.open()
    window.sent(1, 5, 10, 400, 0.0)
    assert window.open()
    window.sent(1, 6, 3, 100, 0.0)
    assert not window.open()
    assert window.acknowledged(1, 5, 9, 1.0) == 0, "the frame's last number is what counts"
    assert window.acknowledged(1, 5, 10, 1.0) == 400
    assert window.open()
    window.sent(1, 5, 11, 900, 2.0)
    assert not window.open()
    assert (window.batches, window.size_bytes) == (2, 1000)


def test_nothing_is_ever_open_before_a_welcome() -> None:
    assert not Window().open()


def test_streams_and_epochs_are_reported_apart() -> None:
    window = Window(max_bytes=1000, max_batches=10)
    window.sent(1, 5, 1, 10, 0.0)
    window.sent(2, 5, 1, 20, 0.0)
    assert window.acknowledged(3, 5, 9, 0.0) == 0
    assert window.acknowledged(1, 6, 9, 0.0) == 0
    assert window.acknowledged(2, 5, 9, 0.0) == 20
    assert window.size_bytes == 10


def test_how_long_it_waits_is_counted_from_the_last_acknowledgement() -> None:
    window = Window(max_bytes=1000, max_batches=10)
    window.sent(1, 5, 1, 10, 3.0)
    window.sent(1, 5, 2, 10, 7.0)
    assert window.waiting_since_s == 3.0
    window.acknowledged(1, 5, 1, 9.0)
    assert window.waiting_since_s == 9.0
    window.acknowledged(1, 5, 2, 9.5)
    window.sent(1, 5, 3, 10, 20.0)
    assert window.waiting_since_s == 20.0


def test_what_is_cleared_is_forgotten() -> None:
    window = Window(max_bytes=1000, max_batches=10)
    window.sent(1, 5, 1, 10, 0.0)
    window.clear()
    assert (window.batches, window.size_bytes, window.open()) == (0, 0, True)
    assert window.acknowledged(1, 5, 1, 0.0) == 0
    assert (window.batches, window.size_bytes) == (0, 0)


@pytest.mark.parametrize("seed", range(20))
def test_it_never_loses_count(seed: int) -> None:
    rng = random.Random(seed)
    window, last = Window(max_bytes=1 << 30, max_batches=1 << 30), dict.fromkeys(range(3), 0)
    out: list[tuple[int, int, int]] = []
    for _ in range(300):
        stream = rng.randrange(3)
        if rng.random() < 0.6:
            last[stream] += rng.randrange(1, 5)
            size = rng.randrange(100)
            window.sent(9, stream, last[stream], size, 0.0)
            out.append((stream, last[stream], size))
        else:
            seq = rng.randrange(last[stream] + 3)
            window.acknowledged(9, stream, seq, 0.0)
            out = [item for item in out if item[0] != stream or item[1] > seq]
        assert (window.batches, window.size_bytes) == (len(out), sum(size for _, _, size in out))
