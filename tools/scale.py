#!/usr/bin/env python3
"""How a walk over many machines scales: a bucket with latency and limits, and a simulation of workers that read from it.

    tools/scale.py serve FOLDER [--latency MS] [--bandwidth MB/s]         a web server with ranges, on this machine
    tools/scale.py simulate TRACE RECORDS [--workers N] [--chunk N] ...   time, bytes and requests of a walk
    tools/scale.py model                                                  the same from 10^9 to 10^12 triangles

TRACE is what `brickwalk walk --requests-out` wrote in a cache that holds all bricks, RECORDS the records.jsonl of the
same walk. docs/scale.md says what comes of it and what is assumed.
"""

import argparse
import heapq
import json
import sys
import threading
import time
from collections import OrderedDict, defaultdict
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

MB = 1e6


class Pipe:
    """Bytes in the order in which they are asked for, so many a second."""

    def __init__(self, rate):
        self.rate, self.free, self.lock = rate, 0.0, threading.Lock()

    def wait(self, count):
        with self.lock:
            self.free = max(self.free, time.monotonic()) + count / self.rate
            until = self.free
        time.sleep(max(0.0, until - time.monotonic()))


def serve(folder, port, latency, rate):
    """A web server with ranges and ETags, each answer of which waits and shares `rate` bytes a second."""
    pipe = Pipe(rate)

    class Answer(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def log_message(self, *_):
            pass

        def do_HEAD(self):
            self.answer(False)

        def do_GET(self):
            self.answer(True)

        def answer(self, has_body):
            time.sleep(latency)
            path = folder / self.path.lstrip("/")
            if not path.is_file():
                self.send_response(404)
                self.send_header("Content-Length", "0")
                return self.end_headers()
            state = path.stat()
            first, last, status = 0, state.st_size - 1, 200
            asked = self.headers.get("Range", "")
            if asked.startswith("bytes="):
                low, high = asked[6:].split("-")
                status = 206
                if low:
                    first, last = int(low), min(int(high or last), last)
                else:
                    first = max(0, state.st_size - int(high))
            self.send_response(status)
            self.send_header("ETag", f'"{state.st_mtime_ns}"')
            self.send_header("Accept-Ranges", "bytes")
            self.send_header("Content-Length", str(last - first + 1))
            if status == 206:
                self.send_header("Content-Range", f"bytes {first}-{last}/{state.st_size}")
            self.end_headers()
            if not has_body:
                return None
            with open(path, "rb") as file:
                file.seek(first)
                left = last - first + 1
                while left:
                    part = file.read(min(left, 1 << 16))
                    pipe.wait(len(part))
                    self.wfile.write(part)
                    left -= len(part)
            return None

    server = ThreadingHTTPServer(("127.0.0.1", port), Answer)
    print(f"http://127.0.0.1:{server.server_port}", flush=True)
    server.serve_forever()


def read_trace(path, packed):
    """Sizes by item, and by frame the passes: the items of each, and in how many batches they were loaded.

    Attributes are packed in the file: to a part `packed` of what the trace says.
    """
    with open(path) as lines:
        head = json.loads(next(lines))
        sizes = {}
        for number, (geometry, attributes) in enumerate(head["sizes"]):
            sizes[f"g{number}"], sizes[f"a{number}"] = geometry, attributes * packed
        sizes.update({f"t{number}": size for number, size in enumerate(head["tiles"])})
        frames = defaultdict(list)
        for line in lines:
            row = json.loads(line)
            frames[row["frame"]].append((row["pass"], row["requests"], len(row["batches"])))
    return sizes, [frames[number] for number in sorted(frames)]


def read_seconds(path):
    """By frame the seconds of rendering without loading."""
    seconds = defaultdict(float)
    with open(path) as lines:
        for line in lines:
            row = json.loads(line)
            seconds[row["frame"]] += (row["ms"] - row["ms_stream"]) / 1e3
    return [seconds[number] for number in sorted(seconds)]


class Cache:
    """What a worker has: the least recently used goes first."""

    def __init__(self, size, sizes):
        self.size, self.sizes, self.held, self.used = size, sizes, OrderedDict(), 0

    def missing(self, items):
        """Bytes and number of those that are not there; they are, then."""
        count = amount = 0
        for item in items:
            if item in self.held:
                self.held.move_to_end(item)
                continue
            own = self.sizes[item]
            count, amount = count + 1, amount + own
            self.held[item] = own
            self.used += own
            while self.used > self.size:
                _, gone = self.held.popitem(last=False)
                self.used -= gone
        return amount, count


def batches(frames, tasks, cache, opened):
    """What a worker does with its tasks, lists of frames: (seconds of rendering, bytes, requests) after each other.

    A frame that follows the one before loads in as many batches as the recorded walk; the first of a worker in as many
    as the walk's first. `opened`: the batches of opening the scene.
    """
    steps, before, is_open = list(opened), None, False
    for task in tasks:
        for number in task:
            for place, (_, items, count) in enumerate(frames[number][0]):
                amount, loads = cache.missing(items)
                if not is_open or before is None or number != before + 1:
                    first = frames[0][0]
                    count = max(count, first[place][2] if place < len(first) else count)
                count = max(1, count)
                if amount:
                    steps += [(0.0, amount / count, max(1.0, loads / count))] * count
            steps.append((frames[number][1], 0.0, 0.0))
            before, is_open = number, True
    return steps


def simulate(steps, network):
    """Seconds until all workers have done their steps: (wall, seconds of waiting by worker, bytes, requests).

    A batch waits a latency, then shares the store's bandwidth with those of other workers, up to the worker's own.
    `network`: latency, bandwidth of a worker, bandwidth and requests a second of the store.
    """
    latency, own, store, requests_rate = network
    now, flowing, events = 0.0, {}, []
    waiting, position, began = [0.0] * len(steps), [0] * len(steps), {}
    total_bytes = total_requests = free = 0.0

    def start(worker):
        nonlocal free, total_bytes, total_requests
        at = position[worker]
        if at == len(steps[worker]):
            return
        position[worker] += 1
        seconds, amount, requests = steps[worker][at]
        if not amount:
            heapq.heappush(events, (now + seconds, worker, 0.0))
            return
        total_bytes, total_requests = total_bytes + amount, total_requests + requests
        free = max(free, now) + requests / requests_rate
        began[worker] = now
        heapq.heappush(events, (free + latency, worker, amount))

    for worker in range(len(steps)):
        start(worker)
    while events or flowing:
        rate = min(own, store / len(flowing)) if flowing else own
        ends = min(flowing.items(), key=lambda pair: pair[1]) if flowing else None
        until = now + ends[1] / rate if ends else float("inf")
        if events and events[0][0] <= until:
            then, worker, amount = heapq.heappop(events)
        else:
            then, worker, amount = until, ends[0], None
        for other in flowing:
            flowing[other] -= (then - now) * rate
        now = then
        if amount is None:
            del flowing[worker]
            waiting[worker] += now - began[worker]
            start(worker)
        elif amount:
            flowing[worker] = amount
        else:
            start(worker)
    return now, waiting, total_bytes, total_requests


def split(count, workers, chunk):
    """Frames by worker, as brickwalk-cluster begins: each has a stretch of the path, in tasks."""
    tasks = [list(range(first, min(first + chunk, count))) for first in range(0, count, chunk)]
    stretch = -(-len(tasks) // workers)
    return [tasks[first : first + stretch] for first in range(0, len(tasks), stretch)]


def show(name, workers, done, frames, network, cost):
    wall, waiting, amount, requests = done
    latency, own, store, _ = network
    dollars = requests / 1e3 * cost[0] + amount / 1e9 * cost[1]
    print(
        f"| {name} | {workers} | {wall:.1f} | {sum(waiting):.1f} | {amount / MB:.1f} | {requests:.0f} | "
        f"{amount / MB / frames:.2f} | {dollars:.4f} |"
    )


HEAD = """\
| what | workers | wall, s | waiting of all workers, s | MB | requests | MB a frame | dollars |
| --- | --- | --- | --- | --- | --- | --- | --- |"""


def network_of(options):
    return options.latency / 1e3, options.bandwidth * MB, options.store * MB, options.requests


def simulated(options):
    sizes, passes = read_trace(options.trace, options.packed)
    seconds = read_seconds(options.records)
    frames = list(zip(passes, seconds, strict=True))
    print(HEAD)
    for workers in options.workers:
        tasks = split(len(frames), workers, options.chunk)
        opened = [(0.0, options.resident * MB, 2.0)]
        scale = max(1.0, len(tasks) / options.cores)
        slow = [(one, own * scale) for one, own in frames]
        steps = [batches(slow, own, Cache(options.cache * MB, sizes), opened) for own in tasks]
        done = simulate(steps, network_of(options))
        show(Path(options.trace).name, len(tasks), done, len(frames), network_of(options), options.cost)


#: Of cities with levels of detail, seen from far away at tau 1: bytes of a cold frame (docs/results/levels.md).
COLD = [(12e6, 35.4 * MB), (139e6, 45.4 * MB)]
#: A later frame, bytes; batches of a cold and of a later frame; bytes of the resident part a triangle.
LATER, ROUNDS, RESIDENT = 1.04 * MB, (21, 3), 0.135


def model(options):
    """Walks of `frames` frames of scenes from 10^9 to 10^12 triangles over 10 to 1000 workers."""
    import math

    (few, low), (many, high) = COLD
    slope = (high - low) / math.log10(many / few)
    print(HEAD)
    for power in (9, 10, 11, 12):
        cold = high + slope * (power - math.log10(many))
        resident = RESIDENT * 10**power
        for workers in options.workers:
            frames = options.frames // workers
            first = [(0.0, cold / ROUNDS[0], 4.0)] * ROUNDS[0]
            later = [(0.0, LATER / ROUNDS[1], 2.0)] * ROUNDS[1]
            render = [(options.seconds, 0.0, 0.0)]
            steps = [(0.0, resident, 2.0), *first, *render, *((later + render) * (frames - 1))]
            done = simulate([steps] * workers, network_of(options))
            show(f"10^{power}", workers, done, frames * workers, network_of(options), options.cost)


def main():
    top = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    commands = top.add_subparsers(dest="command", required=True)
    one = commands.add_parser("serve")
    one.add_argument("folder", type=Path)
    one.add_argument("--port", type=int, default=0)
    one.add_argument("--latency", type=float, default=50.0, help="of an answer, ms [default: 50]")
    one.add_argument("--bandwidth", type=float, default=20.0, help="of all answers together, MB/s [default: 20]")
    for name in ("simulate", "model"):
        one = commands.add_parser(name)
        one.add_argument("--workers", type=int, nargs="+", default=[1, 2, 4] if name == "simulate" else [10, 100, 1000])
        one.add_argument("--latency", type=float, default=50.0, help="ms [default: 50]")
        one.add_argument("--bandwidth", type=float, default=20.0, help="of a worker, MB/s")
        one.add_argument("--store", type=float, default=20.0, help="of all workers together, MB/s")
        one.add_argument("--requests", type=float, default=5500.0, help="of all workers together, a second")
        one.add_argument("--cost", type=float, nargs=2, default=[0.0004, 0.09], help="dollars of 1000 requests, a GB")
        if name == "simulate":
            one.add_argument("trace", type=Path)
            one.add_argument("records", type=Path)
            one.add_argument("--chunk", type=int, default=4, help="frames of a task [default: 4]")
            one.add_argument("--packed", type=float, default=0.22, help="of attributes: bytes in the file over loaded")
            one.add_argument("--cache", type=float, default=1e6, help="of a worker, MB")
            one.add_argument("--resident", type=float, default=1.0, help="bytes of opening the scene, MB")
            one.add_argument("--cores", type=float, default=2.0, help="workers that have a core to themselves")
        else:
            one.add_argument("--frames", type=int, default=10_000)
            one.add_argument("--seconds", type=float, default=1.0, help="of rendering a frame")
    options = top.parse_args()
    if options.command == "serve":
        try:
            serve(options.folder, options.port, options.latency / 1e3, options.bandwidth * MB)
        except KeyboardInterrupt:
            sys.exit(0)
    elif options.command == "simulate":
        simulated(options)
    else:
        model(options)


if __name__ == "__main__":
    main()
