"""What the suite shares, it shares: pytest and pytest-xdist as they are installed keep a group in one worker."""

from __future__ import annotations

import pytest

GROUP = "of one"


@pytest.mark.xdist_group(GROUP)
def test_xdist_heeds_groups(request: pytest.FixtureRequest) -> None:
    """With pytest 9.2 and pytest-xdist 3.8 it did not, silently: each worker started what one should have shared."""
    if getattr(request.config.option, "loadgroup", False):  # `--dist loadgroup`, as the Makefile says
        assert request.node.nodeid.endswith(f"@{GROUP}")
