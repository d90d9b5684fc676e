"""A cluster on this machine, or one that runs already; how far the work is."""

from __future__ import annotations

import os
import shutil
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import dask
import psutil
from distributed import Client, Future, LocalCluster, as_completed
from distributed.scheduler import KilledWorker

#: A task goes to another worker so many times when its worker dies.
DEATHS = 10
GONE = "the scheduler went away; the same command goes on where this one stopped"


class Failed(Exception):
    """What a person should read in one line: the thing and the remedy."""


def program() -> str:
    """The program ``brickwalk``: the one that the environment variable BRICKWALK names, else the one on the path."""
    named = os.environ.get("BRICKWALK")
    found = shutil.which(named or "brickwalk")
    if not found:
        where = f"BRICKWALK names no program: {named}" if named else "the program brickwalk is not on the path"
        raise Failed(f"{where}; install it from its sources with cargo install --path .")
    return os.path.abspath(found)


class Cluster:
    """Workers: those of the scheduler at ``address``, or ``workers`` processes on this machine.

    Processes of this machine share its cores, and the memory that is free; with ``shares_cores`` off, as for
    measurements, each has all cores. Dask's own limit of memory is off: brickwalk keeps to sizes that it is given.
    """

    def __init__(self, address: str | None = None, workers: int | None = None, *, shares_cores: bool = True):
        self.is_local = address is None
        self._local: LocalCluster | None = None
        dask.config.set({"distributed.scheduler.allowed-failures": DEATHS})
        if address is not None:
            try:
                self.client = Client(address, timeout="10s", name="brickwalk-cluster")
            except (OSError, ValueError) as error:
                raise Failed(f"{address}: there is no scheduler of Dask here ({one_line(error)})") from error
            return
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        self.workers = workers or (max(1, cores // 4) if shares_cores else 1)
        threads = str(max(1, cores // self.workers) if shares_cores else cores)
        with warnings.catch_warnings():
            # Another cluster of this machine has the usual port of a page that nobody is told of.
            warnings.filterwarnings("ignore", "Port [0-9]+ is already in use", UserWarning)
            self._local = LocalCluster(
                n_workers=self.workers,
                threads_per_worker=1,
                processes=True,
                memory_limit=0,
                dashboard_address=None,
                env={"RAYON_NUM_THREADS": threads},
            )
        self.client = Client(self._local)

    def share_of_memory(self) -> int | None:
        """Bytes that a worker's cache may have; None: the workers decide, which have machines of their own."""
        return psutil.virtual_memory().available // (3 * self.workers) if self.is_local else None

    def addresses(self) -> list[str]:
        """The workers, in one order. Raises :class:`Failed` if the scheduler is gone."""
        try:
            return sorted(self.client.scheduler_info(n_workers=-1)["workers"])
        except Exception as error:
            raise Failed(GONE) from error

    def wait_for_workers(self, seconds: float = 60.0) -> None:
        """Waits until there is one."""
        try:
            self.client.wait_for_workers(1, timeout=seconds)
        except Exception as error:
            raise Failed(f"no worker of Dask came within {seconds:.0f} s; start dask worker ADDRESS") from error

    def close(self) -> None:
        self.client.close()
        if self._local is not None:
            self._local.close()

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def results(client: Client, futures: Iterable[Future]) -> Iterator[Any]:
    """What tasks return, as they end.

    Raises :class:`Failed` for the first that fails, and leaves none running.
    """
    futures = list(futures)
    try:
        for future in as_completed(futures):
            try:
                yield future.result()
            except KilledWorker as error:
                raise Failed(f"a task lost {DEATHS + 1} workers; the workers' logs say why they ended") from error
            except Failed:
                raise
            except Exception as error:
                raise Failed(one_line(error) if is_own_error(future) else GONE) from error
    finally:
        try:
            client.cancel(futures, force=True)
        except Exception:  # The scheduler is gone, and its tasks with it.
            pass


def is_own_error(future: Future) -> bool:
    """Whether what waiting for ``future`` raised came from its task; else the connection to the scheduler broke."""
    return bool(future.status == "error")


def one_line(error: BaseException) -> str:
    """An error in one line."""
    return " ".join(str(error).split()) or type(error).__name__


class Progress:
    """Says on standard error how far work is: a line that is replaced on a terminal, else one every ten seconds."""

    def __init__(self, what: str, total: int, is_quiet: bool = False, clock: Callable[[], float] = time.monotonic):
        self.what, self.total, self.done, self.before = what, total, 0, 0
        self._is_quiet, self._clock, self._start = is_quiet, clock, clock()
        self._is_terminal = sys.stderr.isatty()
        self._next = self._start

    def skip(self, count: int) -> None:
        """So many need not be done."""
        self.done += count
        self.before += count

    def reach(self, done: int, total: int, workers: int) -> None:
        """So many of so many are done, by so many workers; a smaller total begins anew."""
        if total != self.total:
            self.total, self.done, self.before, self._start = total, 0, 0, self._clock()
        if done > self.done:
            self.advance(done - self.done, workers)

    def advance(self, count: int, workers: int) -> None:
        """So many more are done, by so many workers."""
        self.done += count
        now = self._clock()
        if self._is_quiet or (now < self._next and self.done < self.total):
            return
        self._next = now + (0.2 if self._is_terminal else 10.0)
        new = self.done - self.before
        left = (now - self._start) / new * (self.total - self.done) if new else 0.0
        text = f"{self.what} {self.done} of {self.total}, {workers} workers, {left:.0f} s left"
        end = "\n" if not self._is_terminal or self.done >= self.total else ""
        sys.stderr.write(("\r\x1b[K" if self._is_terminal else "") + text + end)
        sys.stderr.flush()
