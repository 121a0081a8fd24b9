"""What is heard of all that is to be played."""

from __future__ import annotations

import numpy as np

from metaros.drivers.speaker.mixer import CLIPS, JitterBuffer, Mixer

RATE, PIECE = 1000, 20  # 20 ms; a stream begins with 60 and holds at most 300


def sound(value: float, samples: int = PIECE) -> np.ndarray:
    return np.full(samples, value, np.float32)


def playing(mixer: Mixer) -> set[float]:
    return set(np.unique(mixer.take(PIECE)).tolist())


def test_a_stream_gathers_before_it_begins_and_again_after_it_ran_dry() -> None:
    buffer = JitterBuffer(RATE)
    for _ in range(2):
        assert buffer.push(sound(1, 59)) == 0
        assert buffer.take(PIECE) is None
        buffer.push(sound(1, 1))
        taken = [buffer.take(PIECE) for _ in range(4)]
        assert [None if part is None else len(part) for part in taken] == [20, 20, 20, None]


def test_what_is_too_old_is_skipped() -> None:
    buffer = JitterBuffer(RATE)
    assert buffer.push(np.arange(300, dtype=np.float32)) == 0
    assert buffer.push(np.arange(300, 320, dtype=np.float32)) == 260
    taken = buffer.take(PIECE)
    assert taken is not None
    assert taken[0] == 260
    assert buffer.push(np.zeros(1_000_000, np.float32)) > 900_000


def test_talk_before_streams_before_clips() -> None:
    mixer = Mixer(RATE)
    assert mixer.clip(sound(0.1, 500))
    assert playing(mixer) == {np.float32(0.1)}
    mixer.stream(sound(0.2, 100))
    assert (playing(mixer), mixer.playing) == ({np.float32(0.2)}, "stream")
    mixer.talk(sound(0.3, 100))
    assert (playing(mixer), mixer.playing) == ({np.float32(0.3)}, "talk")
    mixer.talk_ends()
    assert playing(mixer) == {np.float32(0.2)}  # the stream went on meanwhile
    for _ in range(5):
        mixer.take(PIECE)
    assert (playing(mixer), mixer.playing) == ({0.0}, "nothing")  # and the clip was interrupted
    assert mixer.counters["clips_interrupted"] == 1


def test_clips_wait_for_each_other_and_are_bounded() -> None:
    mixer = Mixer(RATE)
    assert [mixer.clip(sound(0.1 * (number + 1))) for number in range(CLIPS + 1)] == [True] * CLIPS + [False]
    assert playing(mixer) == {np.float32(0.1)}
    assert playing(mixer) == {np.float32(0.2)}
    mixer.no_clips()
    assert playing(mixer) == {0.0}
    assert mixer.counters["clips_refused"] == 1


def test_nothing_of_before_is_played_after_an_absence() -> None:
    mixer = Mixer(RATE)
    mixer.talk(sound(1, 100))
    mixer.stream(sound(1, 100))
    mixer.clip(sound(1, 100))
    mixer.silence()
    assert playing(mixer) == {0.0}
