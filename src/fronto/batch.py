"""Many pieces of work over processes: in order, with flat memory, and none ends the others."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
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
                # The other workers finish what they are at: it is done again below.
                pool.shutdown(wait=True)
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


class _Worker:
    """A process of the pool: it ends between two jobs, so that each file is finished."""

    def __init__(self, make: Callable[[], Callable[[Any], Any]]) -> None:
        self._make = make
        self._work: Callable[[Any], Any] | None = None
        self._busy = threading.Lock()

    def do(self, job: Any) -> Any:
        """Make what does jobs, if that is still to be done, and do this one with it."""
        with self._busy:
            self._work = self._work or self._make()
            return self._work(job)

    def leave(self) -> None:
        """End the process as soon as it is idle."""
        with self._busy:
            os._exit(1)

    def leave_with_parent(self) -> None:
        """End the process when nobody is there any more to give it jobs."""
        parent = multiprocessing.parent_process()
        if parent is not None:
            parent.join()
            self.leave()


#: Of this process, if it is one.
_worker: list[_Worker] = []


def _begin(make: Callable[[], Callable[[Any], Any]]) -> None:
    worker = _Worker(make)
    _worker[:] = [worker]
    # The parent decides what an interrupt means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # So the pool ends the others when one of its processes has died.
    signal.signal(
        signal.SIGTERM, lambda *_: threading.Thread(target=worker.leave, daemon=True).start()
    )
    threading.Thread(target=worker.leave_with_parent, daemon=True).start()


def _do(job: Any) -> Any:
    return _worker[0].do(job)


def _submitted(pool: ProcessPoolExecutor, job: Job) -> Future[Any]:
    try:
        with _interrupts_held():
            return pool.submit(_do, job)
    except BrokenProcessPool as error:
        failed: Future[Any] = Future()
        failed.set_exception(error)
        return failed


@contextlib.contextmanager
def _interrupts_held() -> Iterator[None]:
    """Processes that are started inherit it: no interrupt reaches them before `_begin`."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _alone(job: Job, make: Callable[[], Callable[[Job], Result]]) -> Result | Crashed:
    with _pool(make, 1) as pool:
        try:
            result: Result = _submitted(pool, job).result()
        except BrokenProcessPool:
            return Crashed()
    return result
