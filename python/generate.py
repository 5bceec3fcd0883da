"""Writes the types of the package: `roost/models.py` from the OpenAPI document, `roost/fields.py` from the field
table of scenarios.

    python3 python/generate.py --roost target/debug/roost
    python3 python/generate.py --roost target/debug/roost --check

Both are in version control, so that editors and type checkers need no build. `--check` writes nothing, and fails if
they are stale. It needs the standard library alone.
"""

from __future__ import annotations

import argparse
import json
import keyword
import re
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).resolve().parent / "roost"
WIDTH = 120

HEAD = '''"""{title}

Generated: write it with `python3 python/generate.py`, and change the Rust types or the field table instead.
"""

from __future__ import annotations

import sys
from collections.abc import {abcs}
from typing import {names}

{imports}

if sys.version_info >= (3, 11):
    from typing import {required}
else:
    from typing_extensions import {required}
'''

# Members that the OpenAPI document describes as objects, and their types.
OWN_TYPES = {
    ("JobEnvelope", "scenario"): "ScenarioDocument | HasDocument",
    ("SweepSpec", "base"): "ScenarioDocument | HasDocument",
    ("StudySpec", "base"): "ScenarioDocument | HasDocument",
    ("HandedOut", "scenario"): "ScenarioDocument",
    ("JobView", "responses"): "Mapping[str, Response]",
    ("RunResult", "responses"): "Mapping[str, Response]",
    ("RunOutcome", "responses"): "Mapping[str, Response] | None",
    ("TrialRow", "responses"): "Mapping[str, Response]",
}

# Members that only the client knows: it puts the contents of the file in their place.
OF_CLIENT = {
    "Design": {"file": "`csv`: the path of a CSV file, in place of `table`."},
    "PosteriorDraws": {"file": "The path of the answer of a calibration, in place of `parameters` and `samples`."},
}


def main() -> int:
    """Writes or checks the files."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--roost", default="target/debug/roost", help="the binary whose types these are")
    parser.add_argument("--check", action="store_true", help="write nothing, and fail if a file is stale")
    arguments = parser.parse_args()
    stale: list[str] = []
    for path, text in generated(arguments.roost).items():
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            stale.append(path.name)
            if not arguments.check:
                path.write_text(text, encoding="utf-8", newline="\n")
    if arguments.check and stale:
        print(f"stale: {', '.join(stale)}; write them with `python3 python/generate.py`", file=sys.stderr)
        return 1
    return 0


def generated(roost: str) -> dict[Path, str]:
    """The text of each generated file."""

    def document(*arguments: str) -> Any:
        return json.loads(subprocess.run([roost, "openapi", *arguments], check=True, stdout=subprocess.PIPE).stdout)

    return {PACKAGE / "models.py": models(document()), PACKAGE / "fields.py": fields(document("--scenario"))}


# Types of the API


def models(openapi: dict[str, Any]) -> str:
    """The module of the API's documents."""
    head = HEAD.format(
        title="The documents of the HTTP API as types, such as `SweepSpec` of a submission and `JobView` of an answer.",
        abcs="Mapping, Sequence",
        names="Any, Literal, TypeAlias, TypedDict",
        imports="from roost.fields import ScenarioDocument\nfrom roost.protocols import Array, HasDocument, Response",
        required="NotRequired",
    )
    schemas = openapi["components"]["schemas"]
    for name, field in OWN_TYPES:
        if named_type("object", {}) not in python_type(schemas[name]["properties"][field]):
            raise SystemExit(f"{name}.{field} has a type in the OpenAPI document: remove it from OWN_TYPES")
    # Words come first, since they are values at run time; all else refers to them by name.
    words = [name for name, schema in schemas.items() if "enum" in schema]
    parts = [model(name, schemas[name]) for name in [*words, *(name for name in schemas if name not in words)]]
    return "\n\n".join([head, *parts]).replace("\n\n\n\n", "\n\n\n")


def model(name: str, schema: dict[str, Any]) -> str:
    """A schema as a class, or as another name of a type."""
    doc = schema.get("description", "")
    properties = schema.get("properties")
    if not properties:
        text = python_type(schema)
        value = text if text.startswith("Literal[") else f'"{text}"'
        return f"{name}: TypeAlias = {value}\n{docstring(doc, 0)}"
    required = schema.get("required", [])
    for field, meaning in OF_CLIENT.get(name, {}).items():
        properties = {**properties, field: {"type": "string", "description": meaning}}
    entries = [(field, of_field, field in required) for field, of_field in properties.items()]

    def typed(field: str, of_field: dict[str, Any], is_required: bool) -> str:
        return optional(OWN_TYPES.get((name, field)) or python_type(of_field), is_required)

    if any(keyword.iskeyword(field) or not field.isidentifier() for field in properties):
        # A class cannot have these names.
        lines = [f'    "{field}": "{typed(field, of, is_required)}",' for field, of, is_required in entries]
        return "\n".join(
            [f'{name} = TypedDict(\n    "{name}",\n    {{', *(f"    {line}" for line in lines), "    },\n)", docstring(doc, 0)]
        )
    lines = [f"class {name}(TypedDict):", docstring(doc or name, 4), ""]
    for field, of, is_required in entries:
        lines.append(f"    {field}: {typed(field, of, is_required)}")
        lines.extend(filter(None, [docstring(of.get("description", ""), 4)]))
    return "\n".join(lines) + "\n"


