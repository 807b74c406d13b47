"""The libraries of the optional extra `sweep`, imported when they are needed."""

from __future__ import annotations

import importlib
from typing import Any

from ..errors import UserError


class MissingExtraError(UserError, ImportError):
    """A library of the extra is not installed."""


def load(module: str, purpose: str) -> Any:
    """The module, or one line that says how to install it."""
    try:
        return importlib.import_module(module)
    except ImportError as problem:
        raise MissingExtraError(
            f"{purpose} needs {module.partition('.')[0]}, which is not installed ({problem}); "
            "install it with: pip install 'tubular-dea[sweep]'"
        ) from None
