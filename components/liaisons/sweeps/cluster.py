"""Cases on the machines of a Dask cluster; the FMUs travel with them."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from liaisons.sweeps.errors import SweepError
from liaisons.sweeps.outcome import Failure, Outcome
from liaisons.sweeps.plan import Plan
from liaisons.sweeps.session import Session, extract_all
from liaisons.sweeps.workers import Deliver

Client = Any
"""A ``distributed.Client``; the package is an extra."""

_PATIENCE = "10s"  # for a scheduler to answer
_here = threading.local()  # of a worker: its session and what that was made for


def simulate(
    plan: Plan, cases: Iterable[int], client: Client, deliver: Deliver, *, time_limit: float | None = None
) -> None:
    """Simulate cases on the workers of a cluster.

    What a worker had when it died, Dask gives to another one; a case over which several have died is a failure.

    :param client: a ``distributed.Client``.
    :param deliver: takes what is finished, in whatever order.
    :raises SweepError: if the cluster goes away.
    """
    from distributed import as_completed

    if time_limit is not None:
        raise SweepError("time_limit is for processes of this machine; leave it out on a Dask cluster")
    shipment = client.scatter((plan.key(), plan, plan.files()), broadcast=True, hash=False)
    remaining = list(cases)
    size = max(1, min(256, len(remaining) // (8 * max(1, sum(client.nthreads().values())))))
    chunks = {}
    for chunk in _chunks(remaining, size):
        chunks[client.submit(_simulate, shipment, chunk, pure=False)] = chunk
    finished = as_completed(list(chunks), loop=client.loop)  # its own choice is that of the default client, not ours
    try:
        for future in finished:
            chunk = chunks.pop(future)
            if future.status == "finished":
                deliver(future.result())
            elif future.status == "cancelled":
                raise SweepError("the Dask cluster has cancelled the sweep; is its scheduler still there?")
            elif len(chunk) == 1 and future.status == "error":
                deliver({chunk[0]: Failure(f"Dask: {future.exception()}", refused=False)})
            else:  # several cases, one of which is to blame, or a result that was lost with its worker
                for case in chunk:
                    again = client.submit(_simulate, shipment, [case], pure=False)
                    chunks[again] = [case]
                    finished.add(again)
    finally:
        client.cancel(list(chunks))


@contextmanager
def connected(client: Client | str) -> Iterator[Client]:
    """A client of the scheduler at an address; a client itself is handed on, and left open.

    :raises SweepError: if ``distributed`` is not installed, or nobody answers.
    """
    if not isinstance(client, str):
        if not hasattr(client, "scatter"):
            raise SweepError(f"client = {client!r}; give a distributed.Client, or the address of a scheduler")
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


def _chunks(cases: Sequence[int], size: int) -> Iterator[list[int]]:
    rest = iter(cases)
    while chunk := list(islice(rest, size)):
        yield chunk


def _simulate(shipment: tuple[str, Plan, Mapping[Path, bytes]], cases: Sequence[int]) -> dict[int, Outcome]:
    """On a worker: the session of its thread is kept for the next cases of the same sweep."""
    key, plan, files = shipment
    if getattr(_here, "key", None) != key:
        with ExitStack() as stack:
            if hasattr(_here, "stack"):
                _here.stack.close()
            folder = Path(stack.enter_context(TemporaryDirectory(prefix="liaisons-", ignore_cleanup_errors=True)))
            here = {path: folder / f"{number}-{path.name}" for number, path in enumerate(files)}
            for path, content in files.items():
                here[path].write_bytes(content)
            moved = plan.moved(here)
            _here.session = stack.enter_context(Session(moved, extract_all(moved, folder)))
            _here.stack, _here.key = stack.pop_all(), key
    return {case: _here.session.outcome(case) for case in cases}
