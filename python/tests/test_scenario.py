"""Scenarios: defaults, faults, digests, changes, meshes."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

import roost
from conftest import hopper
from roost import scenario
from roost.fields import ScenarioDocument


def test_defaults_are_filled_in_and_a_file_gives_the_same_scenario(tmp_path: Path) -> None:
    scenario = roost.Scenario(**hopper(0.5))
    assert scenario.to_dict()["equipment"]["belt_speed_m_s"] > 0
    assert "belt_speed_m_s" not in scenario.given["equipment"]
    file = tmp_path / "hopper.json"
    file.write_text(json.dumps(hopper(0.5)))
    for other in (roost.Scenario(file), roost.Scenario(str(file)), roost.Scenario(roost.Untyped(scenario.to_dict()))):
        assert other == scenario and hash(other) == hash(scenario)
    assert scenario.with_(seed=2) != scenario


def test_every_experiment_has_its_keywords() -> None:
    source = Path(scenario.__file__).read_text(encoding="utf-8")
    for experiment in get_args(ScenarioDocument):
        assert f"**fields: Unpack[{experiment.__name__}]" in source


def test_a_dictionary_of_unknown_type_is_taken_as_a_document() -> None:
    untyped = roost.Untyped(hopper(0.5))
    scenario = roost.Scenario(untyped)
    assert scenario == roost.Scenario(hopper(0.5)) == roost.Scenario(scenario)
    assert roost.run(untyped, progress=False).scenario == scenario
    with pytest.raises(roost.ScenarioError, match="/experiment"):
        roost.Scenario(roost.Untyped({}))


def test_every_fault_is_raised_with_its_place() -> None:
    fields = hopper(0.5)
    fields["equipment"] |= {"belt_sped_m_s": 0.1, "hopper_width_m": -1}
    with pytest.raises(roost.ScenarioError) as raised:
        roost.Scenario(fields)
    faults = {fault.pointer: fault for fault in raised.value.faults}
    assert faults.keys() == {"/equipment/belt_sped_m_s", "/equipment/hopper_width_m"}
    assert "belt_speed_m_s" in faults["/equipment/belt_sped_m_s"].detail
    width = faults["/equipment/hopper_width_m"]
    assert width.value == -1 and width.allowed is not None
    assert str(raised.value).splitlines()[0] == "2 faults" and width.allowed in str(raised.value)
    assert pickle.loads(pickle.dumps(raised.value)).faults == raised.value.faults


def test_a_scenario_that_does_not_fit_is_found_by_the_check() -> None:
    scenario = roost.Scenario(hopper(0.5)).with_({"/numerics/timestep_s": 3e-3})
    for refused in (scenario.check, lambda: roost.run(scenario, progress=False)):
        with pytest.raises(roost.ScenarioError) as raised:
            refused()
        assert [fault.pointer for fault in raised.value.faults] == ["/numerics/timestep_s"]


def test_check_estimates_size_and_cost() -> None:
    estimate = roost.Scenario(hopper(0.5)).check()
    assert estimate.fillets == 2 and estimate.subparticles > 20
    assert 0 < estimate.timestep_s <= estimate.stable_timestep_s


def test_a_file_that_is_no_json_names_the_place(tmp_path: Path) -> None:
    file = tmp_path / "hopper.json"
    file.write_text('{"experiment": "hopper",\n "seed": 1, "seed": 2}')
    with pytest.raises(roost.ScenarioError, match="not JSON at line 2, column .*stands twice"):
        roost.Scenario(file)


def test_changes_go_into_the_given_fields() -> None:
    scenario = roost.Scenario(hopper(0.5))
    gates = [
        scenario.with_({"/equipment/gate_opening_m": gate, "/product/count": np.int64(3)}, seed=2)
        for gate in np.linspace(0.05, 0.06, 2)
    ]
    assert [gate.to_dict()["equipment"]["gate_opening_m"] for gate in gates] == [0.05, 0.06]
    assert gates[0].given["product"]["count"] == 3 and gates[0].given["seed"] == 2 and "seed" not in scenario.given
    with pytest.raises(roost.ScenarioError, match="/equipment/gate: is not a known field"):
        scenario.with_({"/equipment/gate": 0.06})
    with pytest.raises(ValueError, match="no JSON pointer"):
        scenario.with_({"gate": 0.06})
    with pytest.raises(TypeError, match="no value of a scenario"):
        scenario.with_({"/seed": object()})


def wall(path: Path) -> None:
    """An STL file of a triangle, in millimetres."""
    corners = "".join(f"vertex {x} {y} {z}\n" for x, y, z in [(0, -100, 0), (0, 100, 0), (0, 0, 300)])
    path.write_text(f"solid wall\nfacet normal 1 0 0\nouter loop\n{corners}endloop\nendfacet\nendsolid wall\n")


def test_mesh_files_are_relative_to_the_file_of_the_scenario(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    wall(tmp_path / "parts/wall.stl")
    fields = hopper(0.2)
    mesh = {"file": "parts/wall.stl", "units": "mm"}
    fields["equipment"]["surfaces"] = [{"name": "wall", "mesh": mesh, "position_m": [0.4, 0, 0]}]
    file = tmp_path / "hopper.json"
    file.write_text(json.dumps(fields))
    scenario = roost.Scenario(file)
    digest = scenario.to_dict()["equipment"]["surfaces"][0]["mesh"]["digest"]
    assert scenario.meshes == {digest: (tmp_path / "parts/wall.stl").read_bytes()}
    assert roost.Scenario(fields, folder=tmp_path) == scenario
    # Changed and pickled scenarios find their meshes from any working directory.
    assert scenario.with_(seed=2).check().fillets == 2
    assert pickle.loads(pickle.dumps(scenario)).meshes == scenario.meshes
    with pytest.raises(roost.ScenarioError, match="/equipment/surfaces/0/mesh/file: cannot read"):
        roost.Scenario(fields, folder=tmp_path / "parts")
    # A scenario as a source keeps its folder.
    assert roost.Scenario(scenario).check().fillets == 2
    # A digest alone names a mesh at a server: the fields are sound, and a run is refused.
    elsewhere = roost.Scenario(roost.Untyped(scenario.to_dict()))
    assert elsewhere == scenario
    with pytest.raises(roost.ScenarioError, match="/equipment/surfaces/0/mesh/digest"):
        elsewhere.check()
