"""Converts models with the workers of a Dask cluster: the same bytes as ``brickwalk convert`` makes on one machine."""

from __future__ import annotations

import errno
import os
import threading
import uuid
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from distributed import Client, Future, KilledWorker, wait
from distributed import TimeoutError as NotYet

import brickwalk
from brickwalk._brickwalk import ConversionWorker, convert_shared
from brickwalk._convert import checked

from .cluster import GONE, is_own_error

Path = str | os.PathLike[str]

# How often a task that raises is done again elsewhere: a worker may not see yet what another has written.
RETRIES = 5

# Seconds after which the process that leads looks whether somebody wants it to stop.
TICK = 0.5

# The conversion that this process does tasks of: opening one reads its inputs.
_opened: dict[tuple[Any, ...], ConversionWorker] = {}
_opening = threading.Lock()


def convert(
    client: Client,
    inputs: Path | Iterable[Path],
    out: Path,
    *,
    scratch: Path | None = None,
    progress: Callable[[int, int], Any] | None = None,
    **settings: Any,
) -> dict[str, Any]:
    """Converts models into one scene file, which appears whole or not at all, by tasks of ``client``'s cluster.

    Arguments are those of :func:`brickwalk.convert`. This process leads: it hands out tasks, puts what they make
    together, and needs little memory. It and all workers must see the inputs, ``out``'s folder and ``scratch`` (by
    default ``out``'s folder) under the same names. ``memory`` is that of one task, by default a quarter of this
    machine's; ``threads`` are those of one task (1).

    A worker that dies costs the tasks it had. Dask gives a task up whose workers died more often than its setting
    ``distributed.scheduler.allowed-failures`` says. Then, after Ctrl-C, or when this process dies, what is done stays,
    and the same call goes on from there; with ``resume=False`` it starts anew.

    Returns the dict of :func:`brickwalk.convert` and ``phases``, seconds by name.

    Raises what :func:`brickwalk.convert` does; BrickwalkError too if the cluster fails or a model is damaged.
    """
    if scratch is not None:
        folder = os.path.abspath(os.fspath(scratch))
        if not os.path.isdir(folder):
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), folder)
        settings["scratch"] = folder
    names, target, settings = checked(inputs, out, progress, settings)
    # Workers have other working directories.
    names, target = [os.path.abspath(name) for name in names], os.path.abspath(target)
    if "within" in settings:
        settings["within"] = os.path.abspath(settings["within"])
    settings.setdefault("threads", 1)
    resume = settings.pop("resume", True)
    job = names, target, settings

    def perform(step: str, position: int, conversion: int, tasks: list[int]) -> Iterator[bool | None]:
        run = uuid.uuid4().hex[:8]
        futures = [
            client.submit(
                _task,
                job,
                step,
                position,
                conversion,
                task,
                key=f"brickwalk-{step}-{run}-{task}",
                pure=False,
                retries=RETRIES,
            )
            for task in tasks
        ]
        try:
            futures.reverse()
            while futures:
                while not _is_done(futures[-1]):
                    yield None
                # Not held any longer, or its worker's death would have it done again.
                futures.pop().release()
                yield True
        finally:
            client.cancel(futures)

    return convert_shared(names, target, {**settings, "resume": resume}, perform, progress)


def _is_done(future: Future) -> bool:
    """Whether a task is done, after a while. Raises its error."""
    try:
        wait([future], timeout=TICK)
        if future.status != "finished":
            future.result()
    except NotYet:
        return False
    except KilledWorker as error:
        raise brickwalk.BrickwalkError(
            f"task {error.task}: workers died with it more often than distributed.scheduler.allowed-failures; raise "
            "that, or give workers more memory"
        ) from None
    except Exception as error:
        if is_own_error(future):
            raise
        raise brickwalk.BrickwalkError(GONE) from error
    return True


def _task(job: tuple[list[str], str, dict[str, Any]], step: str, position: int, conversion: int, task: int) -> int:
    """Does a task in a worker, and returns its number: what it makes lies in the scratch folder."""
    names, target, settings = job
    key = (conversion, target)
    with _opening:
        worker = _opened.get(key)
        if worker is None:
            _opened.clear()
            worker = _opened[key] = ConversionWorker(names, target, settings)
    worker.perform(step, position, task)
    return task
