# SPDX-License-Identifier: Apache-2.0
"""Long answers: computed once in the background, asked for as often as the page likes."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Any

Progress = Callable[[float, str], None]


class Pending(Exception):
    """Not ready: how far it is and what it does."""

    def __init__(self, done: float, what: str) -> None:
        super().__init__(what)
        self.done, self.what = done, what


class _Job:
    def __init__(self) -> None:
        self.future: Future = Future()
        self.done, self.what = 0.0, "waiting for a free processor"


class Jobs:
    """Page answers run in the background; results that several answers need are kept by key.

    The least used results go when their arrays take more than ``limit`` bytes together."""

    def __init__(self, workers: int = 2, limit: int = 1 << 30) -> None:
        self._pool = ThreadPoolExecutor(workers, thread_name_prefix="driveid-job")
        self._jobs: dict[Hashable, _Job] = {}
        self._kept: OrderedDict[Hashable, Any] = OrderedDict()
        self._locks: dict[Hashable, threading.Lock] = {}
        self._lock = threading.Lock()
        self._limit = limit

    def run(self, key: Hashable, work: Callable[[Progress], Any], wait_s: float = 0.0) -> Any:
        """The result of the work; starts it if nobody did. Raises Pending where it is not ready, or what the work raised.

        A finished answer is handed out once and then forgotten: what is worth keeping, the work keeps itself."""
        with self._lock:
            job = self._jobs.get(key)
            if job is None:
                job = self._jobs[key] = _Job()
                self._pool.submit(self._run, job, work)
        if not job.future.done():
            wait([job.future], timeout=wait_s)
        if not job.future.done():
            raise Pending(job.done, job.what)
        with self._lock:
            self._jobs.pop(key, None)
        return job.future.result()

    @staticmethod
    def _run(job: _Job, work: Callable[[Progress], Any]) -> None:
        def progress(done: float, what: str) -> None:
            job.done, job.what = done, what

        job.what = "starting"
        try:
            job.future.set_result(work(progress))
        except BaseException as error:  # given to whoever asks
            job.future.set_exception(error)

    def once(self, key: Hashable, work: Callable[[], Any]) -> Any:
        """Kept result of this key; two who ask at the same time share one computation."""
        with self._lock:
            lock = self._locks.setdefault(key, threading.Lock())
        with lock:
            with self._lock:
                if key in self._kept:
                    self._kept.move_to_end(key)
                    return self._kept[key]
            result = work()
            with self._lock:
                self._kept[key] = result
                self._forget()
            return result

    def has(self, key: Hashable) -> bool:
        with self._lock:
            return key in self._kept

    def _forget(self) -> None:
        total = sum(size_of(r) for r in self._kept.values())
        for key in list(self._kept)[:-2]:
            if total <= self._limit:
                return
            size = size_of(self._kept[key])
            if size:
                del self._kept[key]
                total -= size

    def close(self) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)


def size_of(result: Any) -> int:
    """Bytes of the arrays that a result holds; everything else is small."""
    return int(getattr(result, "nbytes", 0) or 0)
