"""Random trees of frames over time, and what tf2 would say of them by 4x4 matrices alone: a second, plain opinion.

Nothing here is taken from `metaros.ros2.tf2_py`: rotations are matrices, interpolated by the logarithm of the turn
between them, and a path is two climbs to the first frame in common.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["Answer", "Reference", "check_tree", "matrix_of_quaternion"]

Matrix = npt.NDArray[np.float64]
SECOND = 1_000_000_000
DEEPEST = 1000


@dataclass
class Answer:
    """A pose at a time, or an error's name with a word of its text."""

    pose: Matrix | None = None
    stamp_ns: int = 0
    error: str = ""
    word: str = ""


@dataclass
class Reference:
    """What a buffer holds after the same transforms."""

    keep_ns: int
    moving: dict[str, list[tuple[int, str, Matrix]]] = field(default_factory=dict)
    fixed: dict[str, tuple[str, Matrix]] = field(default_factory=dict)
    frames: list[str] = field(default_factory=list)

    def tell(self, child: str, parent: str, stamp_ns: int, pose: Matrix, *, static: bool) -> None:
        """Keep it as tf2 does: for `keep_ns` back from the newest, pruned when the next one comes."""
        for name in (child, parent):
            if name not in self.frames:
                self.frames.append(name)
        if static:
            self.moving.pop(child, None)
            self.fixed[child] = (parent, pose)
            return
        self.fixed.pop(child, None)
        kept = self.moving.setdefault(child, [])
        newest_ns = max((stamp for stamp, _, _ in kept), default=None)
        if newest_ns is not None:
            kept[:] = [sample for sample in kept if sample[0] >= newest_ns - self.keep_ns]
            if stamp_ns < newest_ns - self.keep_ns:
                return
        kept.append((stamp_ns, parent, pose))
        kept.sort(key=lambda sample: sample[0])  # stable: of one time, the last one told is the newest

    def edge(self, child: str, time_ns: int) -> tuple[str, Matrix] | str | None:
        """Parent and pose, or why there is none (a word), or None at a root."""
        if child in self.fixed:
            return self.fixed[child]
        kept = self.moving.get(child)
        if kept is None:
            return None
        if not kept:
            return "no data"
        if time_ns == 0 or time_ns == kept[-1][0]:
            return kept[-1][1:]
        if len(kept) == 1:
            return "the only data"
        if time_ns > kept[-1][0]:
            return "into the future"
        if time_ns < kept[0][0]:
            return "into the past"
        if time_ns == kept[0][0]:
            return kept[0][1:]
        before = [sample for sample in kept if sample[0] <= time_ns][-1]
        after = next(sample for sample in kept if sample[0] > time_ns)
        if before[1] != after[1]:
            return before[1:]
        ratio = (time_ns - before[0]) / (after[0] - before[0])
        return before[1], _between(before[2], after[2], ratio)

    def lookup(self, target: str, source: str, time_ns: int) -> Answer:
        """The pose of `source` in `target`."""
        if target == source:
            kept = self.moving.get(target)
            return Answer(np.eye(4), time_ns or (kept[-1][0] if kept else 0))
        if wrong := self._wrong_names(target, source):
            return wrong
        if time_ns == 0:
            found = self.common_ns(target, source)
            if isinstance(found, Answer):
                return found
            time_ns = found
        up, why_up = self._climb(source, time_ns, {target})
        if why_up == "circle":
            return Answer(error="LookupException", word="loop")
        down, why_down = self._climb(target, time_ns, set(up))
        if why_down == "circle":
            return Answer(error="LookupException", word="loop")
        meeting = list(down)[-1]
        if meeting in up:
            return Answer(np.linalg.inv(down[meeting]) @ up[meeting], time_ns)
        if why_down or why_up:
            return Answer(error="ExtrapolationException", word=why_down or why_up)
        return Answer(error="ConnectivityException", word="connection")

    def lookup_full(self, target: str, target_ns: int, source: str, source_ns: int, fixed: str) -> Answer:
        """By way of a fixed frame."""
        if wrong := self._wrong_names(target, source, fixed):
            return wrong
        first = self.lookup(fixed, source, source_ns)
        then = self.lookup(target, fixed, target_ns)
        if first.pose is None or then.pose is None:
            return first if first.pose is None else then
        return Answer(then.pose @ first.pose, then.stamp_ns)

    def common_ns(self, target: str, source: str) -> int | Answer:
        """The newest time that all edges between have."""

        def newest(frame: str) -> tuple[int, str] | None:
            if frame in self.fixed:
                return 0, self.fixed[frame][0]
            kept = self.moving.get(frame)
            return (kept[-1][0], kept[-1][1]) if kept else None

        def climb(frame: str, stop: set[str]) -> dict[str, list[int]] | None:
            way, times, steps = {frame: []}, [], 0
            while frame not in stop and (latest := newest(frame)) is not None:
                times = [*times, latest[0]]
                frame, steps = latest[1], steps + 1
                way.setdefault(frame, times)
                if steps > DEEPEST:
                    return None
            return way

        up = climb(source, {target})
        down = climb(target, set(up)) if up is not None else None
        if up is None or down is None:
            return Answer(error="LookupException", word="loop")
        meeting = list(down)[-1]
        if meeting not in up:
            return Answer(error="ConnectivityException", word="connection")
        return min((time_ns for time_ns in up[meeting] + down[meeting] if time_ns), default=0)

    def _climb(self, frame: str, time_ns: int, stop: set[str]) -> tuple[dict[str, Matrix], str]:
        """Each frame on the way up with the pose of the first one in it, and why it ended."""
        at, way, steps = np.eye(4), {frame: np.eye(4)}, 0
        while frame not in stop:
            edge = self.edge(frame, time_ns)
            if edge is None or isinstance(edge, str):
                return way, edge or ""
            at = edge[1] @ at
            frame, steps = edge[0], steps + 1
            way.setdefault(frame, at)
            if steps > DEEPEST:
                return way, "circle"
        return way, ""

    def _wrong_names(self, *names: str) -> Answer | None:
        for name in names:
            if not name or name.startswith("/"):
                return Answer(error="InvalidArgumentException", word="Invalid argument")
            if name not in self.frames:
                return Answer(error="LookupException", word="does not exist")
        return None


