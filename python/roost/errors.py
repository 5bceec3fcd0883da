"""Errors of the package. All but `Interrupted` are a `RoostError`, so that one clause catches whatever Roost refuses."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .result import Result


@dataclass(frozen=True)
class Fault:
    """A fault of a document: its place, and what is allowed there."""

    pointer: str
    """JSON pointer of the field at fault, such as `/equipment/gate_opening_m`."""
    value: object
    """The value found there; None where it is missing."""
    detail: str
    """The fault, in words."""
    allowed: str | None = None
    """The allowed values: a range with its unit, or the choices."""

    def __str__(self) -> str:
        found = "" if self.value is None else f" (found {json.dumps(self.value, ensure_ascii=False)})"
        allowed = "" if self.allowed is None else f"; allowed: {self.allowed}"
        return f"{self.pointer}: {self.detail}{found}{allowed}"


class RoostError(Exception):
    """An error of Roost."""


class ScenarioError(RoostError):
    """A document with faults. Its text has a line for each."""

    def __init__(self, faults: Sequence[Fault]) -> None:
        super().__init__(faults)
        self.faults: list[Fault] = list(faults)

    def __str__(self) -> str:
        noun = "fault" if len(self.faults) == 1 else "faults"
        return "\n  ".join([f"{len(self.faults)} {noun}", *map(str, self.faults)])


class ApiError(RoostError):
    """An answer of the server that refuses a request, after RFC 9457."""

    def __init__(
        self,
        status: int,
        title: str,
        detail: str | None = None,
        faults: Sequence[Fault] = (),
        request_id: str | None = None,
    ) -> None:
        super().__init__(status, title, detail, faults, request_id)
        self.status = status
        """Status code of HTTP, such as 404."""
        self.title = title
        """Kind of the error, in words."""
        self.detail = detail
        """This error, in words."""
        self.faults: list[Fault] = list(faults)
        """Faults of the document that was sent."""
        self.request_id = request_id
        """Names the request in the log of the server."""

    def __str__(self) -> str:
        # With faults, the detail repeats the only one, or their number under the name that the API gives them.
        detail = "" if self.faults else self.detail
        text = f"{self.status} {self.title}" + (f": {detail}" if detail else "")
        request = f" (request {self.request_id})" if self.request_id else ""
        return "\n  ".join([text + request, *map(str, self.faults)])


class Interrupted(KeyboardInterrupt):
    """Ctrl-C stopped a run in good order."""

    def __init__(self, result: Result) -> None:
        super().__init__(result)
        self.result = result
        """The series until then. It has no responses."""

    def __str__(self) -> str:
        return "the run was interrupted; the series until then are in `result` of this exception"
