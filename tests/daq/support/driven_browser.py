"""A browser controlled over the Chrome DevTools Protocol."""

import json
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

TIMEOUT = 60.0  # s


class Page:
    """A page in a browser, controlled over the Chrome DevTools Protocol."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket
        self._number = 0

    def send_command(self, method: str, **parameters: object) -> Any:
        """Send a command and return its result."""
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            response = json.loads(self._socket.recv(TIMEOUT))
            if response.get("id") == self._number:
                assert "error" not in response, response
                return response["result"]

    def value(self, expression: str) -> Any:
        """Return the value of a JavaScript expression."""
        response = self.send_command("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in response, response
        return response["result"].get("value")

    def until(self, expression: str) -> None:
        """Wait until an expression is true."""
        end = time.monotonic() + TIMEOUT
        while not self.value(expression):
            assert time.monotonic() < end, f"{expression}: {self.value('document.body.innerText')}"
            time.sleep(0.05)

    def resize(self, width: int, height: int) -> None:
        """Resize the window, CSS pixels."""
        self.send_command(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False
        )

    def show(self, address: str) -> None:
        """Open a URL and wait until it is loaded."""
        self.send_command("Page.navigate", url=address)
        place = json.dumps(address.partition("#")[0])  # the page removes the fragment
        self.until(f"location.href.startsWith({place}) && document.readyState === 'complete'")

    def choose_file(self, element: str, path: Path) -> None:
        """Choose a file in the input with this id."""
        root = self.send_command("DOM.getDocument")["root"]["nodeId"]
        node = self.send_command("DOM.querySelector", nodeId=root, selector=f"#{element}")["nodeId"]
        self.send_command("DOM.setFileInputFiles", files=[str(path)], nodeId=node)


@contextmanager
def driven_page(program: str, profile: Path, address: str) -> Iterator[Page]:
    """Open a URL in a new browser."""
    command = [
        program, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
        "--disable-component-update", "--disable-sync", f"--user-data-dir={profile}", "--remote-debugging-port=0",
        "about:blank",
    ]  # fmt: skip
    browser = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        port = profile / "DevToolsActivePort"
        end = time.monotonic() + TIMEOUT
        while not (port.is_file() and port.read_text().count("\n")):
            assert time.monotonic() < end
            time.sleep(0.05)
        place = f"http://127.0.0.1:{port.read_text().splitlines()[0]}/json/list"
        with urllib.request.urlopen(place, timeout=TIMEOUT) as response:
            target = next(one for one in json.load(response) if one["type"] == "page")
        with connect(target["webSocketDebuggerUrl"], max_size=None) as socket:
            page = Page(socket)
            page.send_command("Page.enable")
            page.show(address)
            yield page
    finally:
        browser.kill()
        browser.wait(TIMEOUT)
