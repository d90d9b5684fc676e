"""The extension module. The package wraps it; call that."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Progress = Callable[[int, int], Any] | None
Camera = tuple[list[float], list[float], list[float], float]
Rows = NDArray[np.float32] | NDArray[np.float64]

__version__: str

class BrickwalkError(RuntimeError): ...

class Core:
    def __new__(cls, path: str, cache: str, adapter: str, disk_cache: str | None = None) -> Core: ...
    def close(self) -> None: ...
    @property
    def closed(self) -> bool: ...
    def info(self) -> dict[str, Any]: ...
    def stats(self) -> dict[str, Any]: ...
    def cast(
        self,
        rays: Rows,
        shape: tuple[int, ...],
        t: NDArray[np.float64],
        triangle: NDArray[np.uint32],
        uv: NDArray[np.float32],
        normal: NDArray[np.float32],
        progress: Progress,
    ) -> None: ...
    def occluded(self, rays: Rows, shape: tuple[int, ...], hit: NDArray[np.bool_], progress: Progress) -> None: ...
    def count(self, rays: Rows, shape: tuple[int, ...], count: NDArray[np.uint32], progress: Progress) -> None: ...
    def intersections(
        self, rays: Rows, shape: tuple[int, ...], progress: Progress
    ) -> tuple[
        NDArray[np.int64], NDArray[np.float64], NDArray[np.uint32], NDArray[np.float32], NDArray[np.float32]
    ]: ...
    def closest(
        self,
        points: Rows,
        shape: tuple[int, ...],
        point: NDArray[np.float64],
        distance: NDArray[np.float64],
        triangle: NDArray[np.uint32],
        uv: NDArray[np.float32],
        normal: NDArray[np.float32],
        progress: Progress,
    ) -> None: ...
    def occupancy(
        self, points: Rows, shape: tuple[int, ...], inside: NDArray[np.bool_], open: bool, progress: Progress
    ) -> None: ...
    def distance(
        self, points: Rows, shape: tuple[int, ...], distance: NDArray[np.float64], progress: Progress
    ) -> None: ...
    def signed_distance(
        self, points: Rows, shape: tuple[int, ...], distance: NDArray[np.float64], open: bool, progress: Progress
    ) -> None: ...
    def visibility(self, pairs: Rows, shape: tuple[int, ...], free: NDArray[np.bool_], progress: Progress) -> None: ...
    def render(
        self, settings: str, chosen: list[str], camera: Camera | None, progress: Progress
    ) -> tuple[dict[str, NDArray[Any]], list[str]]: ...

class WalkParts:
    """Parts of a walk, for ``brickwalk walk --join``: its frames or, where settings ask for bands, bands of them.

    ``scene`` is a path or a URL, ``settings`` the text that ``brickwalk walk ... --print-settings`` prints. Any process
    may render any part, in any order. The session is opened by the first part and stays open.
    """

    def __new__(cls, scene: str, settings: str, disk_cache: str | None = None) -> WalkParts: ...
    @property
    def key(self) -> str:
        """16 hexadecimal digits that only parts of the same walk have."""
    @property
    def frames(self) -> int:
        """Frames of the walk."""
    @property
    def parts(self) -> int:
        """Its parts: of B bands part N is band N mod B of frame N / B, from the top."""
    def render(self, output: str, number: int, progress: Progress) -> dict[str, Any]:
        """Renders the part ``number`` into the folder ``output``, unless it is there and whole.

        Returns ``path``, ``part``, ``is_new``, ``worker``, ``seconds``, ``bytes_loaded``, of a scene by URL ``requests``,
        ``bytes_fetched`` and ``seconds_waiting``, and ``warnings``.
        """
    def close(self) -> None: ...

def build_mesh(
    vertices: Rows, faces: NDArray[np.int64], out: str, brick_triangles: int, progress: Progress
) -> None: ...
def convert(inputs: list[str], out: str, settings: dict[str, Any], progress: Progress) -> dict[str, Any]: ...
def convert_shared(
    inputs: list[str],
    out: str,
    settings: dict[str, Any],
    perform: Callable[[str, int, int, list[int]], Iterable[object]],
    progress: Progress,
) -> dict[str, Any]: ...
def pinhole(arguments: Camera, width: int, height: int) -> NDArray[np.float64]: ...
def generate(kind: str, out: str, triangles: int, seed: int, progress: Progress) -> int: ...

class ConversionWorker:
    def __new__(cls, inputs: list[str], out: str, settings: dict[str, Any]) -> ConversionWorker: ...
    def perform(self, step: str, position: int, task: int) -> None: ...
