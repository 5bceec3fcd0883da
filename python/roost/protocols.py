"""Values that a document may have beside those of JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, TypeAlias, runtime_checkable


@runtime_checkable
class HasDocument(Protocol):
    """An object that is a document, such as `roost.Scenario` or `roost.Untyped`."""

    def to_dict(self) -> Mapping[str, Any]:
        """The document."""
        ...


class Array(Protocol):
    """An array, such as one of numpy, which becomes a list."""

    def tolist(self) -> Any:
        """The values as a list."""
        ...


Response: TypeAlias = "float | int | bool | str | None"
"""A response: a number, an indicator of 0 or 1, a truth value, or a word; None where the run has not reached it."""
