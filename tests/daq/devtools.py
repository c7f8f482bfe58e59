"""A browser without a screen that is asked over its own protocol: what a page measures in a window of a given size."""

import itertools
import json
import subprocess
import tempfile
import time
import urllib.request
from contextlib import ExitStack
from typing import Any, Self

from websockets.sync.client import connect

_PATIENCE = 30.0  # s


class Browser:
    """One Chromium with one page."""

    def __init__(self, program: str) -> None:
        self._stack = ExitStack()
        profile = self._stack.enter_context(tempfile.TemporaryDirectory(ignore_cleanup_errors=True))
        command = [
            program, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
            "--disable-background-networking", "--disable-component-update", "--disable-sync",
            "--remote-debugging-port=0", f"--user-data-dir={profile}", "about:blank",
        ]  # fmt: skip
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self._stack.callback(self._process.wait)
        self._stack.callback(self._process.kill)
        stderr = self._process.stderr
        assert stderr is not None
        self._stack.callback(stderr.close)
        address = next(line.split()[-1] for line in stderr if "DevTools listening" in line)
        place = address.split("/")[2]
        request = urllib.request.Request(f"http://{place}/json/new?about:blank", method="PUT")
        with urllib.request.build_opener(urllib.request.ProxyHandler({})).open(request, timeout=_PATIENCE) as answer:
            page = json.load(answer)["webSocketDebuggerUrl"]
        self._socket = self._stack.enter_context(connect(page, proxy=None, max_size=None))
        self._numbers = itertools.count()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def resize(self, width: int, height: int) -> None:
        """Give the window another size, CSS pixels."""
        self._order(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 500
        )

    def open(self, address: str) -> None:
        """Go to a page."""
        self._order("Page.navigate", url=address)

    def evaluate(self, script: str) -> Any:
        """Return what an expression of JavaScript comes to in the page; a promise is waited for."""
        answer = self._order("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def wait(self, condition: str) -> None:
        """Wait for an expression of the page's body, `body`, to become true."""
        deadline = time.monotonic() + _PATIENCE
        while not self.evaluate(f"(body => body !== null && !!({condition}))(document.body)"):
            assert time.monotonic() < deadline, condition
            time.sleep(0.05)

    def _order(self, method: str, **parameters: object) -> dict[str, Any]:
        number = next(self._numbers)
        self._socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while (answer := json.loads(self._socket.recv(_PATIENCE))).get("id") != number:
            continue
        assert "error" not in answer, answer
        result: dict[str, Any] = answer["result"]
        return result
