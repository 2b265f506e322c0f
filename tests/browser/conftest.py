"""A browser, and a server for the built book, both shared by all the browser tests."""

import os
import shutil
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

# The book as `make book` left it, or another copy.
HTML = Path(os.environ.get("COURSEKIT_HTML", Path(__file__).parents[2] / "book" / "_build" / "html")).resolve()
CHROMIUM = next(filter(None, map(shutil.which, ["chromium", "chromium-browser", "google-chrome"])), "chromium")
ARGUMENTS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",  # a name that is not this machine leads nowhere
]
SCREENS = {"wide": (1440, 900), "phone": (390, 844)}


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *words):
        pass


@pytest.fixture(scope="session")
def browser(tmp_path_factory):
    """A fresh Chromium, without a profile of anybody's."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        context = playwright.chromium.launch_persistent_context(
            tmp_path_factory.mktemp("profile"),
            executable_path=CHROMIUM,
            args=ARGUMENTS,
            bypass_csp=True,  # the tests bring scripts of their own; test_gates.py looks at the policy itself
        )
        context.set_default_timeout(20_000)
        yield context
        context.close()


@pytest.fixture(scope="session")
def site():
    """The address of the built book on this machine."""
    if not (HTML / "index.html").exists():
        pytest.fail("there is no book to look at: run `make book` first")
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(HTML)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()


@pytest.fixture
def page(browser):
    """A tab that remembers what went wrong in it: ``page.complaints``, in words."""
    tab = browser.new_page()
    tab.complaints = []
    tab.on("console", lambda m: tab.complaints.append(f"console: {m.text}") if m.type == "error" else None)
    tab.on("pageerror", lambda error: tab.complaints.append(f"script: {error}"))
    tab.on("requestfailed", lambda r: tab.complaints.append(f"failed: {r.url}"))
    tab.on("response", lambda r: tab.complaints.append(f"{r.status}: {r.url}") if r.status >= 400 else None)
    tab.on("request", lambda r: tab.complaints.append(f"leaves the site: {r.url}") if _leaves(r.url) else None)
    yield tab
    tab.close()


def _leaves(url):
    return not url.startswith(("http://127.0.0.1:", "file://", "data:", "blob:", "about:"))
