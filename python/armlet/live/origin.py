"""Access to the server of a page: the page itself and programs that send no origin have access, pages of other sites do not.

    refused unless  Host is an IP address or a name of this machine  and  (no Origin, or Origin = http(s)://Host)

A browser sends the origin of the page when it opens a websocket. Any page may open a websocket to this machine. Without this check a page
of another site could read the robot and move the sliders. A foreign DNS server may map its name to this machine; such a name is refused.
"""

from __future__ import annotations

import importlib
import ipaddress
import socket
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any
from urllib.parse import urlsplit

__all__ = ["allowed", "own_pages_only", "refuses_strangers"]

STRANGER = "http://stranger.invalid"


def allowed(headers: Any, host: str) -> bool:
    """Whether the server at `host` allows a request with these headers, by the rule in the docstring of this module."""
    hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
    if len(hosts) != 1 or len(origins) > 1:
        return False
    try:
        name = urlsplit(f"//{hosts[0]}").hostname or ""
        origin = urlsplit(origins[0]) if origins else None
    except ValueError:
        return False
    if name not in {"localhost", host.lower(), socket.gethostname().lower()} and not _is_address(name):
        return False
    return origin is None or (origin.scheme in ("http", "https") and origin.netloc.lower() == hosts[0].lower())


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


@contextmanager
def own_pages_only(host: str) -> Iterator[None]:
    """Inside this context, a server that viser starts answers only `allowed` requests.

    viser has no option for this check. It starts its server by `websockets.asyncio.server.serve`. Here that function is replaced by one
    that passes the option `process_request`.
    """
    module = importlib.import_module("websockets.asyncio.server")
    plain = module.serve

    def serve(*arguments: Any, process_request: Any = None, **keywords: Any) -> Any:
        def first(connection: Any, request: Any) -> Any:
            if not allowed(request.headers, host):
                return connection.respond(403, "armlet: refused: expected a page of this server\n")
            return None if process_request is None else process_request(connection, request)

        return plain(*arguments, process_request=first, **keywords)

    module.serve = serve  # type: ignore[attr-defined]
    try:
        yield
    finally:
        module.serve = plain  # type: ignore[attr-defined]


def refuses_strangers(host: str, port: int) -> bool:
    """Request a websocket with the origin of another site. Return whether the server answers with the status 403."""
    here = {"0.0.0.0": "127.0.0.1", "::": "::1", "": "127.0.0.1"}.get(host, host)
    lines = [f"Host: localhost:{port}", f"Origin: {STRANGER}", "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13"]
    request = "\r\n".join(["GET / HTTP/1.1", *lines, "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==", "", ""])
    try:
        with closing(socket.create_connection((here, port), timeout=5.0)) as asking:
            asking.sendall(request.encode("ascii"))
            return asking.recv(64).startswith(b"HTTP/1.1 403")
    except OSError:
        return False
