"""Fixtures for the tests of the client: servers with workers, and a sweep."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from roost.client import Client, Sweep

from .servers import Document, Farm, hopper


@pytest.fixture(scope="session")
def farm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Farm]:
    """A server with a worker, for all tests that stop neither."""
    with Farm(tmp_path_factory.mktemp("farm")) as farm:
        farm.serve()
        farm.work()
        yield farm


@pytest.fixture(scope="session")
def client(farm: Farm) -> Client:
    """A client of the common farm."""
    return farm.client()


@pytest.fixture
def own_farm(tmp_path: Path) -> Iterator[Farm]:
    """An address without a server, for tests that start and stop their own."""
    with Farm(tmp_path) as farm:
        yield farm


@pytest.fixture(scope="session")
def sweep_document() -> Document:
    """Two gates, of which the first jams, by two frictions of the belt by two seeds."""
    base = hopper(2.0)
    base["numerics"].pop("stop")
    return {
        "name": "gate by belt",
        "base": base,
        "design": {"kind": "grid"},
        "factors": [
            {"pointer": "/equipment/gate_opening_m", "levels": [0.01, 0.08]},
            {"pointer": "/contact/fillet_belt/static_friction", "levels": [0.3, 0.6]},
        ],
        "replicates": 2,
    }


@pytest.fixture(scope="session")
def sweep(client: Client, sweep_document: Document) -> Sweep:
    """Its eight jobs, which have succeeded. No test changes it."""
    sweep = client.submit_sweep(sweep_document).wait(180, progress=False)
    assert sweep.view["counts"]["succeeded"] == 8, sweep
    return sweep
