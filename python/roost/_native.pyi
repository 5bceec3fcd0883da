"""The solver in this process. Documents are JSON text."""

from collections.abc import Callable
from pathlib import Path
from typing import final

from .recording import FrameOptions

__all__ = ["VERSION", "SOLVER_REVISION", "Faults", "Refused", "Scenario"]

VERSION: str
SOLVER_REVISION: int

class Faults(Exception):
    """Faults of a document: its argument is a JSON list of them."""

class Refused(Exception):
    """A run cannot start: its argument is the reason."""

@final
class Scenario:
    def __new__(cls, text: str, folder: Path) -> Scenario: ...
    @property
    def document(self) -> str: ...
    @property
    def digest(self) -> str: ...
    @property
    def meshes(self) -> list[tuple[str, bytes]]: ...
    def check(self) -> str: ...
    def run(
        self,
        *,
        threads: int,
        device: str,
        report: Callable[[str], object] | None,
        checkpoint: Path | None,
        checkpoint_every_s: float,
        from_start: bool,
        frames: FrameOptions | None,
    ) -> tuple[str, BaseException | None, list[str]]: ...
