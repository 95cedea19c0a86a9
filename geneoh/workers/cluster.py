"""Work in items on a Ray cluster, of this machine or of several that share their folders.

A process of its own speaks with Ray. Where the head of a cluster is lost, Ray ends the process that
works with it, after a minute and without a word to the caller; here only that process ends, soon.
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
    PATIENCE,
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

ANSWER = 10.0  # seconds in which a cluster must answer
RENEWED = 30.0
"""Seconds after which the connection to a head is renewed, before the head itself ends it."""
BEGIN = 60.0  # seconds in which the work must begin on a cluster that is there
WAITING = 1000  # items that the cluster knows of at a time
HEAD_LOST = 3  # exit code of the process that speaks with Ray


def on_cluster(
    work: Iterable[Item], do: Do[Item, Result], *, address: str, lost: Lost[Item, Result]
) -> Iterator[Result]:
    """The results as they are made, as `results_of`; an item that loses its node is tried again.

    `do` can be imported on every node; `address` is as Ray takes it, "local" starts a cluster on
    this machine.

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
    packed = [pickle.dumps(item) for item in items]  # only the nodes load what items need
    try:
        process, pipe = started(crew, _serve, address, pickle.dumps(do), packed)
        while (told := told_by(process, pipe, address)) is not None:
            number, answer = told
            if isinstance(answer, str):
                yield lost(items[number], answer)
            else:
                yield unpacked(pickle.loads(answer))
        process.join(PATIENCE)
    finally:
        end(crew)


def told_by(process: BaseProcess, pipe: Connection, address: str) -> tuple[int, bytes | str] | None:
    """The number of an item, and its answer or why it is lost; None at the end of the work."""
    try:
        told = pipe.recv()
    except (EOFError, OSError):  # what it tells may end in its middle
        process.join(PATIENCE)
        code = process.exitcode
        if code == HEAD_LOST:
            why = "the head of the cluster was lost; start one again with `ray start --head`, and"
        else:
            why = f"the process that speaks with Ray ended with exit code {code};"
        raise GeneOHError(
            f"--ray {address}: {why} run the same again for what is left: what is done is kept"
        ) from None
    if isinstance(told, Exception):
        raise told
    return told


def _serve(pipe: Connection, address: str, do: bytes, items: list[bytes]) -> None:
    """What the process that speaks with Ray does: all that it learns goes through the pipe."""
    obey_parent()
    be_silent()
    ray, code = import_module("ray"), 0
    try:
        late = threading.Timer(BEGIN, give_up, (pipe, address))
        if address != "local":
            late.start()
        head = connect_to_cluster(ray, address)
        late.cancel()
        with closing(answers(ray, head, do, items)) as found:
            for told in found:
                pipe.send(told)
        pipe.send(None)
    except GeneOHError as error:
        pipe.send(error)
    except OSError:  # of `ask`, or Ray's own
        code = HEAD_LOST
    except Exception as error:
        pipe.send(RuntimeError(f"{type(error).__name__}: {error}"))
    finally:
        os._exit(code)  # Ray itself would wait for a lost head


def be_silent() -> None:
    """Let nothing be printed by this process, in which Ray prints what the caller tells better."""
    null = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(null, stream)


def give_up(pipe: Connection, address: str) -> None:
    """End this process, which still waits for what is not Ray, or for a head without nodes."""
    pipe.send(no_cluster(address, f"nothing of Ray was heard for {BEGIN:.0f} seconds"))
    os._exit(0)


def no_cluster(address: str, said: str) -> ConfigError:
    """The error that tells that no cluster answers, and what was heard instead."""
    return ConfigError(
        f"--ray {address}: no cluster answers ({said}); start one with `ray start --head`, "
        "or pass --ray local"
    )


def connect_to_cluster(ray: Any, address: str) -> tuple[str, int]:
    """Connect Ray to a cluster; host and port of the head, with which this process now ends."""
    named = os.environ.get("RAY_ADDRESS", "") if address == "auto" else address
    try:
        head = _place_in(named)
        line = ask(head) if head else None  # Ray itself would ask for minutes
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
    """A connection to the head; `OSError` where it does not answer."""
    return socket.create_connection(head, ANSWER)


def end_with_head(head: tuple[str, int], line: socket.socket) -> None:
    """End this process when a connection to the head ends, or no new one can be made.

    A head that is started again at once answers too, but knows nothing of this work.
    """
    with suppress(OSError):
        while stays_open(line):
            before, line = line, ask(head)
            before.close()
    line.close()
    os._exit(HEAD_LOST)


def stays_open(line: socket.socket) -> bool:
    """Whether a connection has not ended when it should be renewed."""
    line.settimeout(RENEWED)
    try:
        while line.recv(1024):  # a greeting
            pass
    except TimeoutError:
        return True
    return False


def answers(
    ray: Any, head: tuple[str, int], do: bytes, items: list[bytes]
) -> Generator[tuple[int, bytes | str], None, None]:
    """The number of each item, and its answer or why it is lost, as they are made."""
    task = ray.remote(num_cpus=1, max_retries=TRIES - 1)(answered_alone).remote
    fresh, running = iter(enumerate(items)), dict[Any, int]()
    try:
        while True:
            for number, item in islice(fresh, WAITING - len(running)):
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
    """As `answered`, with one thread, and in the folder to which paths are relative."""
    os.chdir(folder)  # Ray's workers are in that in which their node was started
    use_one_thread()
    return answered(pickle.loads(do), pickle.loads(item))


def answer_behind(ray: Any, head: tuple[str, int], reference: Any) -> bytes | str:
    """The answer behind a reference; where its workers died, why."""
    try:
        return ray.get(reference)
    except ray.exceptions.RayTaskError as error:  # raised outside of `answered`
        said = str(error).strip().splitlines()[-1]
        raise GeneOHError(
            f"a node of the cluster cannot do the work ({said}); each needs the same geneoh and "
            "the folder in which this command runs"
        ) from error
    except ray.exceptions.RayError as error:
        ask(head).close()  # workers that died with the head are no fault of the item
        why = " ".join(str(error).split())[:200]
        return f"the workers that began it were lost, {TRIES} times ({why})"
