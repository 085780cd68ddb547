"""Cases on the machines of a Dask cluster, to which the FMUs are copied."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import get_ident
from typing import Any, final
from uuid import uuid4

from liaisons.base.arguments import shown
from liaisons.base.folders import temporary_folder
from liaisons.errors import SweepError
from liaisons_tools.sweeps.study import Failure, Outcomes, Study, failure_of
from liaisons_tools.sweeps.workers import Deliver, Pool

Client = Any
"""A ``distributed.Client``; the package is an extra."""

_PATIENCE = "10s"  # for a scheduler to answer
_CANCELLED = "the Dask cluster has cancelled the sweep; is its scheduler still there?"
_pools: dict[tuple[str, int], tuple[Pool, ExitStack]] = {}  # on a worker: sweep and thread -> process, and its folder


@final
@dataclass(frozen=True)
class _Unable:
    """Answer of a worker that cannot start, for instance because its disk is full."""

    worker: str
    reason: str


def simulate_on_cluster(
    study: Study, cases: Iterable[int], client: Client, deliver: Deliver, time_limit: float | None
) -> None:
    """Simulate cases on the workers of a cluster, with a process for each of their threads.

    Dask gives the cases of a worker that died to another one; a case over which several have died is a failure.
    Cases of a worker that cannot start are given to the others.

    :param client: a ``distributed.Client``.
    :param deliver: takes outcomes, in any order.
    :param time_limit: of a case [s].
    :raises SweepError: if the cluster goes away.
    """
    from dask import config

    key = uuid4().hex  # of this run
    # A task, not scattered data: when all workers die, it is done again, and the cases go on.
    with config.set({"distributed.admin.large-graph-warning-threshold": "1 TB"}):
        shipment = client.submit(_worker_payload, key, study, study.files(), pure=False)
    remaining = list(cases)
    size = max(1, min(256, len(remaining) // (8 * max(1, sum(client.nthreads().values())))))
    try:
        chunks = [remaining[i : i + size] for i in range(0, len(remaining), size)]
        _Sweep(client, (shipment, time_limit), deliver).run(chunks)
    finally:
        with suppress(Exception):  # a cluster that is gone has ended them by itself
            client.run(_close_pools, key)


@final
class _Sweep:
    """The futures of a sweep.

    :param task: first argument of :func:`_simulate_on_worker`.
    """

    def __init__(self, client: Client, task: tuple[Any, float | None], deliver: Deliver) -> None:
        from distributed import as_completed

        self._client, self._task, self._deliver = client, task, deliver
        self._chunks: dict[Any, list[int]] = {}  # future -> cases
        self._failed_workers: set[str] = set()
        self._finished = as_completed(loop=client.loop)  # else it takes that of the default client

    def run(self, chunks: Iterable[list[int]]) -> None:
        """Simulate all chunks of cases, and deliver their outcomes."""
        try:
            for cases in chunks:
                self._submit(cases)
            while self._chunks:
                future = next(self._finished)
                self._deliver_or_resubmit(future, self._chunks.pop(future))
        finally:
            self._client.cancel(list(self._chunks))

    def _deliver_or_resubmit(self, future: Any, cases: list[int]) -> None:
        """Deliver the outcomes of a finished future, or submit its cases again."""
        if future.status == "finished":
            try:
                answer: Outcomes | _Unable = future.result()
            except CancelledError:
                raise SweepError(_CANCELLED) from None
            if not isinstance(answer, _Unable):
                self._deliver(answer)
                return
            self._failed_workers.add(answer.worker)
            if self._usable_workers():
                self._submit(cases)
            else:
                reason = f"the Dask worker {answer.worker} cannot begin: {answer.reason}"
                self._deliver(dict.fromkeys(cases, Failure(reason, refused=False)))
        elif future.status == "cancelled":
            raise SweepError(_CANCELLED)
        elif len(cases) == 1 and future.status == "error":
            words = " ".join(str(future.exception()).split())
            self._deliver({cases[0]: Failure(f"Dask: {words}", refused=False)})
        else:  # one of several cases failed, or the result was lost with its worker
            for case in cases:
                self._submit([case])

    def _submit(self, cases: list[int]) -> None:
        """Submit cases to the workers that have not failed to start."""
        workers = self._usable_workers() if self._failed_workers else None  # others where all of these are lost
        options = {"workers": workers, "allow_other_workers": bool(workers), "pure": False}
        future = self._client.submit(_simulate_on_worker, self._task, cases, **options)
        self._chunks[future] = cases
        self._finished.add(future)

    def _usable_workers(self) -> list[str]:
        """Addresses of the workers that have not failed to start."""
        return [worker for worker in self._client.nthreads() if worker not in self._failed_workers]


@contextmanager
def connected_client(client: Client | str) -> Iterator[Client]:
    """Context of a client of the scheduler at an address; a client itself is yielded, and left open.

    :raises SweepError: if ``distributed`` is not installed, or no scheduler answers.
    """
    if not isinstance(client, str):
        if not hasattr(client, "scatter"):
            raise SweepError(f"client = {shown(client)}: give a distributed.Client or the address of its scheduler")
        yield client
        return
    if not client.strip():  # Dask would start workers here
        raise SweepError("no Dask scheduler has an empty address; give one, e.g. 'tcp://10.0.0.1:8786'")
    try:
        from distributed import Client as DaskClient
    except ImportError:
        raise SweepError("Dask is not installed; pip install 'liaisons[dask]'") from None
    try:
        opened = DaskClient(client, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise SweepError(
            f"no Dask scheduler answers at {client!r} ({reason}); start one with 'dask scheduler' and give its address"
        ) from None
    with opened:
        yield opened


def _worker_payload(*parts: Any) -> Any:
    """Key of a run, its study and its files: the result of a Dask task, which workers copy from each other."""
    return parts


def _simulate_on_worker(
    task: tuple[tuple[str, Study, Mapping[Path, bytes]], float | None], cases: Sequence[int]
) -> Outcomes | _Unable:
    """Outcomes of cases, simulated on a Dask worker in the process of this thread, which stays for the next cases."""
    (key, study, files), time_limit = task
    try:
        if (key, get_ident()) not in _pools:
            _start_pool(key, study, files, time_limit)
        pool, _ = _pools[key, get_ident()]
        outcomes: Outcomes = {}
        pool.run(cases, outcomes.update)
        return outcomes
    except Exception as error:  # noqa: BLE001 - whatever it is, another worker may do it
        from distributed import get_worker

        return _Unable(get_worker().address, failure_of(error).reason)


def _start_pool(key: str, study: Study, files: Mapping[Path, bytes], time_limit: float | None) -> None:
    """Write the files of a sweep on a Dask worker, and start the process of this thread."""
    from cloudpickle import dumps  # comes with Dask; functions of scripts go by value

    _close_pools(thread=get_ident())  # of a sweep that was lost
    with ExitStack() as stack:
        folder = stack.enter_context(temporary_folder())
        paths = {path: folder / f"{number}-{path.name}" for number, path in enumerate(files)}
        for path, content in files.items():
            paths[path].write_bytes(content)
        moved = study.with_fmu_paths(paths)
        pool = Pool(dumps((moved, moved.simulation.extract(folder), str(folder))), folder, 1, time_limit)
        stack.callback(pool.close, 0.0)  # the worker's own loop waits for it
        _pools[key, get_ident()] = pool, stack.pop_all()


def _close_pools(key: str = "", thread: int = 0) -> None:
    """End the processes of a sweep, or of a thread, on a Dask worker."""
    for owner in [owner for owner in _pools if key == owner[0] or thread == owner[1]]:
        _pools.pop(owner)[1].close()
