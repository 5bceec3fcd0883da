"""Documents to submit: dictionaries or files, with the files that they name.

The server takes complete documents. As for the `roost` command, a document may name files beside it: STL meshes,
tables of designs and of measured curves, measurements of a calibration, and the answer of one. Their contents take
the place of their names here.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Literal, TypeGuard, cast

from roost.documents import Document
from roost.errors import ApiError, Fault, RoostError, ScenarioError
from roost.protocols import HasDocument


Kind = Literal["scenario", "job", "sweep", "study", "measurements"]


def kind_of(document: Mapping[str, Any]) -> Kind:
    """The kind of a document, which its fields decide, by the rules of the `roost` command."""
    schema = str(document.get("schema", ""))
    if schema.startswith("roost.measurements/") or "tests" in document:
        return "measurements"
    if schema == "roost.study/1" or "goal" in document or "budget" in document:
        return "study"
    if schema == "roost.sweep/1" or any(name in document for name in ("base", "factors", "design")):
        return "sweep"
    return "job" if "scenario" in document else "scenario"


def load(document: Document) -> tuple[dict[str, Any], Path]:
    """A document as plain JSON, and the folder from which its file names start: that of its file, or the working folder."""
    if isinstance(document, HasDocument):
        return _plain(_as_given(document)), Path()
    if isinstance(document, Mapping):
        return _plain(document), Path()
    path = Path(document)
    return _read_json(path), path.parent


def complete(document: dict[str, Any], folder: Path, upload: Callable[[bytes], str]) -> dict[str, Any]:
    """The document with the contents of the files that it names. `upload` stores a mesh at the server, and returns its digest.

    Raises `ScenarioError` with a fault for each file that cannot be used.
    """
    files = _Files(folder, upload)
    if kind_of(document) in ("sweep", "study"):
        files.insert_measurements(document)
        files.insert_posterior(document)
        files.insert_design(document)
    files.insert_meshes(document)
    if files.faults:
        raise ScenarioError(files.faults)
    return document


class _Files:
    """The files that a document names, and the faults among them."""

    def __init__(self, folder: Path, upload: Callable[[bytes], str]) -> None:
        self.faults: list[Fault] = []
        self._folder = folder
        self._upload = upload
        self._digests: dict[Path, str] = {}

    def insert_measurements(self, document: dict[str, Any]) -> None:
        """Puts the measurements of a calibration, and the tables of their curves, in the place of their names."""
        pointer = "/goal/calibrate/measurements"
        calibrate = _member(document.get("goal"), "calibrate")
        if not _is_object(calibrate) or "measurements" not in calibrate:
            return
        folder = self._folder
        if isinstance(calibrate["measurements"], str):
            path = folder / calibrate["measurements"]
            try:
                calibrate["measurements"], folder = _read_json(path), path.parent
            except RoostError as error:
                self.faults.append(
                    Fault(pointer, calibrate["measurements"], str(error), "measurements, or the path of their JSON file")
                )
                return
        for curve, at in _curves(calibrate["measurements"], pointer):
            self._insert_text(curve, at, folder)

    def insert_posterior(self, document: dict[str, Any]) -> None:
        """Puts the samples of a calibration in the place of the name of its answer."""
        draws = document.get("posterior")
        if not _is_object(draws) or "file" not in draws:
            return
        name = draws.pop("file")
        try:
            answer = _read_json(self._folder / str(name))
            fields = [factor.get("pointers") or [factor["pointer"]] for factor in answer["factors"]]
            samples = answer["answer"]["finding"]["calibrate"]["samples"]
        except (RoostError, KeyError, TypeError) as error:
            detail = str(error) if isinstance(error, RoostError) else f"{name} is no answer of a calibration"
            self.faults.append(Fault("/posterior/file", name, detail, "the path of the answer.json of a calibration"))
            return
        draws["parameters"] = [field for of_factor in fields for field in of_factor]
        draws["samples"] = [[value for value, of_factor in zip(sample, fields) for _ in of_factor] for sample in samples]

    def insert_design(self, document: dict[str, Any]) -> None:
        """Puts the CSV text of a design in the place of the name of its file."""
        design = document.get("design")
        if _is_object(design):
            self._insert_text(design, "/design", self._folder)

    def insert_meshes(self, document: dict[str, Any]) -> None:
        """Puts digests in the place of the names of STL files."""
        for mesh, pointer in _meshes(document, "", is_mesh=False):
            self._insert_mesh(mesh, pointer)

    def _insert_mesh(self, mesh: dict[str, Any], pointer: str) -> None:
        if "file" not in mesh:
            return
        name = mesh.pop("file")
        path = self._folder / str(name)
        try:
            if "digest" in mesh:
                raise RoostError("excludes `digest`, which comes from the file")
            if path not in self._digests:
                self._digests[path] = self._upload(_read_bytes(path))
            mesh["digest"] = self._digests[path]
        except RoostError as error:
            if isinstance(error, ApiError) and error.status != 422:
                raise
            detail = (error.detail or error.title) if isinstance(error, ApiError) else str(error)
            allowed = "the path of an STL file, relative to the folder of this document"
            self.faults.append(Fault(f"{pointer}/file", name, detail, allowed))

    def _insert_text(self, holder: dict[str, Any], pointer: str, folder: Path) -> None:
        if "file" not in holder:
            return
        name = holder.pop("file")
        other = next((other for other in ("points", "table") if other in holder), None)
        try:
            if other:
                raise RoostError(f"excludes `{other}`")
            holder["table"] = _read_bytes(folder / str(name)).decode("utf-8-sig")
        except (RoostError, UnicodeDecodeError) as error:
            self.faults.append(
                Fault(f"{pointer}/file", name, str(error), "the path of a CSV file, relative to the folder of this document")
            )


def _meshes(value: Any, pointer: str, *, is_mesh: bool) -> Iterator[tuple[dict[str, Any], str]]:
    """The objects of a document that name a mesh, wherever it may have one, each with its pointer."""
    if _is_list(value):
        for index, item in enumerate(value):
            yield from _meshes(item, f"{pointer}/{index}", is_mesh=is_mesh)
    if not _is_object(value):
        return
    if is_mesh:
        yield value, pointer
        return
    pointers: list[Any] = [value.get("pointer"), *_rows(value.get("pointers"))]
    has_mesh_levels = any(str(of).endswith("/mesh") for of in pointers)
    for name, inner in value.items():
        # An object in a row of levels can only be a mesh.
        is_level = (pointer == "/design" and name == "rows") or (has_mesh_levels and name == "levels")
        yield from _meshes(inner, f"{pointer}/{_escaped(name)}", is_mesh=is_level or name == "mesh")


def _curves(measurements: Any, pointer: str) -> list[tuple[dict[str, Any], str]]:
    """The curves of measurements, each with its pointer."""
    found: list[tuple[dict[str, Any], str]] = []
    for test, content in enumerate(_rows(_member(measurements, "tests"))):
        for index, curve in enumerate(_rows(_member(_member(content, "measured"), "curves"))):
            if _is_object(curve):
                found.append((curve, f"{pointer}/tests/{test}/measured/curves/{index}"))
    return found


def _is_object(value: Any) -> TypeGuard[dict[str, Any]]:
    return isinstance(value, dict)


def _is_list(value: Any) -> TypeGuard[list[Any]]:
    return isinstance(value, list)


def _member(value: Any, name: str) -> Any:
    """A member of an object, if it is one that has it."""
    return value.get(name) if _is_object(value) else None


def _rows(value: Any) -> list[Any]:
    return value if _is_list(value) else []


def _plain(document: Any) -> dict[str, Any]:
    """A document of plain dictionaries and lists, without anything shared with the caller's. Arrays of numpy become lists."""
    try:
        plain = json.loads(json.dumps(document, default=_as_json, allow_nan=False))
    except (TypeError, ValueError) as error:
        raise RoostError(f"the document is no JSON: {error}") from error
    if not _is_object(plain):
        raise RoostError("the document is no JSON object")
    return plain