def optional(text: str, is_required: bool) -> str:
    """The type of a field that may be absent."""
    return text if is_required else f"NotRequired[{text}]"


def python_type(schema: dict[str, Any]) -> str:
    """The type of a JSON schema."""
    if "$ref" in schema:
        return str(schema["$ref"].rsplit("/", 1)[-1])
    if "enum" in schema:
        return f"Literal[{', '.join(literal(value) for value in schema['enum'])}]"
    if "const" in schema:
        return f"Literal[{literal(schema['const'])}]"
    choices = schema.get("oneOf") or schema.get("anyOf")
    if choices:
        return union([python_type(choice) for choice in choices])
    if "allOf" in schema:
        return python_type(schema["allOf"][0]) if len(schema["allOf"]) == 1 else "Mapping[str, Any]"
    return union([named_type(kind, schema) for kind in kinds_of(schema)])


def kinds_of(schema: dict[str, Any]) -> list[str]:
    """The JSON types of a schema: none, one or several."""
    kinds: Any = schema.get("type", "any")
    return [kinds] if isinstance(kinds, str) else list(kinds)


def named_type(kind: str, schema: dict[str, Any]) -> str:
    """The type of a schema whose JSON type is `kind`."""
    if kind == "array":
        items: dict[str, Any] = schema.get("items") or {}
        if schema.get("prefixItems"):
            items = {"anyOf": schema["prefixItems"]}
        item = python_type(items) if items else "Any"
        # Lists of any values, such as the levels of a factor, may be arrays.
        return f"Sequence[{item}] | Array" if item == "Any" or item.endswith(" | Array") else f"list[{item}]"
    if kind == "object":
        others: Any = schema.get("additionalProperties")
        # TypedDicts are mappings, but no dictionaries.
        return f"Mapping[str, {python_type(others) if others not in (None, True, False) else 'Any'}]"
    return {"integer": "int", "number": "float", "boolean": "bool", "string": "str", "null": "None"}.get(kind, "Any")


def union(types: list[str]) -> str:
    """Either of some types."""
    parts = list(dict.fromkeys(part for text in types for part in text.split(" | ")))
    return "Any" if "Any" in parts else " | ".join(parts)


def literal(value: Any) -> str:
    """A value as Python writes it."""
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)


# Fields of scenarios

MESHES = '''class MeshFile(TypedDict):
    """An STL file that goes with a submission."""

    file: str
    """Its path, relative to the folder of the document."""
    units: Literal["mm", "m"]
    """The unit of its coordinates, which STL does not state."""


class MeshDigest(TypedDict):
    """An STL file that the server has."""

    digest: str
    """BLAKE3 hash of the file, in hexadecimal."""
    units: Literal["mm", "m"]
    """The unit of its coordinates, which STL does not state."""
'''


def fields(schema: dict[str, Any]) -> str:
    """The module of the scenarios of each experiment."""
    experiments = schema["properties"]["experiment"]["enum"]
    classes: dict[str, dict[str, str]] = {}
    for experiment in experiments:
        Section(experiment, classes).write("", schema)
    parts = [HEAD.format(
        title="Scenarios as types: the fields of each experiment with meaning, unit, default, range and source.",
        abcs="Sequence",
        names="Literal, TypeAlias, TypedDict, Union",
        imports="from roost.protocols import Array",
        required="Required",
    )]  # fmt: skip
    parts.append(MESHES)
    resolved: dict[str, str] = {}
    # The innermost sections come first, since the others name them.
    for pointer in sorted(classes, key=lambda pointer: -pointer.count("/") if pointer else 1):
        stem, versions = stem_of(pointer), classes[pointer]
        for mark, name in resolved.items():
            versions = {experiment: body.replace(mark, name) for experiment, body in versions.items()}
        # A section that is the same in all experiments has one class.
        is_shared = len(set(versions.values())) == 1 and len(versions) == len(experiments)
        for experiment, body in versions.items():
            # The experiment's own section has its name already.
            name = stem if is_shared or stem.startswith(camel(experiment)) else f"{camel(experiment)}{stem}"
            if name not in resolved.values():
                parts.append(body.replace(f"class @{stem}(", f"class {name}("))
            resolved[f"@{experiment}@{stem}@"] = name
    alias = ", ".join(f"{camel(experiment)}Scenario" for experiment in experiments)
    parts.append(f'ScenarioDocument: TypeAlias = Union[{alias}]\n"""The scenario of any experiment."""\n')
    parts.append(changes(schema, experiments, resolved))
    return "\n\n".join(parts)


