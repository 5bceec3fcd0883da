"""Server-sent events: the parser of a stream's lines."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Event:
    """An event of a job or a sweep."""

    kind: str
    """`job` or `sweep` (the view), `change` (a job's state), `progress` (the view), `samples`, `extended`, `deleted`,
    or `resumed` after an interruption of the connection."""
    data: dict[str, Any]
    """Its content, as api.md describes it."""
    id: str | None
    """Its id, behind which a stream can continue."""


def parse(lines: Iterable[str]) -> Iterator[Event]:
    """The events of the lines of a stream. An event ends with an empty line; comments and unfinished events are left out."""
    kind, id_ = "message", None
    data: list[str] = []
    for line in lines:
        if not line:
            if data:
                yield Event(kind, json.loads("\n".join(data)), id_)
            kind, data, id_ = "message", [], None
            continue
        field, _, value = line.partition(":")
        value = value.removeprefix(" ")
        if field == "event":
            kind = value
        elif field == "data":
            data.append(value)
        elif field == "id":
            id_ = value
