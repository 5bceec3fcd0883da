"""The playback widget: its sources, and its code in a browser."""

from __future__ import annotations

import base64
import json
import os
import subprocess
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from threading import Thread

import pytest

from roost.errors import RoostError
from roost.playback import Player, Source

from browser import outcome

TESTS = Path(__file__).parent
SCENARIO = {
    "experiment": "hopper",
    "product": {"count": 4, "subparticle_radius_m": 0.009},
    "equipment": {"hopper_width_m": 0.15, "side_walls": "frictionless"},
    "numerics": {"timestep_s": "auto", "duration_s": 0.5},
}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with the frames of a small simulation."""
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "hopper.json").write_text(json.dumps(SCENARIO))
    command = [os.environ["ROOST_COMMAND"], "run", "hopper.json", "-o", "out", "--backend", "cpu"]
    frames = ["--frames", "frames", "--frame-format", "web", "--frame-interval", "0.02"]
    subprocess.run([*command, *frames], cwd=folder, check=True, capture_output=True)
    return folder / "frames"


def test_the_widget_plays_in_a_browser(recorded: Path, tmp_path: Path) -> None:
    player = Player(recorded, frame=1, colour="speed")
    state = {name: getattr(player, name) for name in ("frame", "colour", "view", "_style")}
    files = {
        "script.js": (TESTS / "playing.js").read_bytes(),
        "esm.js": str(player._esm).encode(),
        "state.json": json.dumps(state).encode(),
        "frames": player.content,
    }
    seen = outcome(files, tmp_path)
    (tmp_path / "canvas.png").write_bytes(base64.b64decode(seen["image"].split(",")[1]))
    assert seen["second"] > seen["first"] > 0, "time advances"
    assert seen["subparticles"] > 40
    assert seen["colours"] > 20, "nothing is drawn"
    # The style of the dashboard is there, and the address of the notebook stays.
    assert seen["height"] > 300 and seen["button"] == "rgb(11, 95, 165)" and seen["is_same_page"]
    assert seen["saved"]["frame"] > 1 and len(seen["saved"]["view"].split(",")) == 3
    # Other bytes take the place of the first, and an end leaves nothing behind.
    assert "not a stream of frames" in seen["fault"] and seen["canvases"] == 0
    assert seen["listening"] == 0


def test_frames_come_from_files_jobs_and_addresses(recorded: Path) -> None:
    content = (recorded / "run.roostframes").read_bytes()

    class Job:
        """As a job of a server."""

        def frames(self, path: str | os.PathLike[str], /) -> Path:
            Path(path).write_bytes(content)
            return Path(path)

    with server(content) as address:
        sources: list[Source] = [recorded, str(recorded / "run.roostframes"), content, Job()]
        players = [Player(source) for source in sources] + [Player(address, token="secret")]
        assert all(player.content == content for player in players)
        with pytest.raises(RoostError, match="401"):
            Player(address)


def test_a_source_without_frames_is_refused(recorded: Path, tmp_path: Path) -> None:
    with pytest.raises(RoostError, match="cannot be read"):
        Player(tmp_path / "absent.roostframes")
    with pytest.raises(RoostError, match="not a stream of frames"):
        Player(b"PNG")


class server:  # noqa: N801, a context manager that is used as a function
    """A server of frames that asks for a token."""

    def __init__(self, content: bytes) -> None:
        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                is_allowed = self.headers["authorization"] == "Bearer secret"
                self.send_response(200 if is_allowed else 401)
                self.end_headers()
                self.wfile.write(content if is_allowed else b"")

            def log_message(self, format: str, *args: object) -> None:
                """Nothing."""

        self.server = HTTPServer(("127.0.0.1", 0), Handler)

    def __enter__(self) -> str:
        Thread(target=self.server.serve_forever, args=(0.01,), daemon=True).start()
        return f"http://127.0.0.1:{self.server.server_address[1]}/frames"

    def __exit__(self, *error: object) -> None:
        self.server.shutdown()
        self.server.server_close()
