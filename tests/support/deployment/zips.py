"""Members of zip files that are the same bytes whenever they are made: by a name, `writestr` takes the time, too."""

from __future__ import annotations

import zipfile

__all__ = ["member"]


def member(name: str) -> zipfile.ZipInfo:
    """For `writestr`: of 1980, deflated, its owner's to read and write."""
    info = zipfile.ZipInfo(name)
    info.compress_type = zipfile.ZIP_DEFLATED
    info.external_attr = 0o600 << 16
    return info
