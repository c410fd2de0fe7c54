"""Many simulations at once, for evaluation and learning: one robot in each world."""

from __future__ import annotations

from simulator_stub.batch.readings import BatchReadings
from simulator_stub.batch.simulation import BatchSimulation, BatchSnapshot

__all__ = ["BatchReadings", "BatchSimulation", "BatchSnapshot"]