def check_tree(seed: int, buffer_core: Any, errors: Any, *, questions: int = 20) -> int:
    """Tell both the same tree, ask both the same; how many poses were the same. AssertionError names what was not.

    `buffer_core` is the class, `errors` the module of its exceptions.
    """
    rng = np.random.default_rng(seed)
    keep_ns = int(rng.choice([1, 3, 10, 40])) * SECOND
    reference, buffer = Reference(keep_ns), buffer_core(SimpleNamespace(nanoseconds=keep_ns))
    names, stamps = _tell(rng, reference, buffer)
    poses = 0
    for number in range(questions):
        target, source, fixed = (_a_name(rng, names) for _ in range(3))
        first_ns, then_ns = _a_time(rng, stamps), _a_time(rng, stamps)
        if number % 5:
            wanted = reference.lookup(target, source, first_ns)
            asked: tuple[Any, ...] = (target, source, _time(first_ns))
            lookup, can = buffer.lookup_transform_core, buffer.can_transform_core
        else:
            wanted = reference.lookup_full(target, then_ns, source, first_ns, fixed)
            asked = (target, _time(then_ns), source, _time(first_ns), fixed)
            lookup, can = buffer.lookup_transform_full_core, buffer.can_transform_full_core
        what = f"seed {seed}, question {number}: {asked}"
        able, why = can(*asked)
        assert able == (wanted.pose is not None), f"{what}: can_transform says {able} ({why}), not {wanted}"
        if wanted.pose is None:
            try:
                found: Any = lookup(*asked)
            except errors.TransformException as error:
                found = error
            assert type(found).__name__ == wanted.error, f"{what}: {found!r}, not {wanted}"
            assert wanted.word in str(found), f"{what}: {found!r}, not {wanted}"
        else:
            _compare(lookup(*asked), wanted, target, source, what)
            poses += 1
    return poses


def _compare(found: Any, wanted: Answer, target: str, source: str, what: str) -> None:
    assert wanted.pose is not None
    stamp = found.header.stamp
    said = (found.header.frame_id, found.child_frame_id, stamp.sec * SECOND + stamp.nanosec)
    assert said == (target, source, wanted.stamp_ns), f"{what}: {said}, not {(target, source, wanted.stamp_ns)}"
    at, turned = found.transform.translation, found.transform.rotation
    pose = np.eye(4)
    pose[:3, :3] = matrix_of_quaternion(turned.x, turned.y, turned.z, turned.w)
    pose[:3, 3] = (at.x, at.y, at.z)
    off = float(np.abs(pose - wanted.pose).max())
    assert off < 1e-8, f"{what}: off by {off}: {pose} and {wanted.pose}"
    leading = turned.w if np.trace(pose[:3, :3]) > 1e-9 else max(turned.x, turned.y, turned.z, turned.w, key=abs)
    assert leading > 0 or abs(np.trace(pose[:3, :3])) < 1e-6, f"{what}: the other quaternion of the rotation: {turned}"