def _as_given(value: HasDocument) -> Mapping[str, Any]:
    """The document of an object: of a `roost.Scenario` the fields that it was given, with the full paths of its mesh files.

    Its defaults stay out, because a factor of a sweep may change the defaults of other fields.
    """
    given = getattr(value, "given", None)
    if given is None:
        return value.to_dict()
    folder = Path(getattr(value, "_folder", ""))
    document = _plain(given)
    for mesh, _ in _meshes(document, "", is_mesh=False):
        if "file" in mesh:
            mesh["file"] = os.fspath(folder / str(mesh["file"]))
    return document


def _as_json(value: Any) -> Any:
    """What JSON lacks: documents within documents, mappings, numbers of numpy, paths."""
    if isinstance(value, HasDocument):
        return _as_given(value)
    if isinstance(value, Mapping):
        return dict(cast("Mapping[str, Any]", value))
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(cast("os.PathLike[str]", value))
    if isinstance(value, range):
        return list(value)
    raise TypeError(f"a {type(value).__name__} has no form in JSON")


def _read_json(path: Path) -> dict[str, Any]:
    try:
        document = json.loads(_read_bytes(path).decode("utf-8-sig"))
    except ValueError as error:
        raise RoostError(f"{path} is no JSON: {error}") from error
    if not _is_object(document):
        raise RoostError(f"{path} is no JSON object")
    return document


def _read_bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise RoostError(f"cannot read {path}: {error.strerror or error}") from error


def _escaped(name: str) -> str:
    return name.replace("~", "~0").replace("/", "~1")
