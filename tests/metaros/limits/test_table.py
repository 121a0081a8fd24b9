"""The table of limits is a frozen dataclass to everybody who asks, and quickly made."""

from __future__ import annotations

import dataclasses

import pytest

from metaros.limits import LIMITS, Limits
from metaros.limits.functions import FunctionLimits


def test_a_table_is_a_frozen_dataclass() -> None:
    assert LIMITS.rule_targets == FunctionLimits().rule_targets == 16  # a row of its base
    other = dataclasses.replace(LIMITS, rule_targets=3, node_bundles=1)
    assert (other.rule_targets, other.node_bundles, other.sample_bytes) == (3, 1, LIMITS.sample_bytes)
    assert LIMITS.rule_targets == 16
    fields = dataclasses.fields(Limits)
    assert {field.name: field.default for field in fields} == {
        field.name: getattr(LIMITS, field.name) for field in fields
    }
    assert {"sample_bytes", "rule_targets"} <= {field.name for field in fields}
    with pytest.raises(dataclasses.FrozenInstanceError, match=r"Limits\.rules"):
        setattr(LIMITS, "rules", 1)  # noqa: B010
    with pytest.raises(dataclasses.FrozenInstanceError, match=r"Limits\.rules"):
        delattr(LIMITS, "rules")
    with pytest.raises(TypeError, match="Limits has no rulez"):
        Limits(rulez=1)  # type: ignore[call-arg]
    assert not hasattr(LIMITS, "__dict__")
