"""Many pieces of work over processes: in order, with flat memory, and none ends the others."""

from __future__ import annotations

import multiprocessing
import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from itertools import islice
from typing import Any, TypeVar

__all__ = ["Crashed", "in_order"]

Job = TypeVar("Job")
Result = TypeVar("Result")

#: Jobs handed out ahead of the one that is waited for, per process.
AHEAD = 4
#: What a worker process works with, made once in it.
_work: list[Callable[[Any], Any]] = []


@dataclass(frozen=True)
class Crashed:
    """Stands for the result of a job whose process was ended, by the system mostly."""


def in_order(
    jobs: Iterable[Job], make: Callable[[], Callable[[Job], Result]], processes: int = 1
) -> Iterator[tuple[Job, Result | Crashed]]:
    """Do jobs in this process or in several; give the results in their order.

    Only a few jobs per process are under way at a time, so memory does not grow with their
    number. A process that dies costs only the job that it dies of. On an interrupt (Ctrl-C)
    the jobs under way are finished, the others dropped.

    Parameters
    ----------
    jobs
        May be endless.
    make
        Called once in each process, picklable where there are several: gives what does a job.
        An exception of the work ends the batch: what may go wrong with a job is to be part of
        its result.
    processes
        1: in this process.

    Yields
    ------
    Each job, and its result or `Crashed`.
    """
    if processes == 1:
        work = make()
        for job in jobs:
            yield job, work(job)
        return
    waiting = iter(jobs)
    pool = _pool(make, processes)
    under_way: deque[tuple[Job, Future[Result]]] = deque()
    suspects: deque[Job] = deque()
    try:
        while True:
            if suspects:
                # Which job broke the pool is not told: one after the other, until it does again.
                job = suspects.popleft()
                alone = _alone(job, make)
                yield job, alone
                if isinstance(alone, Crashed):
                    under_way.extend((other, _submitted(pool, other)) for other in suspects)
                    suspects.clear()
                continue
            for job in islice(waiting, max(0, AHEAD * processes - len(under_way))):
                under_way.append((job, _submitted(pool, job)))
            if not under_way:
                return
            job, future = under_way.popleft()
            try:
                result = future.result()
            except BrokenProcessPool:
                pool.shutdown(wait=False)
                pool = _pool(make, processes)
                suspects.extend([job, *(other for other, _ in under_way)])
                under_way.clear()
                continue
            yield job, result
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _pool(make: Callable[[], Any], processes: int) -> ProcessPoolExecutor:
    # Forked while threads run (OpenCV's, ONNX Runtime's), a process may wait for ever.
    spawn = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(processes, mp_context=spawn, initializer=_begin, initargs=(make,))


def _begin(make: Callable[[], Callable[[Any], Any]]) -> None:
    # The parent decides what an interrupt means; each file is to be finished.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _work[:] = [make()]


def _do(job: Any) -> Any:
    return _work[0](job)


def _submitted(pool: ProcessPoolExecutor, job: Job) -> Future[Any]:
    try:
        return pool.submit(_do, job)
    except BrokenProcessPool as error:
        failed: Future[Any] = Future()
        failed.set_exception(error)
        return failed


def _alone(job: Job, make: Callable[[], Callable[[Job], Result]]) -> Result | Crashed:
    with _pool(make, 1) as pool:
        try:
            result: Result = _submitted(pool, job).result()
        except BrokenProcessPool:
            return Crashed()
    return result
