"""Who does the parts of a sweep: this process, or those of a cluster."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager
from typing import Any

from pcjax.simulate.outcomes import Outcomes
from pcjax.sweep.plan import Part

PATIENCE = 20.0
"""Seconds to wait for a scheduler to answer."""


@contextmanager
def bench(scheduler: str | None) -> Iterator[Any]:
    """Gives a function from parts to (part, outcomes), in whatever order they are done."""
    if scheduler is None:
        yield lambda parts: ((part, part.run()) for part in parts)
        return
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise ValueError(
            "a scheduler needs the package distributed: pip install 'pcjax[cluster]'"
        ) from None
    with ExitStack() as stack:
        stack.enter_context(_silent("distributed", "tornado", "asyncio"))
        if scheduler == "local":
            cluster = stack.enter_context(
                LocalCluster(
                    threads_per_worker=1,
                    dashboard_address=None,  # pyright: ignore[reportArgumentType]  # none at all
                )
            )
            client = Client(cluster)
        else:
            try:
                client = Client(scheduler, timeout=PATIENCE)
            except (OSError, ValueError) as error:
                raise ValueError(f"no scheduler answers at {scheduler}: {error}") from None
        stack.enter_context(client)
        yield lambda parts: _through(client, parts)


@contextmanager
def _silent(*names: str) -> Iterator[None]:
    """Keeps loggers, and all below them, quiet about what is told in a line of our own."""
    known = [name for name in logging.root.manager.loggerDict if name.split(".")[0] in names]
    loggers = [logging.getLogger(name) for name in known]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def _through(client: Any, parts: Sequence[Part]) -> Iterator[tuple[Part, Outcomes]]:
    """Runs parts on a cluster; those of a worker that dies are run again by another."""
    from distributed import KilledWorker, as_completed

    by_key = {f"pcjax-{part.name}": part for part in parts}
    futures = [client.submit(_remote, part, key=key, pure=False) for key, part in by_key.items()]
    for future in as_completed(futures):
        try:
            outcomes = future.result()
        except (KilledWorker, CancelledError, OSError) as error:
            raise ValueError(
                f"the cluster has given up ({str(error).splitlines()[0]}); what was done is kept, "
                "and the same command goes on from there"
            ) from None
        yield by_key[future.key], outcomes
        future.release()


def _remote(part: Part) -> Outcomes:
    return part.run(workers=1)
