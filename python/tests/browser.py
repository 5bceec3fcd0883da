"""A page in headless Chromium that runs a script and reports its outcome, over a small server on this machine."""

from __future__ import annotations

import json
import shutil
import subprocess
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from queue import Queue
from threading import Thread
from typing import Any

import pytest

FLAGS = [
    "--headless=new",
    # Chromium's sandbox does not work for root in containers.
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-extensions",
    # No host outside this machine resolves.
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
    # WebGL on the CPU.
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--window-size=1000,900",
]

# The page runs the module `script.js`, whose default export is a function, and sends the value or error of its promise.
PAGE = b"""<!doctype html><meta charset="utf-8"><body><script type="module">
const send = (outcome) => fetch("/outcome", { method: "POST", body: JSON.stringify(outcome) });
try { send({ value: await (await import("./script.js")).default() }); }
catch (error) { send({ error: `${error.stack ?? error}` }); }
</script>"""

TYPES = {".js": "text/javascript", ".html": "text/html"}


def outcome(files: dict[str, bytes], profile: Path, timeout_s: float = 60) -> Any:
    """The value of the function that `script.js` of these files exports. Raises its error."""
    browser = shutil.which("chromium")
    if browser is None:
        pytest.fail("chromium is missing: `make test` installs it")
    outcomes: Queue[dict[str, Any]] = Queue()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            name = self.path.removeprefix("/") or "index.html"
            content = PAGE if name == "index.html" else files.get(name)
            self.send_response(404 if content is None else 200)
            self.send_header("content-type", TYPES.get(Path(name).suffix, "application/octet-stream"))
            self.end_headers()
            self.wfile.write(content or b"")

        def do_POST(self) -> None:
            outcomes.put(json.loads(self.rfile.read(int(self.headers["content-length"]))))
            self.send_response(204)
            self.end_headers()

        def log_message(self, format: str, *args: object) -> None:
            """Nothing: the log of pytest stays readable."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
    log = profile / "chromium.log"
    with log.open("wb") as errors:
        address = f"http://127.0.0.1:{server.server_address[1]}/"
        process = subprocess.Popen(
            [browser, *FLAGS, f"--user-data-dir={profile / 'profile'}", address], stdout=subprocess.DEVNULL, stderr=errors
        )
    try:
        found = outcomes.get(timeout=timeout_s)
    except Exception:
        pytest.fail(f"the page reports nothing in {timeout_s:g} s; the log of chromium:\n{log.read_text(errors='replace')}")
    finally:
        process.terminate()
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        server.shutdown()
        server.server_close()
    if "error" in found:
        pytest.fail(found["error"])
    return found["value"]
