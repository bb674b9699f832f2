"""The check of an error message, for tests of invalid arguments."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import armlet as al


def refused(call: Callable[[], Any], *words: str) -> None:
    """Assert that `call` raises an InputError. Its message must contain `words` and the word "expected"."""
    with pytest.raises(al.InputError) as caught:
        call()
    assert isinstance(caught.value, ValueError) and isinstance(caught.value, al.ArmletError)
    message = str(caught.value)
    for word in ("expected", *words):
        assert word in message, (word, message)
