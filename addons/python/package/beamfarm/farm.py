"""Farms: a coordinator, and workers on this machine or on others."""

from __future__ import annotations

import json
import os
import secrets
import ssl
import subprocess
import tempfile
import threading
import time as clock
import urllib.error
import urllib.request
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from . import _native
from .command import program
from .errors import ArgumentError, FarmError, RenderError
from .image import Pixels, read
from .rendering import AnyScene, _options, _real, _scene, _whole

__all__ = ["Farm", "Served", "connect", "serve"]

# Seconds to wait for an image.
_PATIENCE = 120.0


class Farm:
    """A farm that renders a job, reached through its coordinator.

    Parameters
    ----------
    url
        ``http://HOST:7325`` or ``https://HOST:7325``.
    token
        The farm's token; by default that in the environment variable ``BEAMFARM_TOKEN``.
    tls_ca, tls_cert, tls_key
        PEM files: the authorities to trust, and a client certificate with its key.
    """

    def __init__(
        self,
        url: str,
        *,
        token: str | None = None,
        tls_ca: str | os.PathLike[str] | None = None,
        tls_cert: str | os.PathLike[str] | None = None,
        tls_key: str | os.PathLike[str] | None = None,
    ) -> None:
        self.url = url if "://" in url else f"http://{url}"
        paths = [None if path is None else Path(path) for path in (tls_ca, tls_cert, tls_key)]
        self.token = token or os.environ.get("BEAMFARM_TOKEN") or None
        self._pem = paths
        self._native = _native.Remote(self.url, self.token, *paths)

    def status(self) -> dict[str, Any]:
        """The job's status: what ``beamfarm status --json`` prints. Times are seconds.

        Raises
        ------
        FarmError
            The farm cannot be reached, or refuses the request.
        """
        status: dict[str, Any] = json.loads(self._native.status())
        return status

    def pause(self) -> None:
        """Hand out no more passes until :meth:`resume`."""
        self._native.steer("pause")

    def resume(self) -> None:
        """Hand out passes again."""
        self._native.steer("resume")

    def cancel(self) -> None:
        """End the job with the passes that are complete."""
        self._native.steer("cancel")

    def extend(self, passes: int) -> None:
        """Set the total number of passes."""
        self._native.steer("extend", _whole("passes", passes, 1, 2**53))

    def exr(self) -> bytes:
        """The image of the passes that are complete, as an OpenEXR file with its layers.

        Raises
        ------
        FarmError
            There is none yet, or the farm cannot be reached.
        """
        request = urllib.request.Request(f"{self.url.rstrip('/')}/image.exr")
        if self.token:
            request.add_header("Authorization", f"Bearer {self.token}")
        context = None
        if self.url.startswith("https:"):
            authority, certificate, key = self._pem
            context = ssl.create_default_context(cafile=None if authority is None else str(authority))
            if certificate is not None:
                context.load_cert_chain(certificate, key)
        try:
            with urllib.request.urlopen(request, timeout=_PATIENCE, context=context) as reply:
                return bytes(reply.read())
        except urllib.error.HTTPError as error:
            why = "no pass is complete" if error.code == 404 else f"{error.code} {error.reason}"
            raise FarmError(f"{self.url}: {why}") from error
        except OSError as error:
            raise FarmError(f"{self.url}: {error}") from error

    def image(self) -> Pixels:
        """R, G and B of the passes that are complete: (height, width, 3) float32, linear."""
        with tempfile.TemporaryDirectory(prefix="beamfarm-") as folder:
            path = Path(folder) / "image.exr"
            path.write_bytes(self.exr())
            return read(path)

    def __repr__(self) -> str:
        return f"<Farm {self.url}>"


def connect(url: str, **options: Any) -> Farm:
    """A farm that is already running; arguments as for :class:`Farm`. This does not contact it yet."""
    return Farm(url, **options)


