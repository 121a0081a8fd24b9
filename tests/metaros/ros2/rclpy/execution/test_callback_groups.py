"""Groups by themselves, and what they let run."""

from __future__ import annotations

import gc

import pytest

from metaros.executor.groups import CallbackGroup as NativeGroup
from metaros.ros2.rclpy.execution.callback_groups import (
    CallbackGroup,
    MutuallyExclusiveCallbackGroup,
    ReentrantCallbackGroup,
)


class Entity:
    """Something with callbacks."""


def test_a_reentrant_group_lets_everything_run() -> None:
    group, one, two = ReentrantCallbackGroup(), Entity(), Entity()
    for entity in (one, two, one):
        assert group.can_execute(entity)
        assert group.beginning_execution(entity)
    group.ending_execution(one)


def test_a_mutually_exclusive_group_lets_one_run() -> None:
    group, one, two = MutuallyExclusiveCallbackGroup(), Entity(), Entity()
    group.add_entity(one)
    assert group.can_execute(one)
    assert group.beginning_execution(one)
    for entity in (one, two):
        assert not group.can_execute(entity)
        assert not group.beginning_execution(entity)
    group.ending_execution(one)
    assert group.beginning_execution(two)


def test_entities_are_known_and_not_kept() -> None:
    for group in (ReentrantCallbackGroup(), MutuallyExclusiveCallbackGroup()):
        assert isinstance(group, NativeGroup)
        one, two = Entity(), Entity()
        group.add_entity(one)
        assert group.has_entity(one)
        assert not group.has_entity(two)
        del one
        gc.collect()
        assert group.entities == set()


def test_a_group_of_ones_own_has_to_say_something() -> None:
    group = CallbackGroup()
    for ask in (group.can_execute, group.beginning_execution, group.ending_execution):
        with pytest.raises(NotImplementedError):
            ask(None)
