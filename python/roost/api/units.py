"""Units of fields and results, as the server knows them. They are read once per client."""

from __future__ import annotations

from functools import cached_property
from typing import Any

from roost.api.transport import Transport
from roost.models import OutputTable


class Units:
    """Units of the fields of scenarios, and of responses and series. A quantity without a unit has the unit `""`."""

    def __init__(self, transport: Transport) -> None:
        self._transport = transport

    @cached_property
    def outputs(self) -> OutputTable:
        """The table of results: responses, series and curves with unit and meaning."""
        table: OutputTable = self._transport.get("/v1/responses")
        return table

    @cached_property
    def _schema(self) -> dict[str, Any]:
        schema: dict[str, Any] = self._transport.get("/v1/schema/scenario")
        return schema

    def of_field(self, pointer: str) -> str:
        """The unit of a field of a scenario."""
        schema: Any = self._schema
        unit = ""
        for part in pointer.split("/")[1:]:
            schema = schema.get("properties", {}).get(part) or schema.get("items") or {}
            unit = str(schema.get("x-unit", unit))
        return unit

    def of_response(self, name: str) -> str:
        """The unit of a response."""
        return next((row["unit"] for row in self.outputs["responses"] if row["name"] == name), "")
