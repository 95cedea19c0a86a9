"""Work in items on a Ray cluster, of this machine or of several that share their folders."""

import logging
import pickle
import socket
from collections.abc import Iterable, Iterator
from functools import partial
from itertools import islice
from typing import Any

from geneoh.errors import ConfigError, GeneOHError
from geneoh.workers.pool import (
    TRIES,
    Do,
    Item,
    Lost,
    Result,
    answered,
    unpacked,
    use_one_thread,
)

ANSWER = 10.0
"""Seconds in which a cluster must answer."""
WAITING = 1000
"""Items that the cluster knows of at a time."""


def on_cluster(
    work: Iterable[Item], do: Do[Item, Result], *, address: str, lost: Lost[Item, Result]
) -> Iterator[Result]:
    """The results as they are made, as `results_of`; an item that loses its node is tried again.

    Args:
        work: the items.
        do: a function of one item that can be imported on every node.
        address: of the cluster, as Ray takes it; "local" starts one on this machine.
        lost: gives the result of an item whose workers were lost.

    Raises:
        ConfigError: Ray is not installed, or no cluster answers.
        GeneOHError: a node cannot import what it needs.
    """
    ray = connected(address)
    task = ray.remote(num_cpus=1, max_retries=TRIES - 1)(answered_alone).remote
    fresh, running = iter(work), dict[Any, Item]()
    try:
        while True:
            for item in islice(fresh, WAITING - len(running)):
                running[task(do, item)] = item
            if not running:
                return
            (done,), _ = ray.wait(list(running), num_returns=1)
            yield result_of(ray, done, partial(lost, running.pop(done)))
    finally:
        for reference in running:
            ray.cancel(reference, force=True)
        ray.shutdown()


def connected(address: str) -> Any:
    """The module ray, connected to a cluster."""
    try:
        import ray  # pyright: ignore[reportMissingImports]  # the extra cluster
    except ImportError:
        raise ConfigError(
            "--ray needs Ray, which is not installed; run pip install 'geneoh[cluster]', "
            "or leave --ray out to use this machine's cores"
        ) from None
    host, _, port = address.rpartition("://")[2].rpartition(":")
    try:
        if port.isdecimal():  # Ray itself would try for minutes, and then end this process
            socket.create_connection((host, int(port)), ANSWER).close()
        ray.init(address=address, log_to_driver=False, logging_level=logging.ERROR)
    except (OSError, OverflowError, ValueError, RuntimeError) as error:
        said = " ".join(str(error).split())[:200]
        raise ConfigError(
            f"--ray {address}: no cluster answers ({said}); start one with `ray start --head`, "
            "or pass --ray local"
        ) from None
    return ray


def answered_alone(do: Do[Item, Any], item: Item) -> bytes:
    """As `answered`, with one thread."""
    use_one_thread()
    return answered(do, item)


def result_of(ray: Any, reference: Any, lost: Any) -> Any:
    """The result behind a reference; that of `lost` where its workers died."""
    try:
        return unpacked(pickle.loads(ray.get(reference)))
    except ray.exceptions.RayTaskError as error:  # raised outside of `answered`
        said = str(error).strip().splitlines()[-1]
        raise GeneOHError(
            f"a node of the cluster cannot do the work ({said}); install the same geneoh on each"
        ) from error
    except ray.exceptions.RayError as error:
        why = " ".join(str(error).split())[:200]
        return lost(f"the workers that began it were lost, {TRIES} times ({why})")
