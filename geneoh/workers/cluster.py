"""Independent work items on a Ray cluster of one machine, or of several with shared folders.

A separate client process talks to Ray, because Ray ends the process that is connected to it when
the head node is lost, after a minute and without an error. The client notices the loss earlier.
"""

import logging
import os
import pickle
import socket
import threading
from collections.abc import Generator, Iterable, Iterator
from contextlib import closing, suppress
from importlib import import_module
from importlib.util import find_spec
from itertools import islice
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

from geneoh.errors import ConfigError, GeneOHError
from geneoh.workers.pool import (
    CLEANUP_SECONDS,
    TRIES,
    Do,
    Item,
    Lost,
    Result,
    answered,
    end,
    obey_parent,
    started,
    unpacked,
    use_one_thread,
)

ANSWER_SECONDS = 10.0  # timeout in seconds of a connection to the head node
RENEWAL_SECONDS = 30.0
"""Seconds after which the connection to the head is renewed, before the head itself closes it."""
JOIN_SECONDS = 60.0  # timeout in seconds of joining an existing cluster
MOST_SUBMITTED = 1000  # largest number of items submitted to Ray at a time
HEAD_LOST = 3  # exit code of the client process when the head node is lost


def on_cluster(
    work: Iterable[Item], do: Do[Item, Result], *, address: str, lost: Lost[Item, Result]
) -> Iterator[Result]:
    """Yield results as they finish, like `results_of`; an item whose node is lost is tried again.

    `do` must be importable on every node. `address` is an address for `ray.init`; "local" starts
    a cluster on this machine.

    Raises:
        ConfigError: Ray is not installed, or no cluster answers.
        GeneOHError: a node cannot import what it needs, or the head of the cluster was lost.
    """
    if find_spec("ray") is None:
        raise ConfigError(
            "--ray needs Ray, which is not installed; run pip install 'geneoh[cluster]', "
            "or leave --ray out to use this machine's cores"
        )
    items, crew = list(work), list[BaseProcess]()
    packed = [pickle.dumps(item) for item in items]  # so that only the nodes unpickle the items
    try:
        process, pipe = started(crew, _serve, address, pickle.dumps(do), packed)
        while (message := next_message(process, pipe, address)) is not None:
            number, answer = message
            if isinstance(answer, str):
                yield lost(items[number], answer)
            else:
                yield unpacked(pickle.loads(answer))
        process.join(CLEANUP_SECONDS)
    finally:
        end(crew)


def next_message(
    process: BaseProcess, pipe: Connection, address: str
) -> tuple[int, bytes | str] | None:
    """Index and pickled answer of the next item, or the reason why it failed; None at the end."""
    try:
        message = pipe.recv()
    except (EOFError, OSError):  # the client died, perhaps in the middle of a message
        process.join(CLEANUP_SECONDS)
        code = process.exitcode
        if code == HEAD_LOST:
            why = "the head of the cluster was lost; start one again with `ray start --head`, and"
        else:
            why = f"the process that speaks with Ray ended with exit code {code};"
        raise GeneOHError(
            f"--ray {address}: {why} run the same again for what is left: what is done is kept"
        ) from None
    if isinstance(message, Exception):
        raise message
    return message


def _serve(pipe: Connection, address: str, do: bytes, items: list[bytes]) -> None:
    """Main function of the client process: send all answers and errors through the pipe."""
    obey_parent()
    be_silent()
    ray, code = import_module("ray"), 0
    try:
        late = threading.Timer(JOIN_SECONDS, give_up, (pipe, address))
        if address != "local":
            late.start()
        head = connect_to_cluster(ray, address)
        late.cancel()
        with closing(answers(ray, head, do, items)) as found:
            for message in found:
                pipe.send(message)
        pipe.send(None)
    except GeneOHError as error:
        pipe.send(error)
    except OSError:  # from `ask` or from Ray
        code = HEAD_LOST
    except Exception as error:
        pipe.send(RuntimeError(f"{type(error).__name__}: {error}"))
    finally:
        os._exit(code)  # because Ray's exit handlers would wait for a lost head


def be_silent() -> None:
    """Discard the output of this process: Ray prints there what the caller reports better."""
    null = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(null, stream)


