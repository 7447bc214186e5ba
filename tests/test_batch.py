"""Work over processes: order, flat memory, processes that die, interrupts, nothing left behind."""

from __future__ import annotations

import itertools
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from fronto.batch import AHEAD, Crashed, in_order

posix_only = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX systems")


@pytest.fixture(autouse=True)
def interruptible() -> Iterator[None]:
    """Let Ctrl-C arrive also where the tests run in a shell's background, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


#: Processes are spawned: they import what they do.
WORK = '''
import os, signal, time
from pathlib import Path

def make():
    return work

def make_nothing():
    raise ZeroDivisionError("no work")

def make_costly(folder):
    (Path(folder) / f"made-{os.getpid()}-{time.monotonic_ns()}").touch()
    return work

def appears(path):
    end = time.monotonic() + 60
    while not path.exists():
        if time.monotonic() > end:
            raise TimeoutError(path)
        time.sleep(0.005)

def work(job):
    kind, *rest = job
    return globals()[kind](*rest)

def give(value):
    return value

def pid():
    return os.getpid()

def fail():
    raise ZeroDivisionError("of the work")

def after(path, value):
    appears(path)
    return value

def touch(path, value):
    path.touch()
    return value

def leave():
    os._exit(9)

def killed():
    os.kill(os.getpid(), signal.SIGKILL)

def killed_once(path, value):
    if not path.exists():
        path.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return value

def killed_after(path):
    appears(path)
    os.kill(os.getpid(), signal.SIGKILL)

def write(path, seconds):
    """As fronto writes: half a file under another name, the rest after a while, renamed."""
    part = path.with_name(f".{os.getpid()}-{path.name}.part")
    try:
        with part.open("xb") as file:
            file.write(b"half ")
            file.flush()
            path.with_name(f"begun-{path.name}").touch()
            time.sleep(seconds)
            file.write(b"whole")
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    return path.name
'''


@pytest.fixture(scope="module")
def jobs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ModuleType]:
    folder = tmp_path_factory.mktemp("modules")
    (folder / "fronto_batch_jobs.py").write_text(WORK, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))  # spawned processes get it, too
        module = __import__("fronto_batch_jobs")
        yield module
    del sys.modules["fronto_batch_jobs"]


def none_left() -> bool:
    return not multiprocessing.active_children()


# --- order and memory


def test_results_come_in_order_though_the_first_takes_longest(
    jobs: ModuleType, tmp_path: Path
) -> None:
    # The first job ends after the fourth one has: another process has done that meanwhile.
    flag = tmp_path / "flag"
    work = [("after", flag, 0), ("give", 1), ("give", 2), ("touch", flag, 3), ("give", 4)]
    done = list(in_order(work, jobs.make, 2))
    assert done == [(job, k) for k, job in enumerate(work)]
    assert none_left()


def test_one_process_is_this_one(jobs: ModuleType) -> None:
    taken = 0

    def endless() -> Iterator[tuple[str]]:
        nonlocal taken
        while True:
            taken += 1
            yield ("pid",)

    for k, (_, pid) in enumerate(itertools.islice(in_order(endless(), jobs.make, 1), 5), 1):
        assert pid == os.getpid()
        assert taken == k
    with pytest.raises(ZeroDivisionError):
        list(in_order([("give", 1), ("fail",)], jobs.make, 1))


def test_an_endless_generator_is_not_run_far_ahead(jobs: ModuleType) -> None:
    taken, most = 0, 0

    def endless() -> Iterator[tuple[str, int]]:
        nonlocal taken
        for k in itertools.count():
            taken += 1
            yield "give", k

    results = in_order(endless(), jobs.make, 2)
    for k, (_, result) in enumerate(itertools.islice(results, 60)):
        assert result == k
        # What was handed out and has not come back to the consumer.
        most = max(most, taken - k)
        if k == 10:
            # However long the consumer takes.
            before = taken
            time.sleep(0.2)
            assert taken == before
    assert 2 < most <= AHEAD * 2
    results.close()
    assert none_left()


def test_work_is_made_once_a_process(jobs: ModuleType, tmp_path: Path) -> None:
    from functools import partial

    done = list(in_order([("give", k) for k in range(12)], partial(jobs.make_costly, tmp_path), 2))
    assert [result for _, result in done] == list(range(12))
    assert 1 <= len(list(tmp_path.glob("made-*"))) <= 2


# --- processes that die


@pytest.mark.parametrize("kind", ["leave", pytest.param("killed", marks=posix_only)])
def test_a_job_that_ends_its_process_costs_itself_only(jobs: ModuleType, kind: str) -> None:
    work = [("give", 0), ("give", 1), (kind,), *(("give", k) for k in range(3, 14))]
    work += [("pid",)] * 12
    results = [result for _, result in in_order(work, jobs.make, 2)]
    assert results[:14] == [0, 1, Crashed(), *range(3, 14)]
    # What comes after is done as before, by two processes.
    assert len(set(results[14:])) <= 2
    assert none_left()


def test_two_of_them_in_a_row_and_the_last_job(jobs: ModuleType) -> None:
    work = [("leave",), ("leave",), *[("pid",)] * 5, ("leave",)]
    done = list(in_order(work, jobs.make, 2))
    assert [job for job, _ in done] == work
    results = [result for _, result in done]
    assert results[:2] == results[-1:] * 2 == [Crashed()] * 2
    # The others are not done one by one, each in a process of its own.
    assert len(set(results[2:-1])) <= 4
    assert none_left()


@posix_only
def test_a_job_that_can_be_done_alone_is(jobs: ModuleType, tmp_path: Path) -> None:
    # As when two large photos at a time are too much for the memory.
    work = [("give", 0), ("killed_once", tmp_path / "tried", 1), ("give", 2)]
    assert [result for _, result in in_order(work, jobs.make, 2)] == [0, 1, 2]


@posix_only
def test_other_jobs_under_way_finish_their_files(jobs: ModuleType, tmp_path: Path) -> None:
    path = tmp_path / "slow"
    work = [("write", path, 1.0), ("killed_after", tmp_path / "begun-slow"), ("give", 2)]
    assert [result for _, result in in_order(work, jobs.make, 2)] == ["slow", Crashed(), 2]
    assert path.read_bytes() == b"half whole"
    assert list(tmp_path.glob(".*")) == []


@posix_only
def test_processes_do_not_outlive_a_killed_parent(jobs: ModuleType, tmp_path: Path) -> None:
    script = tmp_path / "parent.py"
    script.write_text(
        "import sys, time\n"
        f"sys.path[:0] = {[str(Path(jobs.__file__).parent), *sys.path]!r}\n"
        "import fronto_batch_jobs\n"
        "from fronto.batch import in_order\n"
        "if __name__ == '__main__':\n"
        "    for done in in_order([('give', k) for k in range(20)], fronto_batch_jobs.make, 2):\n"
        "        print('result', flush=True)\n"
        "        time.sleep(60)\n",
        encoding="utf-8",
    )
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        assert parent.stdout.readline() == b"result\n"
        parent.kill()
        # The pipe ends when all that have inherited it are gone.
        parent.communicate(timeout=30)


# --- exceptions and interrupts


@pytest.mark.parametrize("make", ["make", "make_nothing"])
def test_an_exception_ends_the_batch_and_all_processes(jobs: ModuleType, make: str) -> None:
    work = [("give", 0), ("fail",), *(("give", k) for k in range(20))]
    results = []
    with pytest.raises(ZeroDivisionError):
        results.extend(result for _, result in in_order(work, getattr(jobs, make), 2))
    assert none_left()


def interrupted(
    jobs: ModuleType, folder: Path, interrupt: Callable[[], None], count: int = 40
) -> list[str]:
    """Run jobs that write; interrupt when the second is at it. Return what was written."""

    def consume() -> None:
        work: list[tuple[Any, ...]] = [("give", 0)]
        work += [("write", folder / f"{k}", 0.6) for k in range(count)]
        for _, result in in_order(work, jobs.make, 2):
            if result == 0:
                jobs.appears(folder / "begun-0")
                interrupt()

    with pytest.raises(KeyboardInterrupt):
        consume()
    assert none_left()
    assert list(folder.glob(".*")) == []
    written = [path for path in folder.iterdir() if path.name.isdecimal()]
    assert {path.read_bytes() for path in written} == {b"half whole"}
    return [path.name for path in written]


def test_an_interrupt_of_the_consumer(jobs: ModuleType, tmp_path: Path) -> None:
    def interrupt() -> None:
        raise KeyboardInterrupt

    written = interrupted(jobs, tmp_path, interrupt)
    # What was begun is finished, the rest dropped.
    begun = {path.name.removeprefix("begun-") for path in tmp_path.glob("begun-*")}
    assert set(written) == begun >= {"0"}
    # Fewer than what was handed out.
    assert len(written) < AHEAD * 2 - 1


@posix_only
def test_an_interrupt_from_the_terminal(jobs: ModuleType, tmp_path: Path) -> None:
    # Ctrl-C reaches all processes, while the parent waits for a result.
    def interrupt() -> None:
        def all_processes() -> None:
            for child in multiprocessing.active_children():
                assert child.pid is not None
                os.kill(child.pid, signal.SIGINT)
            os.kill(os.getpid(), signal.SIGINT)

        threading.Timer(0.1, all_processes).start()

    written = interrupted(jobs, tmp_path, interrupt)
    assert "0" in written
    assert len(written) < AHEAD * 2 - 1


@posix_only
def test_an_interrupt_while_processes_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Importing takes a while, and a process that does so dies of an interrupt.
    text = (
        "import multiprocessing, os, signal\n"
        "if multiprocessing.current_process().name != 'MainProcess':\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
        "def make():\n"
        "    return str\n"
    )
    (tmp_path / "fronto_batch_interrupted.py").write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    module = __import__("fronto_batch_interrupted")
    assert list(in_order([1, 2], module.make, 2)) == [(1, "1"), (2, "2")]
