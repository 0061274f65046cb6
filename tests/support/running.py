"""Services, routers and robots in processes of their own, which can be killed and frozen."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any, Self

import httpx
from homsense_cli.local_service import free_port

from support.networks import fill

HERE = Path(__file__).parents[1]


class Process:
    """A process that is ended at the end.

    Parameters
    ----------
    command : list of str
        What runs.
    **environment : str
        Beside that of the tests.
    """

    def __init__(self, command: list[str], **environment: str) -> None:
        self._command, self._environment = command, {**os.environ, **environment}
        self.log: list[str] = []
        self.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.end(signal.SIGKILL)

    def start(self) -> None:
        """Start it, again."""
        self.process = subprocess.Popen(
            self._command,
            env=self._environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            cwd=HERE,
        )
        self._reading = threading.Thread(target=self._read, args=(self.process,))
        self._reading.start()

    def _read(self, process: "subprocess.Popen[str]") -> None:
        assert process.stdout is not None
        with process.stdout:
            self.log.extend(process.stdout)

    def tell(self, number: signal.Signals) -> None:
        """Send a signal."""
        self.process.send_signal(number)

    def end(self, with_signal: signal.Signals = signal.SIGTERM) -> float:
        """Return how long it took to end, seconds."""
        started_s = time.monotonic()
        self.tell(with_signal)
        self.process.wait(20)
        taken_s = time.monotonic() - started_s
        self._reading.join()
        return taken_s


class Service(Process):
    """A service with a site."""

    def __init__(self, data: Path, **settings: Any) -> None:
        self.url = f"http://127.0.0.1:{free_port()}"
        texts = {k: v if isinstance(v, str) else json.dumps(v) for k, v in settings.items()}
        super().__init__(
            [sys.executable, "-m", "homsense_service"],
            HOMSENSE_DATA=str(data),
            HOMSENSE_PORT=self.url.rpartition(":")[2],
            **{f"HOMSENSE_{name.upper()}": text for name, text in texts.items()},
        )
        self.await_health()
        with httpx.Client(base_url=self.url) as client:
            fill(client)

    def await_health(self) -> None:
        """Wait until it answers."""
        for _ in range(300):
            try:
                httpx.get(f"{self.url}/healthz")
            except httpx.TransportError:
                time.sleep(0.1)
            else:
                return
        raise AssertionError(self.log)

    def metric(self, name: str) -> float:
        """Return the sum of the metrics that begin with a name."""
        lines = httpx.get(f"{self.url}/metrics").text.splitlines()
        return sum(float(line.split()[-1]) for line in lines if line.startswith(name))


class Router(Process):
    """A router."""

    def __init__(self, *listen: str, connect: tuple[str, ...] = ()) -> None:
        command = [sys.executable, "-m", "homsense_cli", "zenoh", "router"]
        for option, endpoints in (("--listen", listen), ("--connect", connect)):
            command += [part for endpoint in endpoints for part in (option, endpoint)]
        super().__init__(command)
        while not self.log:
            assert self.process.poll() is None
            time.sleep(0.02)


class Script(Process):
    """A robot, or what pretends to be one, as a few lines of Python."""

    def __init__(self, code: str, *arguments: str) -> None:
        super().__init__([sys.executable, "-c", code, *arguments])

    def await_line(self, text: str, timeout_s: float = 20.0) -> None:
        """Wait until it has printed something."""
        ends_s = time.monotonic() + timeout_s
        while not any(text in line for line in self.log):
            assert time.monotonic() < ends_s, self.log
            time.sleep(0.01)
