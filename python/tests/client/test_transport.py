"""Requests to servers that stop, start again, limit requests, or want tokens."""

from __future__ import annotations

import subprocess
import threading
import time

import pytest

from roost.api.events import parse
from roost.errors import ApiError

from .servers import ROOST, Farm, hopper


def test_requests_and_events_survive_a_restart(own_farm: Farm) -> None:
    server = own_farm.serve()
    client = own_farm.client(patience_s=20)
    job = client.submit_job(hopper())
    kinds: list[str] = []

    def watch() -> None:
        for event in job.watch():
            kinds.append(event.kind)

    watcher = threading.Thread(target=watch)
    watcher.start()
    deadline = time.monotonic() + 60
    while not kinds:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    server.kill()
    server.wait()
    restart = threading.Timer(0.5, own_farm.serve)
    restart.start()
    # The request waits for the server.
    assert client.job(job.id).state == "queued"
    restart.join()
    own_farm.work()
    watcher.join(timeout=120)
    assert job.state == "succeeded" and kinds[0] == "job" and "resumed" in kinds


def test_a_stream_that_was_quiet_for_longer_than_the_patience_goes_on(own_farm: Farm) -> None:
    server = own_farm.serve()
    client = own_farm.client(patience_s=1)
    job = client.submit_job(hopper())
    stream = job.watch()
    assert next(stream).kind == "job"
    time.sleep(1.2)
    server.kill()
    server.wait()
    own_farm.serve()
    assert next(stream).kind == "resumed"


def test_a_limit_of_requests_slows_a_client_down(own_farm: Farm) -> None:
    own_farm.serve("--max-requests-per-s", "1")
    client = own_farm.client()
    started = time.monotonic()
    for _ in range(3):
        client.version()
    assert time.monotonic() - started > 0.5
    with pytest.raises(ApiError) as caught:
        impatient = own_farm.client(patience_s=0)
        for _ in range(9):
            impatient.version()
    assert caught.value.status == 429


def test_a_token_is_sent_and_its_lack_is_an_error(own_farm: Farm, monkeypatch: pytest.MonkeyPatch) -> None:
    own_farm.serve()
    data = str(own_farm.folder / "data")
    made = subprocess.run(
        [ROOST, "token", "create", "--data", data, "--scope", "read", "--name", "test"], check=True, stdout=subprocess.PIPE
    )
    token = made.stdout.decode().split()[-1]
    deadline = time.monotonic() + 60
    while True:
        try:
            own_farm.client().jobs()
        except ApiError as error:
            assert error.status == 401
            break
        assert time.monotonic() < deadline
        time.sleep(0.1)
    monkeypatch.setenv("ROOST_SERVER", own_farm.url)
    monkeypatch.setenv("ROOST_TOKEN", token)
    from roost.client import Client

    with Client() as client:
        assert client.url == own_farm.url and client.jobs() == []
        with pytest.raises(ApiError) as caught:
            client.submit_job(hopper())
    assert caught.value.status == 403


def test_lines_of_a_stream_become_events() -> None:
    lines = ["event: job", 'data: {"a":', "data: 1}", "id: 7", "", ": comment", "", "event: cut", "data: {}"]
    (event,) = parse(lines)
    assert (event.kind, event.data, event.id) == ("job", {"a": 1}, "7")
