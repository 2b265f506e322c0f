"""Debian's Firefox through WebDriver BiDi, the protocol it speaks by itself; Playwright drives its own Firefox only."""

import json
import os
import shutil
import signal
import subprocess
import time
from contextlib import suppress

PROGRAM = next(filter(None, map(shutil.which, ["firefox-esr", "firefox"])), None)
PATIENCE = 60  # seconds, for the start and for each answer
PREFERENCES = {
    # What is not on this machine is asked of a proxy that is not there; nothing is fetched for the browser itself.
    "network.proxy.type": 1, "network.proxy.http": "127.0.0.1", "network.proxy.http_port": 9,
    "network.proxy.ssl": "127.0.0.1", "network.proxy.ssl_port": 9, "services.settings.server": "data:,",
}  # fmt: skip
ARROWS = {f"Arrow{name}": chr(0xE012 + i) for i, name in enumerate(["Left", "Up", "Right", "Down"])}
KEYS = {"Tab": "\ue004", "Enter": "\ue007", "Shift": "\ue008", "Control": "\ue009", "Home": "\ue011"} | ARROWS
EVENTS = ["log.entryAdded", "network.beforeRequestSent", "network.responseCompleted", "network.fetchError"]


class Firefox:
    """A fresh Firefox with one tab, its profile and home in ``folder``; ``complaints`` says what went wrong in it."""

    def __init__(self, folder):
        import websocket

        self.complaints, self._socket, self._count = [], None, 0
        settings = [f"user_pref({json.dumps(name)}, {json.dumps(value)});" for name, value in PREFERENCES.items()]
        (folder / "user.js").write_text("\n".join(settings), encoding="utf-8")
        command = [PROGRAM, "--headless", "--no-remote", "--remote-debugging-port=0", "--profile", str(folder)]
        more = {"env": os.environ | {"HOME": str(folder)}, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        self._process = subprocess.Popen(command, start_new_session=True, **more)
        written, end = folder / "WebDriverBiDiServer.json", time.monotonic() + PATIENCE
        try:
            while not (written.exists() and written.read_text(encoding="utf-8").rstrip().endswith("}")):
                if self._process.poll() is not None or time.monotonic() > end:
                    raise RuntimeError(f"{PROGRAM} does not answer after {PATIENCE} s, or has ended")
                time.sleep(0.1)
            address = f"ws://127.0.0.1:{json.loads(written.read_text(encoding='utf-8'))['ws_port']}/session"
            direct = {"suppress_origin": True, "http_no_proxy": ["*"]}
            self._socket = websocket.create_connection(address, timeout=PATIENCE, **direct)
            self.send("session.new", capabilities={})
            self.send("session.subscribe", events=EVENTS)
            self.tab = self.send("browsingContext.getTree")["contexts"][0]["context"]
        except BaseException:
            self.close()
            raise

    def send(self, method, **parameters):
        """One command and its result; RuntimeError where it is refused.  After a silence the browser is closed."""
        self._count += 1
        try:
            self._socket.send(json.dumps({"id": self._count, "method": method, "params": parameters}))
            while (answer := json.loads(self._socket.recv())).get("id") != self._count:
                self._hear(answer.get("method"), answer.get("params", {}))
        except Exception:
            self.close()
            raise
        if answer["type"] == "error":
            raise RuntimeError(f"{method}: {answer['message']}")
        return answer["result"]

    def _hear(self, event, said):
        url, status = said.get("request", {}).get("url", ""), said.get("response", {}).get("status", 0)
        if said.get("level") == "error":
            self.complaints.append(f"{said['type']}: {said['text']}")
        elif said.get("errorText") == "NS_BINDING_ABORTED":
            pass  # the tab went elsewhere before a file had come
        elif event == "network.fetchError" or status >= 400:
            self.complaints.append(f"{said.get('errorText', status)}: {url}")
        elif url.startswith("http") and not url.startswith("http://127.0.0.1:"):
            self.complaints.append(f"leaves the site: {url}")

    def open(self, address, width=1440, height=900):
        self.send("browsingContext.setViewport", context=self.tab, viewport={"width": width, "height": height})
        self.send("browsingContext.navigate", context=self.tab, url=address, wait="complete")

    def ask(self, function, *arguments):
        """What a JavaScript function, which may be async, makes of the arguments; both ways as JSON."""
        code = f"async (given) => JSON.stringify(await ({function})(...JSON.parse(given)) ?? null)"
        how = {"functionDeclaration": code, "arguments": [{"type": "string", "value": json.dumps(arguments)}]}
        result = self.send("script.callFunction", target={"context": self.tab}, awaitPromise=True, **how)
        if result["type"] == "exception":
            raise RuntimeError(result["exceptionDetails"]["text"])
        return json.loads(result["result"]["value"])

    def wait(self, function, *arguments, seconds=30):
        """Ask until the answer is true; a page that is just being left gives none."""
        end, answer = time.monotonic() + seconds, None
        while not answer:
            assert time.monotonic() < end, f"not true after {seconds} s: {function} {arguments}"
            time.sleep(0.05)
            with suppress(RuntimeError):
                answer = self.ask(function, *arguments)

    def press(self, *keys):
        """Keys one after the other: "a", "ArrowUp", "Shift+ArrowUp"."""
        actions = []
        for held in ([KEYS.get(k, k) for k in key.split("+")] for key in keys):
            actions += [{"type": "keyDown", "value": k} for k in held]
            actions += [{"type": "keyUp", "value": k} for k in held[::-1]]
        self._act("key", actions)

    def drag(self, start, by=(0, 0)):
        """The mouse, its button held, from a point of the window, in px; without a way it is a click."""
        way = [{"x": round(start[0] + by[0] * k / 4), "y": round(start[1] + by[1] * k / 4)} for k in range(5)]
        first, *others = [{"type": "pointerMove"} | place for place in way]
        down, up = {"type": "pointerDown", "button": 0}, {"type": "pointerUp", "button": 0}
        self._act("pointer", [first, down, *others, up])

    def _act(self, kind, actions):
        self.send("input.performActions", context=self.tab, actions=[{"type": kind, "id": kind, "actions": actions}])

    def close(self):
        """End the browser and what it started, whatever state they are in."""
        with suppress(Exception):
            self._socket.close(timeout=1)
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait(10)