class Served(Farm):
    """A farm that this program serves: ``with beamfarm.serve(scene) as farm: ...``. It ends with the block."""

    def __init__(
        self,
        scene: AnyScene,
        *,
        workers: int = 1,
        threads: int | None = None,
        passes: int | None = None,
        time: float | None = None,
        error: float | None = None,
        layers: Sequence[str] = (),
        listen: str = "127.0.0.1:0",
        token: str | None = None,
        output: str | os.PathLike[str] | None = None,
        **options: Any,
    ) -> None:
        settings = _options(layers, threads=threads, **options)
        scene = _scene(scene)
        scene.check()
        self._folder = tempfile.TemporaryDirectory(prefix="beamfarm-")
        self._workers: list[subprocess.Popen[bytes]] = []
        folder = Path(self._folder.name)
        path = scene.save(folder / "scene.toml")
        self.output = Path(output) if output is not None else folder / "image.exr"
        own = token or secrets.token_hex(16)
        arguments: list[str | os.PathLike[str]] = ["serve", path, "--listen", listen, "--with-parent"]
        arguments += ["-o", self.output, "--job", folder / "job"]
        for name, value in {
            "--passes": _whole("passes", passes, 1, 2**53),
            "--time": None if time is None else f"{_real('time', time)}s",
            "--target-error": _real("error", error),
            "--paths": settings["paths"],
            "--seed": settings["seed"],
            "--alpha": settings["alpha"],
            "--budget": settings["budget"],
            "--engine": settings["engine"],
        }.items():
            if value is not None:
                arguments += [name, str(value)]
        for layer in settings["layers"]:
            arguments += ["--aov", layer]
        self._environment = {**os.environ, "BEAMFARM_TOKEN": own}
        self._said: list[str] = []
        self._coordinator = self._start(arguments, subprocess.PIPE)
        try:
            super().__init__(self._address(), token=own)
            for place in range(_whole("workers", workers, 0, 65535) or 0):
                command = ["worker", "--connect", self.url, "--with-parent", "--name", f"local {place}", "--no-cache"]
                if settings["threads"]:
                    command += ["--threads", str(settings["threads"])]
                if settings["device"] is not None:
                    command += [f"--gpu={settings['device']}"]
                self._workers.append(self._start([*command, "--log", "error"], subprocess.DEVNULL))
        except BaseException:
            self.close()
            raise

    def _start(self, arguments: Sequence[str | os.PathLike[str]], output: int) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [program(), *arguments],
            stdin=subprocess.PIPE,
            stdout=output,
            stderr=subprocess.PIPE if output == subprocess.PIPE else subprocess.DEVNULL,
            env=self._environment,
        )

    def _address(self) -> str:
        """The address that it reports; its other output is kept for errors."""
        stdout, stderr = self._coordinator.stdout, self._coordinator.stderr
        assert stdout is not None and stderr is not None
        complaints = threading.Thread(target=self._keep, args=(stderr,), daemon=True)
        complaints.start()
        for line in stdout:
            text = line.decode(errors="replace").strip()
            if text.startswith("listening on "):
                threading.Thread(target=self._keep, args=(stdout,), daemon=True).start()
                return text.removeprefix("listening on ")
        complaints.join(timeout=5)
        self._coordinator.wait()
        said = "\n".join(self._said).removeprefix("error: ")
        raise RenderError(f"the coordinator did not start: {said}")

    def _keep(self, stream: Any) -> None:
        for line in stream:
            self._said.append(line.decode(errors="replace").rstrip())
            del self._said[:-100]

    def wait(self, timeout: float | None = None) -> Pixels:
        """Wait for the end of the job, and read its image: (height, width, 3) float32.

        Raises
        ------
        RenderError
            The job failed: the message says why.
        TimeoutError
            The job took longer than ``timeout`` seconds.
        """
        end = None if timeout is None else clock.monotonic() + timeout
        while self._coordinator.poll() is None:
            if end is not None and clock.monotonic() > end:
                raise TimeoutError(f"the job has not ended within {timeout} s")
            # Signals are handled in between.
            clock.sleep(0.05)
        if self._coordinator.returncode != 0:
            said = "\n".join(line for line in self._said if "error" in line)
            raise RenderError(said or f"the coordinator ended with exit code {self._coordinator.returncode}")
        return read(self.output)

    def close(self) -> None:
        """End the job and its workers."""
        # Each ends when its standard input closes; what is complete is written first.
        for process in [self._coordinator, *self._workers]:
            if process.stdin is not None:
                process.stdin.close()
        for process in [self._coordinator, *self._workers]:
            try:
                process.wait(timeout=60)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            for stream in (process.stdout, process.stderr):
                if stream is not None:
                    stream.close()
        self._folder.cleanup()

    def __enter__(self) -> Served:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def serve(scene: AnyScene, **options: Any) -> Served:
    """Serve a scene to workers: ``with beamfarm.serve(scene, workers=2) as farm: pixels = farm.wait()``.

    Parameters
    ----------
    workers, threads
        Worker processes on this machine, and threads of each. Others may join from elsewhere if ``listen`` lets them.
    passes, time, error, layers, paths, seed, alpha, budget, engine, device
        As for :func:`render`.
    listen
        ``"ADDRESS:PORT"``; port 0 takes a free one. By default only this machine can connect.
    token
        The farm's token; by default a random one: ``farm.token``.
    output
        Where to write the image (``.exr``); by default only to a temporary file.

    Raises
    ------
    SceneError
        Everything that is wrong with the scene.
    RenderError
        The coordinator did not start: the message has its output.
    """
    if "workers" in options and options["workers"] is None:
        raise ArgumentError("workers = None: expected a whole number, from 0")
    return Served(scene, **options)
