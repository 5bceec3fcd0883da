"""Types of the documents that calls take: a typed dictionary, an object with a document, or the path of a JSON file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias, Union

from .fields import ScenarioDocument
from .models import JobEnvelope, StudySpec, SweepSpec
from .protocols import HasDocument

Stored: TypeAlias = Union[HasDocument, str, "os.PathLike[str]"]
"""An object with a document, such as a `Scenario`, or the path of a JSON file. Type checkers do not know its fields."""

ScenarioInput: TypeAlias = Union[ScenarioDocument, Stored]
"""A scenario."""

JobInput: TypeAlias = Union[JobEnvelope, ScenarioDocument, Stored]
"""A job, or the scenario of one."""

SweepInput: TypeAlias = Union[SweepSpec, Stored]
"""A sweep."""

StudyInput: TypeAlias = Union[StudySpec, Stored]
"""A study."""

Document: TypeAlias = Union[ScenarioDocument, JobEnvelope, SweepSpec, StudySpec, Stored]
"""A document of any kind."""


@dataclass(frozen=True)
class Untyped:
    """A dictionary whose fields type checkers do not know, as a document.

    Calls take it in the place of a typed dictionary: `roost.Scenario(roost.Untyped(fields))`. Solver and server check its fields
    all the same. JSON files need none: their paths are documents.
    """

    fields: Mapping[str, Any]
    """The document."""

    def to_dict(self) -> Mapping[str, Any]:
        """The document."""
        return self.fields
