"""Roost: DEM simulations of soft food.

`run` simulates a `Scenario` in this process, without a server.
"""

from ._native import SOLVER_REVISION
from ._native import VERSION as __version__
from .client import Client, Job, Study, Sweep
from .documents import Untyped
from .errors import ApiError, Fault, Interrupted, RoostError, ScenarioError
from .result import Curve, Result, RunWarning
from .running import Progress, run
from .scenario import Estimate, Scenario

__all__ = [
    "Sweep",
    "Study",
    "Job",
    "Client",
    "SOLVER_REVISION",
    "ApiError",
    "Curve",
    "Estimate",
    "Fault",
    "Interrupted",
    "Progress",
    "Result",
    "RoostError",
    "RunWarning",
    "Scenario",
    "ScenarioError",
    "Untyped",
    "__version__",
    "run",
]
