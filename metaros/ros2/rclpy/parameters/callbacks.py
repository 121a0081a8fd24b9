"""The three kinds of callbacks of a node's parameters: before a set, to judge it, and after it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from metaros.ros2.rclpy.parameters.value import Parameter

__all__ = ["ParameterCallbacks"]

PreSet = Callable[[Any], list[Parameter[Any]]]
OnSet = Callable[[Any], Any]
PostSet = Callable[[Any], object]


class ParameterCallbacks:
    """Those added last are called first. They run on the thread that sets: for a remote set, the executor's."""

    def _init_callbacks(self) -> None:
        self._pre_set_parameters_callbacks: list[PreSet] = []
        self._on_set_parameters_callbacks: list[OnSet] = []
        self._post_set_parameters_callbacks: list[PostSet] = []

    @property
    def _parameters_callbacks(self) -> list[OnSet]:
        """What releases before Iron call the list."""
        return self._on_set_parameters_callbacks

    def add_pre_set_parameters_callback(self, callback: PreSet) -> None:
        """Before each set, but not before a declaration, `callback(parameters)` returns what is to be set instead.

        With several callbacks each gets what was asked for, and what they return is set together. Nothing at all is
        refused.
        """
        self._pre_set_parameters_callbacks.insert(0, callback)

    def add_on_set_parameters_callback(self, callback: OnSet) -> None:
        """`callback(parameters)` returns a SetParametersResult: one that is not successful refuses all of them.

        It is called for declarations, too. It should let pass what it does not know.
        """
        self._on_set_parameters_callbacks.insert(0, callback)

    def add_post_set_parameters_callback(self, callback: PostSet) -> None:
        """`callback(parameters)` is called after what was set or declared."""
        self._post_set_parameters_callbacks.insert(0, callback)

    def remove_pre_set_parameters_callback(self, callback: PreSet) -> None:
        """Call it no more; ValueError where it was not added."""
        self._pre_set_parameters_callbacks.remove(callback)

    def remove_on_set_parameters_callback(self, callback: OnSet) -> None:
        """Call it no more; ValueError where it was not added."""
        self._on_set_parameters_callbacks.remove(callback)

    def remove_post_set_parameters_callback(self, callback: PostSet) -> None:
        """Call it no more; ValueError where it was not added."""
        self._post_set_parameters_callbacks.remove(callback)

    def _call_pre_set_callbacks(self, parameters: Sequence[Parameter[Any]]) -> list[Parameter[Any]] | None:
        """What is to be set instead; None where nobody has a say."""
        callbacks = list(self._pre_set_parameters_callbacks)
        if not callbacks:
            return None
        return [parameter for callback in callbacks for parameter in callback(parameters)]

    def _call_on_set_callbacks(self, parameters: Sequence[Parameter[Any]]) -> Any:
        """The first result that refuses them; None where nobody does."""
        for callback in list(self._on_set_parameters_callbacks):
            result = callback(parameters)
            if not result.successful:
                return result
        return None

    def _call_post_set_callbacks(self, parameters: Sequence[Parameter[Any]]) -> None:
        for callback in list(self._post_set_parameters_callbacks):
            callback(parameters)
