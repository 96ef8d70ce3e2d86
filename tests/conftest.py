"""Shared by all tests: nothing kept in the user's folders, 64-bit arithmetic where it is asked."""

from __future__ import annotations

import os
from collections.abc import Iterator

import jax
import pytest

os.environ["PCJAX_CACHE"] = "off"


@pytest.fixture
def x64() -> Iterator[None]:
    """64-bit numbers for the duration of a test."""
    with jax.enable_x64(True):
        yield
