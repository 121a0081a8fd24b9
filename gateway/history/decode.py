"""Stored messages as JSON-able values: the decoder that live ones have too."""

from __future__ import annotations

from gateway.decoder import Decoder

__all__ = ["Decoder"]