def give_up(pipe: Connection, address: str) -> None:
    """Report that no cluster answers, or that it has no nodes, and end this process."""
    pipe.send(no_cluster(address, f"nothing of Ray was heard for {JOIN_SECONDS:.0f} seconds"))
    os._exit(0)


def no_cluster(address: str, reason: str) -> ConfigError:
    """The error that no cluster answers, with the reason `reason`."""
    return ConfigError(
        f"--ray {address}: no cluster answers ({reason}); start one with `ray start --head`, "
        "or pass --ray local"
    )


def connect_to_cluster(ray: Any, address: str) -> tuple[str, int]:
    """Connect Ray to a cluster and watch its head; returns the host and port of the head."""
    named = os.environ.get("RAY_ADDRESS", "") if address == "auto" else address
    try:
        head = _place_in(named)
        line = ask(head) if head else None  # because Ray would try to connect for minutes
        ray.init(address=address, log_to_driver=False, logging_level=logging.ERROR)
        head = head or _place_in(ray.get_runtime_context().gcs_address)
        assert head is not None, "Ray names its head with a port"
        threading.Thread(target=end_with_head, args=(head, line or ask(head)), daemon=True).start()
    except (ImportError, OSError, OverflowError, ValueError, RuntimeError) as error:
        raise no_cluster(address, " ".join(str(error).split())[:200]) from None
    return head


def _place_in(address: str) -> tuple[str, int] | None:
    """Host and port in an address; None where it has no port, such as "auto"."""
    host, _, port = address.rpartition("://")[2].rpartition(":")
    return (host.strip("[]"), int(port)) if port.isdecimal() else None


def ask(head: tuple[str, int]) -> socket.socket:
    """Open a connection to the head; `OSError` if it does not answer."""
    return socket.create_connection(head, ANSWER_SECONDS)


def end_with_head(head: tuple[str, int], line: socket.socket) -> None:
    """End this process when the connection to the head closes, or cannot be renewed.

    A closed connection counts even if the head answers again: a restarted head has lost this work.
    """
    with suppress(OSError):
        while stays_open(line):
            before, line = line, ask(head)
            before.close()
    line.close()
    os._exit(HEAD_LOST)


def stays_open(line: socket.socket) -> bool:
    """Whether a connection stays open for `RENEWAL_SECONDS` seconds."""
    line.settimeout(RENEWAL_SECONDS)
    try:
        while line.recv(1024):  # a greeting
            pass
    except TimeoutError:
        return True
    return False


def answers(
    ray: Any, head: tuple[str, int], do: bytes, items: list[bytes]
) -> Generator[tuple[int, bytes | str], None, None]:
    """Yield the index of each item with its answer, or the reason why it failed, as they finish."""
    task = ray.remote(num_cpus=1, max_retries=TRIES - 1)(answered_alone).remote
    fresh, running = iter(enumerate(items)), dict[Any, int]()
    try:
        while True:
            for number, item in islice(fresh, MOST_SUBMITTED - len(running)):
                running[task(os.getcwd(), do, item)] = number
            if not running:
                return
            (done,), _ = ray.wait(list(running), num_returns=1)
            yield running.pop(done), answer_behind(ray, head, done)
    finally:
        for reference in running:
            ray.cancel(reference, force=True)
        ray.shutdown()


def answered_alone(folder: str, do: bytes, item: bytes) -> bytes:
    """`answered` on a node, with one thread, and in the folder to which paths are relative."""
    os.chdir(folder)  # Ray's workers start in the folder in which their node was started
    use_one_thread()
    return answered(pickle.loads(do), pickle.loads(item))


def answer_behind(ray: Any, head: tuple[str, int], reference: Any) -> bytes | str:
    """The answer of a finished task, or the reason (text) if its workers died."""
    try:
        return ray.get(reference)
    except ray.exceptions.RayTaskError as error:  # raised outside of `answered`
        reason = str(error).strip().splitlines()[-1]
        raise GeneOHError(
            f"a node of the cluster cannot do the work ({reason}); each needs the same geneoh and "
            "the folder in which this command runs"
        ) from error
    except ray.exceptions.RayError as error:
        ask(head).close()  # raises if the head is lost, so that the item is not blamed
        why = " ".join(str(error).split())[:200]
        return f"the workers that worked on this clip were lost, {TRIES} times ({why})"
