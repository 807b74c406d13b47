"""Libraries of the optional extras, imported when they are needed."""

from __future__ import annotations

import importlib
from typing import Any

from .errors import UserError


class MissingExtraError(UserError, ImportError):
    """A library of an extra is not installed."""


def load(module: str, purpose: str, extra: str, otherwise: str = "") -> Any:
    """The module of an `extra` of this package, or one line that says how to install it, or what to do `otherwise`."""
    try:
        return importlib.import_module(module)
    except ImportError as problem:
        raise MissingExtraError(
            f"{purpose} needs {module.partition('.')[0]}, which is not installed ({problem}); "
            f"install it with pip install '.[{extra}]' (in the folder of the repository){otherwise}"
        ) from None
