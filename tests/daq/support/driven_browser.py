"""A browser that a test drives: it chooses files, types and presses as an operator does."""

import json
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

DEADLINE = 60.0  # s


class Page:
    """A page in a browser, by the browser's own protocol for developers."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket
        self._number = 0

    def ask(self, method: str, **parameters: object) -> Any:
        """Send a command and return its result."""
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            answer = json.loads(self._socket.recv(DEADLINE))
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]

    def value(self, expression: str) -> Any:
        """Return the value of an expression of JavaScript."""
        answer = self.ask("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def until(self, expression: str) -> None:
        """Wait until an expression is true."""
        end = time.monotonic() + DEADLINE
        while not self.value(expression):
            assert time.monotonic() < end, f"{expression}: {self.value('document.body.innerText')}"
            time.sleep(0.05)

    def resize(self, width: int, height: int) -> None:
        """Give the window another size, in the page's pixels."""
        self.ask("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def show(self, address: str) -> None:
        """Go to an address, and wait until it is there."""
        self.ask("Page.navigate", url=address)
        place = json.dumps(address.partition("#")[0])  # a page takes what is behind it away
        self.until(f"location.href.startsWith({place}) && document.readyState === 'complete'")

    def choose_file(self, element: str, path: Path) -> None:
        """Choose a file in an input of this id."""
        root = self.ask("DOM.getDocument")["root"]["nodeId"]
        node = self.ask("DOM.querySelector", nodeId=root, selector=f"#{element}")["nodeId"]
        self.ask("DOM.setFileInputFiles", files=[str(path)], nodeId=node)


@contextmanager
def driven_page(program: str, profile: Path, address: str) -> Iterator[Page]:
    """Open an address in a browser of its own."""
    command = [
        program, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
        "--disable-component-update", "--disable-sync", f"--user-data-dir={profile}", "--remote-debugging-port=0",
        "about:blank",
    ]  # fmt: skip
    browser = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        port = profile / "DevToolsActivePort"
        end = time.monotonic() + DEADLINE
        while not (port.is_file() and port.read_text().count("\n")):
            assert time.monotonic() < end
            time.sleep(0.05)
        place = f"http://127.0.0.1:{port.read_text().splitlines()[0]}/json/list"
        with urllib.request.urlopen(place, timeout=DEADLINE) as answer:
            target = next(one for one in json.load(answer) if one["type"] == "page")
        with connect(target["webSocketDebuggerUrl"], max_size=None) as socket:
            page = Page(socket)
            page.ask("Page.enable")
            page.show(address)
            yield page
    finally:
        browser.kill()
        browser.wait(DEADLINE)
