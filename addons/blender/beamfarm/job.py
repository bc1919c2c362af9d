"""Runs the command, and queries its status on its job's page.

The page's port answers `/metrics`, text with one number per line, and `/image.exr`, the average of the complete passes,
so pictures arrive without rewriting a file again and again. Nothing here depends on Blender.
"""

from __future__ import annotations

import http.client
import os
import re
import secrets
import signal
import subprocess
import threading
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path

from .program import hidden

_PAGE = re.compile(r"(?:page: |listening on )http://(\S+?):(\d+)/?")
# Environment variables for another certificate or token: this job has its own.
_NOT_OURS = ("BEAMFARM_TOKEN_FILE", "BEAMFARM_OPERATOR_TOKEN_FILE", "BEAMFARM_TLS_CERT", "BEAMFARM_TLS_KEY",
             "BEAMFARM_TLS_CA", "BEAMFARM_TLS_CLIENT_CA")
# Seconds to wait for an answer of the page: for numbers, and for a picture, which has to be made.
_PATIENCE = 2.0
_PICTURE_PATIENCE = 60.0
# Seconds after a cancel in which the picture may be written before the process is killed.
_GRACE = 20.0

_METRICS = {
    "beamfarm_passes_prefix": "passes",
    "beamfarm_passes_limit": "limit",
    "beamfarm_workers_connected": "workers",
    "beamfarm_job_progress_ratio": "share",
    "beamfarm_job_remaining_seconds": "remaining",
    "beamfarm_image_relative_standard_error_ratio": "error",
}

# Exit codes without failure: done, and stopped before the first pass.
DONE, NOTHING = 0, 4
# From here on a limit of passes means none.
_NO_LIMIT = 1 << 53


@dataclass
class Progress:
    """The status of a job; None is unknown."""

    passes: int = 0
    limit: int | None = None
    workers: int = 0
    share: float = 0.0
    remaining: float | None = None
    error: float | None = None


