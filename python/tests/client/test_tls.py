"""Certificates of https servers: those of the system and of a file are trusted, and no others."""

from __future__ import annotations

import ssl
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from threading import Thread

import pytest

from roost.api.transport import Transport
from roost.client import Client, Unreachable

# A certificate of 127.0.0.1 and its key, for this test alone.
CERTIFICATE = Path(__file__).parent / "tls.pem"


@pytest.fixture
def address() -> Iterator[str]:
    """A server over https."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.end_headers()
            self.wfile.write(b"{}")

        def log_message(self, format: str, *args: object) -> None:
            """Nothing."""

    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(CERTIFICATE)
    server = HTTPServer(("127.0.0.1", 0), Handler)
    server.socket = context.wrap_socket(server.socket, server_side=True)
    Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
    yield f"https://127.0.0.1:{server.server_address[1]}"
    server.shutdown()
    server.server_close()


def test_the_authorities_of_the_system_are_trusted(address: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("ROOST_CA", raising=False)
    for name in ("SSL_CERT_FILE", "SSL_CERT_DIR"):
        monkeypatch.setenv(name, str(tmp_path))
    with pytest.raises(Unreachable, match="CERTIFICATE_VERIFY_FAILED"):
        Client(address, "", patience_s=0).version()
    # By this variable OpenSSL finds the authorities of a system in another place.
    monkeypatch.setenv("SSL_CERT_FILE", str(CERTIFICATE))
    assert not Client(address, "").version()


def test_a_file_takes_the_place_of_the_systems_authorities(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert not Client(address, "", ca=CERTIFICATE).version()
    monkeypatch.setenv("ROOST_CA", str(CERTIFICATE))
    transport = Transport(address, "")
    assert transport.get("/v1/version") == {}
    transport.close()