def changes(schema: dict[str, Any], experiments: list[str], resolved: dict[str, str]) -> str:
    """The class of the fields and sections by which a scenario of any experiment is changed."""
    lines = ["class ScenarioChanges(TypedDict, total=False):", docstring("New values of fields and sections.", 4), ""]
    for name, of_field in schema["properties"].items():
        of_experiments = [f"@{experiment}@{camel(name)}@" for experiment in of_field.get("x-experiments", experiments)]
        text = union([resolved[mark] for mark in of_experiments]) if is_section(of_field) else field_type(of_field)
        lines += [f"    {name}: {text}", docstring(of_field.get("description", ""), 4)]
    return "\n".join(lines) + "\n"


class Section:
    """The classes of an experiment's sections."""

    def __init__(self, experiment: str, classes: dict[str, dict[str, str]]) -> None:
        self.experiment = experiment
        self.classes = classes

    def write(self, pointer: str, schema: dict[str, Any]) -> str:
        """Adds the class of a section and those within it; returns a mark for its name."""
        stem = stem_of(pointer)
        doc = schema.get("description", "").replace(f" Only in `{self.experiment}`.", "")
        lines: list[str] = []
        for name, of_field in schema["properties"].items():
            if self.experiment in of_field.get("x-experiments", [self.experiment]):
                lines += self.field(f"{pointer}/{name}", name, of_field, name in schema.get("required", []))
        body = "\n".join([f"class @{stem}(TypedDict, total=False):", docstring(doc or pointer, 4), "", *lines]) + "\n"
        self.classes.setdefault(pointer, {})[self.experiment] = body
        return f"@{self.experiment}@{stem}@"

    def field(self, pointer: str, name: str, schema: dict[str, Any], is_required: bool) -> list[str]:
        """The lines of a field, or of a section within."""
        doc = schema.get("description", "").replace(f" Only in `{self.experiment}`.", "")
        if pointer == "/experiment":
            schema = {**schema, "enum": [self.experiment]}
        if is_section(schema):
            text = self.write(pointer, schema)
        elif is_section(schema.get("items", {})):
            text = f"Sequence[{self.write(f'{pointer}/item', {'description': doc, **drop_blank(schema['items'])})}]"
        else:
            text, doc = field_type(schema), self.described(schema)
        return [f"    {name}: {f'Required[{text}]' if is_required else text}", docstring(doc, 4)]

    def described(self, schema: dict[str, Any]) -> str:
        """Meaning, unit, source, default and range of a field in this experiment."""
        text, default = schema.get("description", ""), schema.get("default")
        has_default = "default" in schema
        for experiment, own in re.findall(r" Default in `(\w+)`: (\S+?)\.(?= )", text):
            if experiment == self.experiment:
                default, has_default = json.loads(own), True
        text = re.sub(r" Default in `\w+`: \S+?\.(?= )", "", text)
        text = re.sub(r" Only in [^.]*\.", "", text)
        if has_default:
            text += f" Default: {plain(default)}."
        low = next(
            (f"{mark} {plain(schema[key])}" for key, mark in (("minimum", "≥"), ("exclusiveMinimum", ">")) if key in schema), ""
        )
        high = next(
            (f"{mark} {plain(schema[key])}" for key, mark in (("maximum", "≤"), ("exclusiveMaximum", "<")) if key in schema), ""
        )
        ends = " and ".join(filter(None, [low, high]))
        return f"{text} Range: {ends}." if ends else text


def stem_of(pointer: str) -> str:
    """The name of a section's class without its experiment."""
    return "".join(camel(part) for part in pointer.split("/")[1:]) or "Scenario"


def is_section(schema: dict[str, Any]) -> bool:
    """Whether a schema is an object with fields of its own; a mesh is a field."""
    return "properties" in schema and "digest" not in schema["properties"]


def drop_blank(schema: dict[str, Any]) -> dict[str, Any]:
    """The schema without an empty description."""
    return {name: value for name, value in schema.items() if not (name == "description" and not value)}


def field_type(schema: dict[str, Any]) -> str:
    """The type of a field that users write."""
    if "digest" in schema.get("properties", {}):
        return "MeshFile | MeshDigest | None"
    kinds = kinds_of(schema)
    if "array" in kinds:
        item = f"Sequence[{field_type(schema['items'])}] | Array"
        return f"{item} | None" if "null" in kinds else item
    if schema.get("pattern") == "^auto$":
        return 'float | Literal["auto"]'
    return python_type(schema)


def camel(name: str) -> str:
    """A name of a class: `FilletBelt` for `fillet_belt`."""
    return "".join(part.capitalize() for part in name.split("_"))


def plain(value: Any) -> str:
    """A value as a scenario writes it."""
    return json.dumps(value, ensure_ascii=False)


# Both


def docstring(text: str, indent: int) -> str:
    """A docstring in lines of limited width; nothing without a text."""
    if not text:
        return ""
    text = " ".join(text.split()).replace("\\", "\\\\").replace('"""', "'''")
    if text.endswith('"'):
        text += " "
    margin = " " * indent
    lines = textwrap.wrap(
        f'"""{text}', WIDTH, initial_indent=margin, subsequent_indent=margin, break_long_words=False, break_on_hyphens=False
    )
    closed = f'{lines[-1]}"""'
    return "\n".join([*lines[:-1], closed] if len(closed) <= WIDTH else [*lines, f'{margin}"""'])


if __name__ == "__main__":
    sys.exit(main())
