"""Walks, studies, benchmarks and conversions of brickwalk over a Dask cluster.

Dask schedules: it hands out tasks, and gives those of a worker that died to another. A task writes files under
temporary names and renames them when they are whole; what it returns are names and numbers, never pixels. So files are
the truth: a rerun finds what is whole and does the rest.
"""

from .cluster import Cluster, Failed, Progress
from .commands import measure
from .conversion import convert
from .walk import walk

__all__ = ["Cluster", "Failed", "Progress", "convert", "measure", "walk"]