class Job:
    """One process of `beamfarm render` or `serve`."""

    def __init__(self, command: list[str], token: str | None = None) -> None:
        self.token = token or secrets.token_hex(32)
        self.progress = Progress()
        self._address: tuple[str, int] | None = None
        self._said: deque[str] = deque(maxlen=40)
        self._cancelled_at: float | None = None
        environment = {name: value for name, value in os.environ.items() if name not in _NOT_OURS}
        environment["BEAMFARM_TOKEN"] = self.token
        self.environment = environment
        self.process = subprocess.Popen(
            # It ends when its standard input closes: when this process dies, in whatever way.
            [*command, "--with-parent"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            errors="replace",
            env=environment,
            **hidden(),
        )
        self._readers = [
            threading.Thread(target=self._read, args=(stream,), daemon=True)
            for stream in (self.process.stdout, self.process.stderr)
        ]
        for reader in self._readers:
            reader.start()

    def _read(self, stream) -> None:
        with stream:
            for line in stream:
                page = _PAGE.match(line)
                if page and self._address is None:
                    self._address = _reached_here(page[1]), int(page[2])
                self._said.append(line.rstrip())

    @property
    def url(self) -> str | None:
        """The address of the job's page, once it is known."""
        return self._address and f"http://{self._address[0]}:{self._address[1]}"

    @property
    def is_running(self) -> bool:
        return self.process.poll() is None

    @property
    def exit_code(self) -> int | None:
        return self.process.poll()

    def words(self) -> str:
        """The command's own message about its failure."""
        for reader in self._readers:
            reader.join(timeout=1.0)
        said = [line for line in self._said if line.strip()]
        wrong = [line for line in said if line.startswith("error")]
        return "\n".join(line.removeprefix("error: ") for line in wrong or said[-3:])

    def _get(self, path: str, patience: float, method: str = "GET") -> tuple[bytes, dict[str, str]] | None:
        if self._address is None:
            return None
        connection = http.client.HTTPConnection(*self._address, timeout=patience)
        try:
            connection.request(method, path, headers={"Authorization": f"Bearer {self.token}", "Accept": "text/plain"})
            response = connection.getresponse()
            body = response.read()
            headers = {name.lower(): value for name, value in response.getheaders()}
        except (OSError, http.client.HTTPException):
            # Not there yet, or over.
            return None
        finally:
            connection.close()
        return (body, headers) if response.status == 200 else None

    def look(self) -> Progress:
        """The present status; the previous one if the page does not answer."""
        answer = self._get("/metrics", _PATIENCE)
        if answer is not None:
            self.progress = parse_metrics(answer[0].decode("utf-8", "replace"))
        return self.progress

    def picture(self) -> bytes | None:
        """An EXR of the complete passes; None before the first pass and when the job is over."""
        answer = self._get("/image.exr", _PICTURE_PATIENCE)
        return answer and answer[0]

    def cancel(self) -> None:
        """Ends it, with a picture of the complete passes."""
        if self._cancelled_at is not None or not self.is_running:
            return
        self._cancelled_at = time.monotonic()
        if os.name != "nt":
            self.process.send_signal(signal.SIGINT)
        elif self._get("/cancel", _PATIENCE, "POST") is None:
            # Windows has no such signal for a process without a console.
            self.process.terminate()

    def wait(self) -> int:
        """Waits for its end, but not for ever after a cancel. Returns its exit code."""
        patience = None if self._cancelled_at is None else _GRACE
        try:
            return self.process.wait(patience)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return self.process.wait()

    def close(self) -> None:
        """Ends everything."""
        self.cancel()
        self.wait()
        if self.process.stdin is not None:
            self.process.stdin.close()
        for reader in self._readers:
            reader.join(timeout=1.0)


def _reached_here(host: str) -> str:
    """The host under which this machine reaches what listens there."""
    host = host.strip("[]")
    return {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)


def parse_metrics(text: str) -> Progress:
    """Parses the lines of `/metrics`."""
    progress = Progress()
    for line in text.splitlines():
        name, _, value = line.partition(" ")
        field = _METRICS.get(name)
        if field is None:
            continue
        number = float(value)
        setattr(progress, field, int(number) if field in ("passes", "limit", "workers") else number)
    if progress.limit is not None and progress.limit >= _NO_LIMIT:
        progress.limit = None
    return progress


def words(progress: Progress) -> str:
    """The status line."""
    of = "" if progress.limit is None else f"/{progress.limit}"
    parts = [f"Pass {progress.passes}{of}"]
    if progress.error is not None:
        parts.append(f"error {100.0 * progress.error:.2g} %")
    if progress.remaining is not None:
        parts.append(f"{_time(progress.remaining)} left")
    if progress.workers == 0:
        parts.append("no workers")
    elif progress.workers > 1:
        parts.append(f"{progress.workers} workers")
    return " | ".join(parts)


def _time(seconds: float) -> str:
    whole = int(seconds + 0.5)
    hours, minutes, seconds = whole // 3600, whole // 60 % 60, whole % 60
    return f"{hours}:{minutes:02}:{seconds:02}" if hours else f"{minutes:02}:{seconds:02}"


def start_workers(job: Job, program: Path, count: int, threads: int) -> list[subprocess.Popen]:
    """Workers on this machine for a job of `serve`; they end with it."""
    command = [str(program), "worker", "--connect", str(job.url), "--no-cache", "--with-parent"]
    if threads:
        command += ["--threads", str(threads)]
    streams = {"stdin": subprocess.PIPE, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return [subprocess.Popen(command, env=job.environment, **streams, **hidden()) for _ in range(count)]


def stop_workers(workers: list[subprocess.Popen]) -> None:
    """Ends them, unless they have ended with their job."""
    for worker in workers:
        if worker.stdin is not None:
            worker.stdin.close()
    for worker in workers:
        try:
            worker.wait(_GRACE)
        except subprocess.TimeoutExpired:
            worker.kill()
            worker.wait()
