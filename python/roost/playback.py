"""Playback of recorded frames in a notebook, by the player of the dashboard.

`Player(result)` as the last line of a cell shows it. The frames come from `roost.run(frames=…)`, `roost run --frames`, or a job of a server.
The file goes to the browser as a whole: a simulation of the whole hopper has about 13 MB.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Protocol, Union, runtime_checkable
from urllib.parse import urlsplit, urlunsplit

from roost.errors import RoostError
from roost.result import Result

try:
    import anywidget
    import traitlets
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(f"{error.msg}: pip install 'roost[notebook]' brings it", name=error.name) from None

_FOLDER = Path(__file__).parent / "_player"
_MAGIC = b"ROOSTF\r\n"
_STREAM = "run.roostframes"


@runtime_checkable
class Recorded(Protocol):
    """A job with recorded frames, such as `roost.api.jobs.Job`."""

    def frames(self, path: str | os.PathLike[str], /) -> Path:
        """Downloads the frames into a file."""
        ...


Source = Union[str, "os.PathLike[str]", bytes, Result, Recorded]


def _code(name: str) -> str:
    file = _FOLDER / name
    if not file.exists():
        raise RoostError(f"{file} is missing: in the sources, `python3 python/stage.py` makes it")
    return file.read_text(encoding="utf-8")


class Player(anywidget.AnyWidget):
    """Plays the frames of a simulation.

    The source is the result of `roost.run(frames=…)`, a file with a stream of frames (`run.roostframes`), the folder of
    `roost run --frames`, the address of such a file (`http://…/v1/jobs/ID/frames`), a job of `roost.Client`, or the bytes of the stream.

    The choices of the reader are in `frame`, `colour` and `view` as soon as the playback pauses. They may be given as arguments to start
    with.

    Raises `RoostError` if the source is no stream of frames, or cannot be read.
    """

    content = traitlets.Bytes().tag(sync=True)
    """The stream of frames, as docs/frames.md describes it. Another stream takes its place at once."""
    frame = traitlets.Int(0).tag(sync=True)
    """The frame that is shown, from 0."""
    colour = traitlets.Enum(["body", "speed", "damage"], default_value="body").tag(sync=True)
    """The value that colours sub-particles."""
    view = traitlets.Unicode("").tag(sync=True)
    """The camera: azimuth and elevation in radians, and distance. Empty for the usual one."""
    _style = traitlets.Unicode().tag(sync=True)

    def __init__(self, source: Source, *, frame: int = 0, colour: str = "body", view: str = "", token: str | None = None) -> None:
        """`token` is an access token of the server, for an address."""
        self._esm = _code("player.js")
        content = _read(source, token)
        super().__init__(content=content, frame=frame, colour=colour, view=view, _style=_code("style.css"))

    @traitlets.validate("content")
    def _check(self, proposal: dict[str, Any]) -> bytes:
        content = bytes(proposal["value"])
        if not content.startswith(_MAGIC):
            raise RoostError("this is not a stream of frames, the run.roostframes of `roost run --frames`")
        return content


def _read(source: Source, token: str | None) -> bytes:
    if isinstance(source, bytes):
        return source
    if isinstance(source, Result):
        if source.frames is None:
            raise RoostError("the run of this result has recorded no frames: roost.run(scenario, frames=FOLDER) records them")
        source = source.frames
    if isinstance(source, Recorded):
        return _of_job(source)
    if isinstance(source, str) and urlsplit(source).scheme in ("http", "https"):
        return _download(source, token)
    path = Path(source)
    try:
        return (path / _STREAM if path.is_dir() else path).read_bytes()
    except OSError as error:
        raise RoostError(f"the frames cannot be read: {error}") from error


def _of_job(job: Recorded) -> bytes:
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        return job.frames(Path(folder) / _STREAM).read_bytes()


def _download(address: str, token: str | None) -> bytes:
    from roost.api.transport import Transport

    parts = urlsplit(address)
    # Without a token of the caller, none is sent: the address may be of another server than that of ROOST_TOKEN.
    transport = Transport(f"{parts.scheme}://{parts.netloc}", token or "")
    try:
        return transport.send("GET", urlunsplit(("", "", parts.path, parts.query, ""))).content
    finally:
        transport.close()
