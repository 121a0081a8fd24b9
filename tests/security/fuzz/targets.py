"""Every decoder of foreign bytes in one table: what it may raise, and how much memory it may take.

`test_fuzz_decoders.py` drives all of them; `make campaign ARGS=fuzz` does so for as long as one likes, guided by
coverage where atheris is installed.
"""

from __future__ import annotations

from tests.security.fuzz import drivers, files, link, requests, texts, wire
from tests.security.fuzz.target import Target

__all__ = ["TARGETS"]

TARGETS: dict[str, Target] = {
    target.name: target for part in (wire, link, files, requests, texts, drivers) for target in part.TARGETS
}
