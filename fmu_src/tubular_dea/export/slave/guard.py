"""Refusals, and what keeps pythonfmu alive after them."""

from __future__ import annotations

import ctypes
import functools
import logging
import weakref
from collections.abc import Callable
from typing import Any

from pythonfmu import Fmi2Slave

from .stand_in import NAME


class Refused(ValueError):
    """A call that was refused; nothing has changed."""

    def __repr__(self) -> str:
        return str(self)  # pythonfmu's library logs the repr


instances_alive: weakref.WeakSet[Fmi2Slave] = weakref.WeakSet()


def _survive(*instances: Fmi2Slave) -> None:
    """Keep the instances usable after an exception that goes out to pythonfmu's library.

    That library (0.7) answers every exception with fmi2Fatal and gives up its references to the instance, its
    class and its messages, yet goes on using them: without one more reference to each, the second refusal
    would bring down the host's process. Static methods do not know their instance, so they save all of them.
    """
    for instance in instances:
        for kept in (type(instance), instance, instance.log_queue):
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(kept))


def tell_python(who: str, error: BaseException) -> None:
    """To Python's log as well: pythonfmu's library passes on messages only if the host asked for logging."""
    logging.getLogger(NAME).error("%s: %s", who, error, exc_info=not isinstance(error, Refused))


def entry(method: Callable[..., Any]) -> Callable[..., Any]:
    """A method that pythonfmu's library calls."""

    @functools.wraps(method)
    def guarded(*arguments: Any) -> Any:
        try:
            return method(*arguments)
        except BaseException as error:
            known = isinstance(arguments[0], Fmi2Slave)
            tell_python(arguments[0].instance_name if known else NAME, error)
            _survive(*([arguments[0]] if known else instances_alive))
            raise

    return guarded
