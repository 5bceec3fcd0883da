"""The parts of `roost.client`: requests, documents, and the objects that stand for jobs, sweeps and studies."""
