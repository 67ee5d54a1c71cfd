"""Headless Chromium with software rendering, driven by its DevTools protocol over two pipes; and a folder as a file server."""

import base64
import contextlib
import functools
import http.server
import io
import json
import os
import re
import shutil
import subprocess
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Self

SECONDS = 60.0
"""How long anything may take."""
NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--remote-debugging-pipe",
    "--hide-scrollbars",
    "--disable-extensions",
    "--disable-background-networking",
    "--disable-component-update",
    "--no-first-run",
    "--mute-audio",
)


def chromium() -> str | None:
    """The browser's command; None without one."""
    return next((path for name in NAMES if (path := shutil.which(name)) is not None), None)


class Quiet(http.server.SimpleHTTPRequestHandler):
    """What `python -m http.server` answers."""

    def log_message(self, format: str, *arguments: Any) -> None:
        """Say nothing."""


class Ranges(Quiet):
    """Answers ranges of bytes too."""

    def send_head(self) -> Any:
        path, wanted = (
            Path(self.translate_path(self.path)),
            re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", "")),
        )
        if wanted is None or not path.is_file():
            return super().send_head()
        data = path.read_bytes()
        first, last = int(wanted[1]), min(int(wanted[2]), len(data) - 1)
        self.send_response(206 if first <= last else 416)
        self.send_header(
            "Content-Range", f"bytes {first}-{last}/{len(data)}" if first <= last else f"bytes */{len(data)}"
        )
        self.send_header("Content-Length", str(max(0, last + 1 - first)))
        self.end_headers()
        return io.BytesIO(data[first : last + 1])


@contextlib.contextmanager
def served(folder: Path, answers: type[Quiet] = Quiet) -> Iterator[str]:
    """The address at which `folder` is served."""
    handler = functools.partial(answers, directory=str(folder))
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}/"
    finally:
        server.shutdown()
        server.server_close()


class Browser:
    """One page of a browser of its own."""

    def __init__(self, profile: Path, flags: Sequence[str] = ()) -> None:
        command = chromium()
        assert command is not None
        to_browser, self._output = os.pipe()
        self._input, from_browser = os.pipe()
        # The protocol reads descriptor 3 and writes 4.
        line = f'exec "$0" "$@" 3<&{to_browser} 4>&{from_browser}'
        arguments = [command, *FLAGS, *flags, f"--user-data-dir={profile}", "about:blank"]
        environment = {**os.environ, "HOME": str(profile), "XDG_CONFIG_HOME": str(profile / "config")}
        self._process = subprocess.Popen(
            ["bash", "-c", line, *arguments],
            pass_fds=(to_browser, from_browser),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=environment,
            start_new_session=True,
        )
        os.close(to_browser)
        os.close(from_browser)
        self._waiting = b""
        self._number = 0
        self._session: str | None = None
        self.requests: list[str] = []
        """Addresses that the page asked for."""
        self.messages: list[str] = []
        """What the page wrote to the console, and exceptions."""
        targets = self.call("Target.getTargets")["targetInfos"]
        target = next(own["targetId"] for own in targets if own["type"] == "page")
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(OSError, TimeoutError, RuntimeError):
            self._session = None
            self.call("Browser.close")
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._input)
        os.close(self._output)

    def _message(self, until: float) -> dict[str, Any]:
        """The next message of the browser."""
        import select

        while b"\0" not in self._waiting:
            ready, _, _ = select.select([self._input], [], [], max(0.0, until - time.monotonic()))
            if not ready:
                raise TimeoutError("the browser does not answer")
            data = os.read(self._input, 1 << 20)
            if not data:
                raise RuntimeError("the browser has ended")
            self._waiting += data
        line, _, self._waiting = self._waiting.partition(b"\0")
        message: dict[str, Any] = json.loads(line)
        return message

    def _note(self, message: dict[str, Any]) -> None:
        parameters = message.get("params", {})
        match message.get("method"):
            case "Network.requestWillBeSent":
                self.requests.append(parameters["request"]["url"])
            case "Runtime.consoleAPICalled":
                self.messages.append(
                    " ".join(str(own.get("value", own.get("description"))) for own in parameters["args"])
                )
            case "Runtime.exceptionThrown":
                self.messages.append(str(parameters["exceptionDetails"]))
            case "Log.entryAdded":
                self.messages.append(parameters["entry"]["text"])

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """The result of a method of the protocol."""
        self._number += 1
        number = self._number
        message = {"id": number, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._output, json.dumps(message).encode() + b"\0")
        until = time.monotonic() + SECONDS
        while True:
            answer = self._message(until)
            if answer.get("id") == number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']['message']}")
                result: dict[str, Any] = answer["result"]
                return result
            self._note(answer)

    def resize(self, width: int, height: int, mobile: bool = False) -> None:
        """The window's size in CSS pixels; `mobile`: fingers in place of a mouse."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=mobile)
        self.call("Emulation.setTouchEmulationEnabled", enabled=mobile)

    def open(self, address: str) -> None:
        """Begin with a page."""
        self.requests.clear()
        self.messages.clear()
        self.call("Page.navigate", url=address)

    def ask(self, expression: str) -> Any:
        """The value of an expression, awaited where it is a promise. Raises RuntimeError for what it throws."""
        answer = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(str(answer["exceptionDetails"]))
        return answer["result"].get("value")

    def wait(self, expression: str, seconds: float = SECONDS) -> Any:
        """The first value of an expression that is true in JavaScript."""
        until = time.monotonic() + seconds
        while True:
            try:
                found = self.ask(expression)
            except RuntimeError as error:
                # While a page is being loaded there is nothing to ask.
                found, last = None, str(error)
            else:
                last = str(found)
            if found:
                return found
            if time.monotonic() > until:
                raise TimeoutError(f"{expression}: {last}; {self.messages[-5:]}")
            time.sleep(0.05)

    def picture(self) -> bytes:
        """The window as a PNG."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
