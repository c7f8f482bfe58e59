"""What is said to another process without waiting for it to listen."""

import threading
from multiprocessing.connection import Connection
from queue import SimpleQueue


class Outbox:
    """Sends messages in their order from a thread of its own: a process that is stuck holds up nobody else.

    Parameters
    ----------
    pipe : Connection
        The way to the other process. Where it is gone, what is still to be sent is dropped.
    """

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._messages: SimpleQueue[object] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="outbox", daemon=True)
        self._thread.start()

    def send(self, message: object) -> None:
        """Send a message, soon; from any thread."""
        self._messages.put(message)

    def close(self, timeout: float) -> bool:
        """Send what is left, for `timeout` s at most; return whether the thread has ended."""
        self._messages.put(None)
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while (message := self._messages.get()) is not None:
            try:
                self._pipe.send(message)
            except OSError:
                return
