"""Documents: their kinds, and the files that they name."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy
import pytest

from roost.api.documents import complete, kind_of, load
from roost.client import Client
from roost.documents import Untyped
from roost.errors import RoostError, ScenarioError
from roost.scenario import Scenario

from .servers import Document


def box_stl() -> bytes:
    """A closed box of 120 by 60 by 30 mm as a binary STL file."""
    corners = [(x, y, z) for x in (0, 120) for y in (0, 60) for z in (0, 30)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [(face[0], face[i], face[i + 1]) for face in faces for i in (1, 2)]
    rows = [struct.pack("<12fH", 0, 0, 0, *(float(of) for k in triangle for of in corners[k]), 0) for triangle in triangles]
    return bytes(80) + struct.pack("<I", len(rows)) + b"".join(rows)


def scene(mesh: Any) -> Document:
    """A fillet above a surface from CAD."""
    surface = {"name": "block", "mesh": mesh}
    return {"experiment": "scene", "scene": {"bodies": [{"shape": 0, "position_m": [0.06, 0.03, 0.1]}], "surfaces": [surface]}}


def test_meshes_go_with_a_document(client: Client, tmp_path: Path) -> None:
    (tmp_path / "block.stl").write_bytes(box_stl())
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(scene({"file": "block.stl", "units": "mm"})), encoding="utf-8")
    report = client.validate(path)
    mesh = client.upload_mesh(tmp_path / "block.stl")
    assert [row["digest"] for row in report["meshes"]] == [mesh["digest"]] and mesh["closed"] and mesh["triangles"] == 12
    assert report["meshes"][0]["size_m"] == pytest.approx([0.12, 0.06, 0.03])
    assert any(other["digest"] == mesh["digest"] for other in client.meshes())
    # A document that is no file names its meshes from the working folder.
    client.validate(scene({"file": str(tmp_path / "block.stl"), "units": "mm"}))


def test_every_unusable_file_is_a_fault(client: Client, tmp_path: Path) -> None:
    (tmp_path / "broken.stl").write_bytes(b"solid nonsense")
    document = scene({"file": str(tmp_path / "broken.stl"), "units": "mm"})
    document["scene"]["surfaces"].append({"name": "other", "mesh": {"file": "absent.stl", "units": "mm"}})
    with pytest.raises(ScenarioError) as caught:
        client.submit_job(document)
    assert [fault.pointer for fault in caught.value.faults] == [f"/scenario/scene/surfaces/{k}/mesh/file" for k in (0, 1)]
    assert "cannot read absent.stl" in caught.value.faults[1].detail


def test_meshes_stand_in_levels_rows_and_bases(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(b"a")
    mesh = {"file": "a.stl", "units": "mm"}
    document: Document = {
        "base": scene(mesh),
        "factors": [
            {"pointer": "/scene/surfaces/0/mesh", "levels": [mesh, None]},
            {"pointer": "/seed", "levels": [{"file": "a.stl"}]},
        ],
        "design": {"kind": "list", "rows": [[mesh, 1]]},
    }
    sent: list[bytes] = []

    def upload(content: bytes) -> str:
        sent.append(content)
        return "digest"

    plain, _ = load(document)
    done = complete(plain, tmp_path, upload)
    stored = {"digest": "digest", "units": "mm"}
    assert done["base"]["scene"]["surfaces"][0]["mesh"] == stored
    assert done["factors"][0]["levels"] == [stored, None] and done["design"]["rows"] == [[stored, 1]]
    assert done["factors"][1]["levels"] == [{"file": "a.stl"}], "no mesh"
    assert sent == [b"a"] and document["base"]["scene"]["surfaces"][0]["mesh"] is mesh, "the caller's document stays"


def test_texts_of_tables_and_posteriors_are_inserted(tmp_path: Path) -> None:
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab/curve.csv").write_text("x,mean\n1,2\n", encoding="utf-8")
    measurements = {"tests": [{"measured": {"curves": [{"x": "strain", "file": "curve.csv"}]}}]}
    (tmp_path / "lab/lab.json").write_text(json.dumps(measurements), encoding="utf-8")
    factors = [{"pointers": ["/a", "/b"]}, {"pointer": "/c"}]
    answer = {"factors": factors, "answer": {"finding": {"calibrate": {"samples": [[1.0, 2.0]]}}}}
    (tmp_path / "answer.json").write_text(json.dumps(answer), encoding="utf-8")
    (tmp_path / "points.csv").write_text("/a\n1\n", encoding="utf-8")
    document = {
        "goal": {"calibrate": {"measurements": "lab/lab.json"}},
        "posterior": {"file": "answer.json"},
        "design": {"kind": "csv", "file": "points.csv"},
    }
    done = complete(document, tmp_path, lambda _: "")
    curve = done["goal"]["calibrate"]["measurements"]["tests"][0]["measured"]["curves"][0]
    assert curve == {"x": "strain", "table": "x,mean\n1,2\n"}
    assert done["posterior"] == {"parameters": ["/a", "/b", "/c"], "samples": [[1.0, 1.0, 2.0]]}
    assert done["design"] == {"kind": "csv", "table": "/a\n1\n"}


def test_fields_decide_the_kind() -> None:
    assert kind_of({"experiment": "hopper"}) == "scenario"
    assert kind_of({"scenario": {}}) == "job"
    assert kind_of({"base": {}, "factors": []}) == "sweep"
    assert kind_of({"base": {}, "factors": [], "goal": {}}) == "study"
    assert kind_of({"schema": "roost.measurements/9"}) == "measurements"


def test_a_scenario_brings_its_fields_and_files_but_no_defaults(tmp_path: Path) -> None:
    (tmp_path / "block.stl").write_bytes(box_stl())
    scenario = Scenario(scene({"file": "block.stl", "units": "mm"}), folder=tmp_path)
    plain, folder = load(Untyped({"base": scenario}))
    assert plain["base"] == scene({"file": str(tmp_path / "block.stl"), "units": "mm"})
    sent: list[bytes] = []

    def upload(content: bytes) -> str:
        sent.append(content)
        return "digest"

    complete(plain, folder, upload)
    assert sent == [box_stl()] and plain["base"]["scene"]["surfaces"][0]["mesh"]["digest"] == "digest"


def test_arrays_and_documents_within_become_json(tmp_path: Path) -> None:
    class Scenario:
        def to_dict(self) -> dict[str, Any]:
            return {"experiment": "hopper"}

    document: Document = {"base": Scenario(), "levels": numpy.linspace(0, 1, 3), "count": numpy.int64(3)}
    plain, _ = load(document)
    assert load(Untyped(document))[0] == plain
    assert plain == {"base": {"experiment": "hopper"}, "levels": [0.0, 0.5, 1.0], "count": 3}
    assert load(Scenario())[0] == {"experiment": "hopper"}
    with pytest.raises(RoostError, match="no JSON"):
        load(Untyped({"x": float("nan")}))
    path = tmp_path / "broken.json"
    path.write_text("{", encoding="utf-8")
    with pytest.raises(RoostError, match="broken.json is no JSON"):
        load(path)