def _tell(rng: np.random.Generator, reference: Reference, buffer: Any) -> tuple[list[str], list[int]]:
    """A forest with static edges, gaps, frames that change their parents, now and then a circle."""
    names = [f"f{number}" for number in range(int(rng.integers(2, 11)))]
    circles = rng.random() < 0.05
    told: list[tuple[int, str, str, Matrix, npt.NDArray[np.float64], bool]] = []
    for number, child in enumerate(names):
        if not circles and (number == 0 or rng.random() < 0.12):
            continue  # a root
        above = [name for name in names if name != child] if circles else names[:number]
        parent = str(rng.choice(above))
        static = bool(rng.random() < 0.3)
        start_ns = 1000 * SECOND + int(rng.integers(0, 12)) * SECOND // 2
        turned, at = _unit(rng.normal(size=4)), rng.normal(size=3) * 5
        for _ in range(1 if static or rng.random() < 0.1 else int(rng.integers(2, 14))):
            told.append((start_ns, child, parent, _pose(turned, at), turned, static))
            start_ns += int(rng.choice([1, 1000, SECOND // 10, SECOND // 2, 3 * SECOND])) + int(rng.integers(0, 5))
            turned = _stepped(rng, turned)
            at = at + rng.normal(size=3)
            if rng.random() < 0.06:
                parent = str(rng.choice(above))
            if rng.random() < 0.03:
                start_ns -= 2 * SECOND
    if rng.random() < 0.7:
        told.sort(key=lambda one: one[0])
    else:
        rng.shuffle(told)  # type: ignore[arg-type]  # a list is fine
    for stamp_ns, child, parent, pose, turned, static in told:
        reference.tell(child, parent, stamp_ns, pose, static=static)
        message = _message(child, parent, stamp_ns, pose, turned)
        (buffer.set_transform_static if static else buffer.set_transform)(message, "tests")
    return names, [one[0] for one in told]


def _a_name(rng: np.random.Generator, names: list[str]) -> str:
    chance = rng.random()
    if chance < 0.02:
        return str(rng.choice(["", "/f0", "nobody"]))
    return str(rng.choice(names))


def _a_time(rng: np.random.Generator, stamps: list[int]) -> int:
    chance = rng.random()
    if chance < 0.2 or not stamps:
        return 0
    if chance < 0.4:
        return int(rng.choice(stamps))
    low, high = min(stamps), max(stamps)
    if chance < 0.5:
        return int(rng.integers(low - 3 * SECOND, high + 3 * SECOND))
    return int(rng.integers(low, high + 1))


def _time(time_ns: int) -> Any:
    return SimpleNamespace(nanoseconds=time_ns)


def _message(child: str, parent: str, stamp_ns: int, pose: Matrix, turned: npt.NDArray[np.float64]) -> Any:
    x, y, z, w = (float(part) for part in turned)
    return SimpleNamespace(
        header=SimpleNamespace(
            stamp=SimpleNamespace(sec=stamp_ns // SECOND, nanosec=stamp_ns % SECOND), frame_id=parent
        ),
        child_frame_id=child,
        transform=SimpleNamespace(
            translation=SimpleNamespace(x=float(pose[0, 3]), y=float(pose[1, 3]), z=float(pose[2, 3])),
            rotation=SimpleNamespace(x=x, y=y, z=z, w=w),
        ),
    )


def _unit(four: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return four / np.linalg.norm(four)


def _stepped(rng: np.random.Generator, turned: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """A rotation up to 2.8 rad away (at half a turn there is no shortest way), as either of its two quaternions."""
    axis = _unit(rng.normal(size=3))
    half = rng.uniform(0, 1.4)
    ax, ay, az = axis * np.sin(half)
    aw, (bx, by, bz, bw) = np.cos(half), turned
    made = np.array(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ]
    )
    return made if rng.random() < 0.5 else -made


def _pose(turned: npt.NDArray[np.float64], at: npt.NDArray[np.float64]) -> Matrix:
    pose = np.eye(4)
    pose[:3, :3] = matrix_of_quaternion(*turned)
    pose[:3, 3] = at
    return pose


def matrix_of_quaternion(x: float, y: float, z: float, w: float) -> Matrix:
    """By Rodrigues' formula, from the axis and the angle."""
    sine, cosine = float(np.sqrt(x * x + y * y + z * z)), w
    if sine == 0.0:
        return np.eye(3)
    angle = 2.0 * np.arctan2(sine, cosine)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) / sine
    made: Matrix = np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * (k @ k)
    return made


def _between(start: Matrix, end: Matrix, ratio: float) -> Matrix:
    """Along the line, and along the turn: its logarithm, times the ratio."""
    made = np.eye(4)
    made[:3, 3] = start[:3, 3] + ratio * (end[:3, 3] - start[:3, 3])
    turn = start[:3, :3].T @ end[:3, :3]
    skew = (turn - turn.T) / 2.0
    sine = float(np.sqrt(skew[2, 1] ** 2 + skew[0, 2] ** 2 + skew[1, 0] ** 2))
    angle = float(np.arctan2(sine, (np.trace(turn) - 1.0) / 2.0))
    if sine < 1e-12:
        made[:3, :3] = start[:3, :3]
        return made
    k = skew / sine
    part = np.eye(3) + np.sin(ratio * angle) * k + (1 - np.cos(ratio * angle)) * (k @ k)
    made[:3, :3] = start[:3, :3] @ part
    return made
