"""The input of a simulation: read, completed and checked by the solver itself, so that Python repeats no rule of it."""

from __future__ import annotations

import copy
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union, cast, overload

from . import _native
from .documents import Untyped
from .errors import Fault, ScenarioError
from .protocols import HasDocument

if TYPE_CHECKING:
    # Part of typing from Python 3.11 on; type checkers know it in any case.
    from typing_extensions import Unpack

    from .documents import ScenarioInput
    from .fields import (
        BendScenario,
        CompressScenario,
        DropScenario,
        HopperScenario,
        ScenarioChanges,
        SceneScenario,
        SlideScenario,
    )

Folder = Union[str, "os.PathLike[str]"]


@dataclass(frozen=True)
class Estimate:
    """Size and cost of a scenario, estimated without running it."""

    fillets: int
    subparticles: int
    bonds: int
    mass_kg: float
    timestep_s: float
    """Time step that the run will use."""
    stable_timestep_s: float
    """Longest stable time step without damping."""
    steps: int
    """Time steps, an upper bound."""
    memory_bytes: int
    """Memory on the CPU."""
    wall_s: float
    """Rough wall time on two cores, in seconds."""
    warnings: list[str]


class Scenario:
    """A scenario whose fields are sound.

    `Scenario("hopper.json")` reads a file. `Scenario({"experiment": "hopper", …})` and `Scenario(experiment="hopper", …)` take
    fields, and arrays of numpy may be among them. Mesh files, `{"file": "hopper.stl", "units": "mm"}`, are relative to the folder
    of the scenario's file, or else to `folder`. Editors and type checkers know the fields. `Scenario(roost.Untyped(fields))` takes a
    dictionary of a type that they do not know.

    Raises `ScenarioError` with every fault. Equal scenarios have equal digests.
    """

    @overload
    def __init__(self, source: ScenarioInput, /, *, folder: Folder = ".") -> None: ...
    @overload
    def __init__(self, /, *, folder: Folder = ".", **fields: Unpack[HopperScenario]) -> None: ...
    @overload
    def __init__(self, /, *, folder: Folder = ".", **fields: Unpack[DropScenario]) -> None: ...
    @overload
    def __init__(self, /, *, folder: Folder = ".", **fields: Unpack[BendScenario]) -> None: ...
    @overload
    def __init__(self, /, *, folder: Folder = ".", **fields: Unpack[SlideScenario]) -> None: ...
    @overload
    def __init__(self, /, *, folder: Folder = ".", **fields: Unpack[CompressScenario]) -> None: ...
    @overload
    def __init__(self, /, *, folder: Folder = ".", **fields: Unpack[SceneScenario]) -> None: ...
    def __init__(
        self,
        source: ScenarioInput | None = None,
        /,
        *,
        folder: Folder = ".",
        **fields: Any,
    ) -> None:
        given: Mapping[str, Any] | None = {} if source is None else None
        if isinstance(source, Scenario):
            if folder != ".":
                raise TypeError("a scenario has its folder: folder= is for fields")
            given, folder = source._given, source._folder
        elif isinstance(source, HasDocument):
            given = source.to_dict()
        elif isinstance(source, Mapping):
            given = cast("Mapping[str, Any]", source)
        if given is not None:
            text = json.dumps({**given, **fields}, allow_nan=False, default=_plain)
        elif fields:
            raise TypeError("a scenario is either a file or fields: change those of a file by with_()")
        else:
            path = Path(cast("str | os.PathLike[str]", source))
            text, folder = path.read_text(encoding="utf-8-sig"), path.parent
        # Absolute, so that a later change of the working directory does not matter.
        self._folder: Path = Path(folder).absolute()
        try:
            self._native = _native.Scenario(text, self._folder)
        except _native.Faults as error:
            raise _scenario_error(error) from None
        self._given: dict[str, Any] = json.loads(text)

    @property
    def given(self) -> dict[str, Any]:
        """The fields as they were given, without defaults. `Scenario(roost.Untyped(fields))` takes them again."""
        return copy.deepcopy(self._given)

    @property
    def experiment(self) -> str:
        """Name of the experiment, such as `hopper`."""
        return str(self._given["experiment"])

    @property
    def digest(self) -> str:
        """Digest of the complete document: equal physics, equal digest."""
        return self._native.digest

    @property
    def meshes(self) -> dict[str, bytes]:
        """Content of the mesh files by their digests."""
        return dict(self._native.meshes)

    def to_dict(self) -> dict[str, Any]:
        """The complete document: every default is written out, and meshes are named by digest."""
        document: dict[str, Any] = json.loads(self._native.document)
        return document

    def with_(self, changes: Mapping[str, Any] | None = None, /, **fields: Unpack[ScenarioChanges]) -> Scenario:
        """This scenario with other values, named by JSON pointer or by field.

        `scenario.with_({"/equipment/gate_opening_m": 0.06}, seed=2)`. Values that follow from others are found again.
        """
        document = self.given
        for pointer, value in {**(changes or {}), **{f"/{name}": value for name, value in fields.items()}}.items():
            _put(document, pointer, value)
        return Scenario(Untyped(document), folder=self._folder)

    def check(self) -> Estimate:
        """Checks whether the fillets fit and the time step is stable, and estimates the cost. Raises `ScenarioError`."""
        try:
            return Estimate(**json.loads(self._native.check()))
        except _native.Faults as error:
            raise _scenario_error(error) from None

    def __eq__(self, other: object) -> bool:
        return self.digest == other.digest if isinstance(other, Scenario) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.digest)

    def __repr__(self) -> str:
        return f"<Scenario {self.experiment} {self.digest[:12]}>"

    def __reduce__(self) -> tuple[Any, ...]:
        """For other processes, which read the mesh files again."""
        return _restore, (self._given, self._folder)


def _restore(given: dict[str, Any], folder: Path) -> Scenario:
    return Scenario(Untyped(given), folder=folder)


def _scenario_error(error: _native.Faults) -> ScenarioError:
    return ScenarioError([Fault(**fault) for fault in json.loads(error.args[0])])


def _plain(value: Any) -> Any:
    """A value of numpy, or a path, as JSON has it."""
    if isinstance(value, Path):
        return str(value)
    convert = getattr(value, "tolist", None)
    if convert is None:
        raise TypeError(f"{value!r} of type {type(value).__name__} is no value of a scenario")
    return convert()


def _put(document: dict[str, Any], pointer: str, value: object) -> None:
    """Puts a value into a document. Objects on the way are made, since a document may leave out whole sections."""
    if not pointer.startswith("/"):
        raise ValueError(f"{pointer!r} is no JSON pointer, such as /equipment/gate_opening_m")
    *way, last = [part.replace("~1", "/").replace("~0", "~") for part in pointer[1:].split("/")]
    place: Any = document
    for part in way:
        place = place.setdefault(part, {}) if hasattr(place, "setdefault") else place[int(part)]
    place[last if hasattr(place, "setdefault") else int(last)] = value
