"""From frame to frame through the tree of one time: which samples join two frames, and what they make together."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from metaros.ros2.tf2_py.caches import Cache, Gap, Sample
from metaros.ros2.tf2_py.exceptions import ConnectivityException, ExtrapolationException, LookupException
from metaros.ros2.tf2_py.rotations import (
    IDENTITY,
    ORIGIN,
    Quaternion,
    Vector,
    canonical,
    conjugate,
    multiply,
    rotate,
)

__all__ = ["Frames", "Pose", "chain", "joined", "latest_common_ns", "pose_between"]

MOST_STEPS: Final = 1000  # a tree this deep is one that runs in a circle

Frames = Mapping[str, Cache | None]  # a root is known, and nothing is known of it
Pose = tuple[Vector, Quaternion]


def pose_between(frames: Frames, target: str, source: str, time_ns: int) -> Pose:
    """Where `source` is in `target`; the time is no 0 unless all between them is static.

    Raises:
        ConnectivityException, ExtrapolationException, LookupException: as tf2 does.
    """
    up: list[Sample] = []
    down: list[Sample] = []

    def step(cache: Cache, steps: list[Sample]) -> str | Gap:
        found = cache.at(time_ns)
        if isinstance(found, Gap):
            return found
        steps.append(found)
        return found.parent

    common, _ = _meet(frames, target, source, lambda cache: step(cache, up), lambda cache: step(cache, down))
    source_at, source_turned = _climbed(up[:common])
    target_at, target_turned = _climbed(down)
    back = conjugate(target_turned)
    apart = (source_at[0] - target_at[0], source_at[1] - target_at[1], source_at[2] - target_at[2])
    return rotate(back, apart), canonical(multiply(back, source_turned))


def joined(frames: Frames, target: str, source: str, time_ns: int) -> None:
    """Whether there is such a pose: raises what `pose_between` would raise."""

    def step(cache: Cache) -> str | Gap:
        return cache.parent_at(time_ns)

    _meet(frames, target, source, step, step)


def chain(frames: Frames, target: str, source: str, time_ns: int) -> list[str]:
    """The frames from `source` to `target`, both included."""
    up, down = [source], [target]

    def step(cache: Cache, names: list[str]) -> str | Gap:
        found = cache.parent_at(time_ns)
        if isinstance(found, str):
            names.append(found)
        return found

    common, _ = _meet(frames, target, source, lambda cache: step(cache, up), lambda cache: step(cache, down))
    return up[: common + 1] + down[-2::-1]


def latest_common_ns(frames: Frames, target: str, source: str) -> int:
    """The newest time of which all between the two frames is known; 0 if all of it is static.

    Raises:
        ConnectivityException, LookupException: nothing joins them, or they are in a circle.
    """
    if source == target:
        cache = frames.get(source)
        return 0 if cache is None else cache.span_ns()[1]
    up: list[int] = []
    down: list[int] = []

    def step(cache: Cache, times: list[int]) -> str | Gap:
        latest = cache.latest()
        if latest is None:
            return Gap("empty", 0, 0)
        times.append(latest[0])
        return latest[1]

    try:
        common, _ = _meet(frames, target, source, lambda cache: step(cache, up), lambda cache: step(cache, down))
    except ExtrapolationException:
        raise _unconnected(target, source) from None
    return min((time_ns for time_ns in up[:common] + down if time_ns), default=0)


def _climbed(steps: list[Sample]) -> Pose:
    """Where the frame below the first step is, seen from above the last."""
    at, turned = ORIGIN, IDENTITY
    for _, _, translation, rotation in steps:
        x, y, z = rotate(rotation, at)
        at = (x + translation[0], y + translation[1], z + translation[2])
        turned = multiply(rotation, turned)
    return at, turned


def _meet(
    frames: Frames,
    target: str,
    source: str,
    step_up: Callable[[Cache], str | Gap],
    step_down: Callable[[Cache], str | Gap],
) -> tuple[int, str]:
    """Climb from both frames to the first that is above both: how many steps it is from `source`, and its name.

    From the source it goes up as far as there is data, past the meeting; the caller cuts that off.
    """
    reached = {source: 0}
    frame, steps, gap = source, 0, ""
    while frame != target:
        cache = frames.get(frame)
        if cache is None:
            break
        found = step_up(cache)
        if isinstance(found, Gap):
            gap = found.text(frame)  # there may be a way all the same
            break
        frame, steps = found, steps + 1
        reached.setdefault(frame, steps)
        if steps > MOST_STEPS:
            raise _circle(frames, target, source)
    frame, steps = target, 0
    while frame not in reached:
        cache = frames.get(frame)
        if cache is None:
            raise ExtrapolationException(gap + _while(target, source)) if gap else _unconnected(target, source)
        found = step_down(cache)
        if isinstance(found, Gap):
            raise ExtrapolationException(found.text(frame) + _while(target, source))
        frame, steps = found, steps + 1
        if steps > MOST_STEPS:
            raise _circle(frames, target, source)
    return reached[frame], frame


def _while(target: str, source: str) -> str:
    return f", when looking up transform from frame [{source}] to frame [{target}]"


def _unconnected(target: str, source: str) -> ConnectivityException:
    return ConnectivityException(
        f"Could not find a connection between '{target}' and '{source}': they are in trees that nothing joins"
    )


def _circle(frames: Frames, target: str, source: str) -> LookupException:
    """Says who is in it: walks on from the source for as long as names are new."""
    names: list[str] = []
    frame: str | Gap = source
    while isinstance(frame, str) and frame not in names and len(names) < 20:
        names.append(frame)
        cache = frames.get(frame)
        if cache is None:
            break
        frame = cache.parent_at(0)
    return LookupException(
        f"The tf tree is invalid because it contains a loop, met on the way from [{source}] to [{target}]: "
        f"{' -> '.join(names)} …"
    )
