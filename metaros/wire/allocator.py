"""Keep the memory of large messages instead of giving it back to the system after each one.

glibc returns the end of its heap to the system as soon as a large block there is free, and asks for it again, page by
page, with the next message: a publisher of images of 1 MiB spent most of its time so. Up to `_KEPT_BYTES` are kept.
A process whose environment tunes glibc's allocator itself, or has `METAROS_ALLOCATOR=off`, is left alone.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Mapping
from typing import Final

from metaros.limits import LIMITS

__all__ = ["keep_large_blocks"]

_KEPT_BYTES: Final = 4 * LIMITS.sample_bytes
_ON_THE_HEAP_BYTES: Final = 2 * LIMITS.sample_bytes  # the most that glibc takes for this setting
_M_TRIM_THRESHOLD: Final = -1
_M_MMAP_THRESHOLD: Final = -3
_USERS_OWN: Final = ("MALLOC_TRIM_THRESHOLD_", "MALLOC_MMAP_THRESHOLD_", "MALLOC_TOP_PAD_", "GLIBC_TUNABLES")


def keep_large_blocks(environ: Mapping[str, str] = os.environ) -> bool:
    """Tell the allocator, for the whole process; False where it is another one, or the user's own choice."""
    own = environ.get("METAROS_ALLOCATOR") == "off" or any(name in environ for name in _USERS_OWN)
    if sys.platform == "linux" and not own:
        return _report_glibc()
    return False


def _report_glibc() -> bool:
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError):  # musl has none
        return False
    return bool(mallopt(_M_MMAP_THRESHOLD, _ON_THE_HEAP_BYTES) and mallopt(_M_TRIM_THRESHOLD, _KEPT_BYTES))
