"""Shared by all tests: 64-bit arithmetic where a test asks for it."""

from __future__ import annotations

from collections.abc import Iterator

import jax
import pytest


@pytest.fixture
def x64() -> Iterator[None]:
    """64-bit numbers for the duration of a test."""
    with jax.enable_x64(True):
        yield
