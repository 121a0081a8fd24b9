"""Fewer points that draw the same line: largest-triangle-three-buckets (LTTB).

Sveinn Steinarsson, "Downsampling Time Series for Visual Representation", MSc thesis, University of Iceland, 2013. Of
each bucket that point is kept that makes the largest triangle with the one kept before and the mean of the next bucket.
For more rows than a query may hold, candidates are chosen first, the smallest and the largest of short spans, as in
Van Der Donckt et al., "MinMaxLTTB: Leveraging MinMax-Preselection to Scale LTTB", IEEE VIS 2023.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["extremes", "lttb"]

Indexes = npt.NDArray[np.int64]


def lttb(x: npt.NDArray[np.float64], y: npt.NDArray[np.float64], points: int) -> Indexes:
    """Which points to keep, in order: all when there are no more than `points`, else `points` with the first and last.

    `x` does not fall; infinite values of `y` count as a very large number.
    """
    count = len(x)
    if count <= points:
        return np.arange(count)
    if points < 3:
        return np.array([0, count - 1][:points], np.int64)
    y = np.clip(y, -1e150, 1e150)  # so that no triangle is infinite
    cuts = np.linspace(1, count - 1, points - 1).astype(np.int64)
    starts, ends = cuts[:-1], cuts[1:]
    sizes = ends - starts
    next_x = np.append((np.add.reduceat(x[: count - 1], starts) / sizes)[1:], x[-1])
    next_y = np.append((np.add.reduceat(y[: count - 1], starts) / sizes)[1:], y[-1])
    kept = np.zeros(points, np.int64)
    at = 0
    for bucket, (start, end) in enumerate(zip(starts.tolist(), ends.tolist(), strict=True)):
        area = np.abs(
            (x[at] - next_x[bucket]) * (y[start:end] - y[at]) - (x[at] - x[start:end]) * (next_y[bucket] - y[at])
        )
        at = start + int(np.argmax(area))
        kept[bucket + 1] = at
    kept[-1] = count - 1
    return kept


def extremes(values: npt.NDArray[np.float64], starts: Indexes) -> Indexes:
    """Where the smallest and the largest of each span first are, and the first and last row, in order.

    A span begins at each of `starts`, the first of which is 0.
    """
    owner = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(values)))
    found = [np.array([0, len(values) - 1])]
    for least in (np.minimum, np.maximum):
        hits = np.flatnonzero(values == least.reduceat(values, starts)[owner])
        found.append(hits[np.unique(owner[hits], return_index=True)[1]])
    return np.unique(np.concatenate(found))
