"""A camera's calibration: ROS's camera_calibration file as CameraInfo, and pictures straightened by it.

The file and the model: REP 104 and ROS's camera_calibration_parsers; distortion as OpenCV's calib3d documents it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from metaros.drivers.camera.source import Image
from metaros.errors import ConfigError
from metaros.interfaces.sensor_msgs.msg import CameraInfo
from metaros.interfaces.std_msgs.msg import Header

__all__ = ["Calibration", "Rectifier", "read_calibration"]

MAX_BYTES: Final = 256 * 1024
MODELS: Final = {"plumb_bob": (4, 5), "rational_polynomial": (8,), "equidistant": (4,)}
Matrix = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """A calibration for pictures of `width` x `height`."""

    width: int
    height: int
    model: str
    k: Matrix  # 3 x 3
    d: Matrix
    r: Matrix  # 3 x 3
    p: Matrix  # 3 x 4

    def scaled(self, width: int, height: int) -> Calibration:
        """The same camera with pictures of another size."""
        scale = np.diag([width / self.width, height / self.height, 1.0])
        return Calibration(
            width=width, height=height, model=self.model, k=scale @ self.k, d=self.d, r=self.r, p=scale @ self.p
        )

    def info(self, header: Header, *, rectified: bool) -> CameraInfo:
        """The CameraInfo of a picture; of a straightened one it has no distortion any more."""
        k, d, r = (self.p[:, :3], np.zeros(5), np.eye(3)) if rectified else (self.k, self.d, self.r)
        return CameraInfo(
            header=header,
            height=self.height,
            width=self.width,
            distortion_model="plumb_bob" if rectified else self.model,
            d=d,
            k=k.ravel(),
            r=r.ravel(),
            p=self.p.ravel(),
        )


class Rectifier:
    """Straightens pictures of the calibration's size."""

    def __init__(self, calibration: Calibration) -> None:
        import cv2

        size = (calibration.width, calibration.height)
        make: Any = cv2.fisheye if calibration.model == "equidistant" else cv2
        self._maps = make.initUndistortRectifyMap(
            calibration.k, calibration.d, calibration.r, calibration.p[:, :3], size, cv2.CV_16SC2
        )

    def __call__(self, image: Image) -> Image:
        """The straightened picture."""
        import cv2

        first, second = self._maps
        return np.asarray(cv2.remap(image, first, second, cv2.INTER_LINEAR), np.uint8)


def read_calibration(path: str) -> Calibration:
    """Read a calibration file. Raises ConfigError that names what is wrong with it."""
    import yaml

    try:
        with Path(path).open("rb") as file:
            data = file.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise ConfigError(f"{path}: a calibration has at most {MAX_BYTES} bytes")
        tree = yaml.safe_load(data)
    except (OSError, yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: {error}") from None
    if not isinstance(tree, dict):
        raise ConfigError(f"{path}: expected a table of image_width, camera_matrix, …")
    model = tree.get("distortion_model", "plumb_bob")
    if model not in MODELS:
        raise ConfigError(f"{path}: distortion_model {model!r} is none of {', '.join(MODELS)}")
    d = _numbers(path, tree, "distortion_coefficients", MODELS[model])
    return Calibration(
        width=_size(path, tree, "image_width"),
        height=_size(path, tree, "image_height"),
        model=model,
        k=_numbers(path, tree, "camera_matrix", (9,)).reshape(3, 3),
        d=d,
        r=_numbers(path, tree, "rectification_matrix", (9,), default=np.eye(3).ravel()).reshape(3, 3),
        p=_numbers(path, tree, "projection_matrix", (12,)).reshape(3, 4),
    )


def _size(path: str, tree: dict[str, Any], key: str) -> int:
    value = tree.get(key)
    if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= 65536:
        raise ConfigError(f"{path}: {key} must be a whole number, not {value!r}")
    return value


def _numbers(
    path: str, tree: dict[str, Any], key: str, counts: tuple[int, ...], *, default: Matrix | None = None
) -> Matrix:
    if key not in tree and default is not None:
        return default
    table = tree.get(key)
    data = table.get("data") if isinstance(table, dict) else None
    try:
        values = np.array(data, np.float64).ravel()
    except (TypeError, ValueError):
        values = np.empty(0)
    if values.size not in counts or not np.isfinite(values).all():
        raise ConfigError(f"{path}: {key}: data must be {' or '.join(map(str, counts))} finite numbers")
    return values
