"""The tree of frames over time: what tf2's C++ class of this name gives to Python, in Python."""

from __future__ import annotations

import logging
import math
import threading
from collections import Counter
from typing import Any

from metaros.limits import LIMITS
from metaros.ros2.tf2_py import report, walk
from metaros.ros2.tf2_py.caches import Cache, Sample, StaticCache, TimeCache, seconds
from metaros.ros2.tf2_py.conversions import duration_ns, pose_of, time_ns, transform_stamped
from metaros.ros2.tf2_py.exceptions import InvalidArgumentException, LookupException, TransformException
from metaros.ros2.tf2_py.rotations import IDENTITY, ORIGIN, Vector, canonical, multiply, rotate
from metaros.ros2.tf2_py.velocity import Twist, twist
from metaros.ros2.tf2_py.walk import Pose

__all__ = ["BufferCore"]

_log = logging.getLogger("metaros.ros2.tf2")

_CACHE_NS = 10_000_000_000
_NORM_TOLERANCE = 0.01  # of a quaternion's squared length


class BufferCore:
    """Transforms between frames, of the last `cache_time` (10 s), and those that hold for good.

    Times are `rclpy.time.Time` or `builtin_interfaces.msg.Time`; a time of 0 asks for the newest that all frames
    between have in common. Threads may share it.
    """

    def __init__(self, cache_time: Any = None) -> None:
        self.__keep_ns = _CACHE_NS if cache_time is None else duration_ns(cache_time)
        self.__frames: dict[str, Cache | None] = {}
        self.__authorities: dict[str, str] = {}
        self.__refused: Counter[tuple[str, str]] = Counter()
        self.__lock = threading.RLock()

    # ── what is told

    def set_transform(self, transform: Any, authority: str) -> None:
        """Keep a `TransformStamped`. One that makes no sense, or is too old, is refused with a word in the log."""
        self.__set(transform, authority, static=False)

    def set_transform_static(self, transform: Any, authority: str) -> None:
        """Keep a `TransformStamped` for good, whatever its time."""
        self.__set(transform, authority, static=True)

    def clear(self) -> None:
        """Forget all transforms that have a time. Frames stay known, and so does what is static."""
        with self.__lock:
            for cache in self.__frames.values():
                if cache is not None:
                    cache.clear()

    # ── what is asked

    def lookup_transform_core(self, target_frame: str, source_frame: str, time: Any) -> Any:
        """The `TransformStamped` that takes data in `source_frame` to `target_frame`.

        Raises:
            LookupException: a frame is unknown.
            ConnectivityException: nothing joins the frames.
            ExtrapolationException: that time is not stored.
            InvalidArgumentException: a name is empty, or begins with a slash.
        """
        with self.__lock:
            stamp_ns, pose = self.__lookup(target_frame, source_frame, time_ns(time))
        return transform_stamped(target_frame, source_frame, stamp_ns, pose)

    def lookup_transform_full_core(
        self, target_frame: str, target_time: Any, source_frame: str, source_time: Any, fixed_frame: str
    ) -> Any:
        """The same from a frame at one time to a frame at another, by way of one that does not move in between."""
        with self.__lock:
            for what, frame in (("target", target_frame), ("source", source_frame), ("fixed", fixed_frame)):
                self.__known(f"lookup_transform argument {what}_frame", frame)
            _, (first_at, first_turned) = self.__lookup(fixed_frame, source_frame, time_ns(source_time))
            stamp_ns, (then_at, then_turned) = self.__lookup(target_frame, fixed_frame, time_ns(target_time))
        x, y, z = rotate(then_turned, first_at)
        pose = (x + then_at[0], y + then_at[1], z + then_at[2]), canonical(multiply(then_turned, first_turned))
        return transform_stamped(target_frame, source_frame, stamp_ns, pose)

    def can_transform_core(self, target_frame: str, source_frame: str, time: Any) -> tuple[bool, str]:
        """Whether `lookup_transform_core` would answer, and if not why."""
        if target_frame == source_frame:
            return True, ""
        try:
            with self.__lock:
                self.__check(target_frame, source_frame, time_ns(time))
        except TransformException as error:
            return False, str(error)
        return True, ""

    def can_transform_full_core(
        self, target_frame: str, target_time: Any, source_frame: str, source_time: Any, fixed_frame: str
    ) -> tuple[bool, str]:
        """Whether `lookup_transform_full_core` would answer, and if not why."""
        try:
            with self.__lock:
                for what, frame in (("target", target_frame), ("source", source_frame), ("fixed", fixed_frame)):
                    self.__known(f"can_transform argument {what}_frame", frame)
                self.__check(target_frame, fixed_frame, time_ns(target_time))
                self.__check(fixed_frame, source_frame, time_ns(source_time))
        except TransformException as error:
            return False, str(error)
        return True, ""

    def get_latest_common_time(self, target_frame: str, source_frame: str) -> Any:
        """The newest `rclpy.time.Time` of which all between the frames is known; 0 if all of it is static.

        Raises:
            TransformException: nothing joins them.
        """
        from metaros.ros2.rclpy.time.time import Time  # here, as the tree itself needs nothing of a node

        with self.__lock:
            for frame in (target_frame, source_frame):
                self.__known("get_latest_common_time", frame)
            return Time(nanoseconds=walk.latest_common_ns(self.__frames, target_frame, source_frame))

    def lookupVelocityCore(
        self, tracking_frame: str, observation_frame: str, time: Any, averaging_interval: Any
    ) -> Twist:
        """How one frame moves in another: ((vx, vy, vz), (wx, wy, wz)), in m/s and rad/s."""
        return self.lookupVelocityFullCore(
            tracking_frame, observation_frame, observation_frame, ORIGIN, tracking_frame, time, averaging_interval
        )

    def lookupVelocityFullCore(
        self,
        tracking_frame: str,
        observation_frame: str,
        reference_frame: str,
        reference_point: Vector,
        reference_point_frame: str,
        time: Any,
        averaging_interval: Any,
    ) -> Twist:
        """The same, told in a third frame and for a point of a fourth."""
        with self.__lock:
            try:
                latest_ns = walk.latest_common_ns(self.__frames, observation_frame, tracking_frame)
            except TransformException:
                latest_ns = 0
            return twist(
                lambda target, source, at_ns: self.__lookup(target, source, at_ns)[1],
                tracking_frame,
                observation_frame,
                reference_frame,
                reference_point,
                reference_point_frame,
                time_ns(time),
                duration_ns(averaging_interval),
                latest_ns,
            )

    # ── what is known

    def all_frames_as_string(self) -> str:
        """One line a frame: its name and its parent's."""
        with self.__lock:
            return report.as_string(self.__frames)

    def all_frames_as_yaml(self) -> str:
        """Each frame's parent, who told it, how often, and of which times."""
        with self.__lock:
            return report.as_yaml(self.__frames, self.__authorities)

    def _allFramesAsDot(self, time: Any = None) -> str:
        with self.__lock:
            return report.as_dot(self.__frames, self.__authorities, 0 if time is None else time_ns(time))

    def _frameExists(self, frame_id: str) -> bool:
        return frame_id in self.__frames

    def _getFrameStrings(self) -> list[str]:
        with self.__lock:
            return list(self.__frames)

    def _chain(
        self, target_frame: str, target_time: Any, source_frame: str, source_time: Any, fixed_frame: str
    ) -> list[str]:
        """The frames on the way from `source_frame` to `target_frame`."""
        with self.__lock:
            up = self.__way(fixed_frame, source_frame, time_ns(source_time))
            down = self.__way(fixed_frame, target_frame, time_ns(target_time))
        while len(up) > 1 and len(down) > 1 and up[-2:] == down[-2:]:
            up.pop()
            down.pop()
        return up + down[-2::-1]

    # ── inside

    def __set(self, transform: Any, authority: str, *, static: bool) -> None:
        header = transform.header
        child, parent = transform.child_frame_id.removeprefix("/"), header.frame_id.removeprefix("/")
        stamp_ns = time_ns(header.stamp)
        at, turned = pose_of(transform.transform)
        why = _nonsense(child, parent, at, turned)
        if why:
            self.__refuse(why[0], child, authority, why[1])
            return
        with self.__lock:
            frames = self.__frames
            new = (child not in frames) + (parent not in frames)
            if new and len(frames) + new > LIMITS.tf_frames:
                self.__refuse("TF_TOO_MANY_FRAMES", child, authority, f"{LIMITS.tf_frames} frames are the limit")
                return
            cache = frames.get(child)
            if cache is None or isinstance(cache, StaticCache) != static:
                cache = StaticCache() if static else TimeCache(self.__keep_ns, LIMITS.tf_samples)
                frames[child] = cache
            frames.setdefault(parent, None)
            if cache.insert(Sample(stamp_ns, parent, at, turned)):
                self.__authorities[child] = authority
                return
        self.__refuse("TF_OLD_DATA", child, authority, f"its time {seconds(stamp_ns)} is before all that is kept")

    def __refuse(self, code: str, child: str, authority: str, why: str) -> None:
        """Say so the first time, the second, the fourth …: a broadcaster that is wrong is wrong often."""
        if len(self.__refused) > 1000:
            self.__refused.clear()
        about = code, child[: LIMITS.key_chars]
        self.__refused[about] += 1
        count = self.__refused[about]
        if count & (count - 1) == 0:
            often = "" if count == 1 else f" ({count} times by now)"
            _log.warning("%s: a transform of %.512r from %r is ignored: %s%s", code, child, authority, why, often)

    def __known(self, where: str, frame: str) -> None:
        if not frame:
            raise InvalidArgumentException(f'Invalid argument "{frame}" of {where}: a frame has a name')
        if frame.startswith("/"):
            raise InvalidArgumentException(f'Invalid argument "{frame}" of {where}: no frame begins with a slash')
        if frame not in self.__frames:
            raise LookupException(f'"{frame}" of {where} does not exist: nobody has told of this frame yet')

    def __at(self, target: str, source: str, at_ns: int) -> int:
        return at_ns or walk.latest_common_ns(self.__frames, target, source)

    def __lookup(self, target: str, source: str, at_ns: int) -> tuple[int, Pose]:
        if target == source:
            cache = self.__frames.get(target)
            newest_ns = 0 if cache is None else cache.span_ns()[1]
            return at_ns or newest_ns, (ORIGIN, IDENTITY)
        self.__known("lookup_transform argument target_frame", target)
        self.__known("lookup_transform argument source_frame", source)
        at_ns = self.__at(target, source, at_ns)
        return at_ns, walk.pose_between(self.__frames, target, source, at_ns)

    def __check(self, target: str, source: str, at_ns: int) -> None:
        if target != source:
            self.__known("can_transform argument target_frame", target)
            self.__known("can_transform argument source_frame", source)
            walk.joined(self.__frames, target, source, self.__at(target, source, at_ns))

    def __way(self, target: str, source: str, at_ns: int) -> list[str]:
        if target == source:
            return [source]
        return walk.chain(self.__frames, target, source, self.__at(target, source, at_ns))


def _nonsense(child: str, parent: str, at: Vector, turned: tuple[float, ...]) -> tuple[str, str] | None:
    """Why a transform is none, or None."""
    if child == parent:
        return "TF_SELF_TRANSFORM", "frame_id and child_frame_id are the same"
    if not child:
        return "TF_NO_CHILD_FRAME_ID", "child_frame_id is empty"
    if not parent:
        return "TF_NO_FRAME_ID", "frame_id is empty"
    longest = max(len(child), len(parent))
    if longest > LIMITS.key_chars:
        return "TF_LONG_FRAME_ID", f"a frame's name has at most {LIMITS.key_chars} characters, not {longest}"
    if any(map(math.isnan, (*at, *turned))):
        return "TF_NAN_INPUT", f"a number in {at} {turned} is none"
    if not abs(sum(part * part for part in turned) - 1.0) < _NORM_TOLERANCE:
        return "TF_DENORMALIZED_QUATERNION", f"the quaternion {turned} is not of unit length"
    return None
