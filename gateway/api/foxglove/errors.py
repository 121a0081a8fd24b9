"""What a Foxglove client cannot be given.

MetarosError
└── AssetError       asset_unavailable   the file may not be fetched, or is not there
"""

from __future__ import annotations

from metaros.errors import MetarosError

__all__ = ["AssetError"]


class AssetError(MetarosError):
    """A file that may not be fetched, or is not there: which of the two is not told where it would tell something."""

    code = "asset_unavailable"
