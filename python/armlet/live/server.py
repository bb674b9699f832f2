"""The server of a page. It imports viser on first use."""

from __future__ import annotations

import contextlib
import io
import socket
import sys
import time
from collections.abc import Callable
from typing import Any, TypeAlias

from ..errors import InputError
from ..extras import extra
from .origin import own_pages_only, refuses_strangers

__all__ = ["Server", "address", "close_server", "load_viser", "open_server", "serve"]

Server: TypeAlias = Any  # viser.ViserServer

LATE = 0.1  # largest time that one frame may simulate after a delay, s


def load_viser(command: str) -> Any:
    """Import and return the module viser.

    Raises:
        ImportError: viser is not installed; the message contains the install command.
    """
    return extra(command, "viser", "live")


def open_server(command: str, host: str, port: int) -> Server:
    """Return a server that listens at `host` and `port`. Port 0 selects any free port.

    Raises:
        ImportError: viser is not installed.
        InputError: the address or the port is not available.
    """
    viser = load_viser(command)
    # If the port is in use, viser would use the next one, and the page would not be at the requested address. So the port is tested first.
    try:
        with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
            port = probe.getsockname()[1]
    except (OSError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{command}: {host}:{port} cannot be listened at: {reason}") from None
    # viser prints messages at start and end. armlet prints the address instead.
    with contextlib.redirect_stdout(io.StringIO()), own_pages_only(host):
        server = viser.ViserServer(host=host, port=port, label=f"armlet {command}", verbose=False)
    if not refuses_strangers(host, server.get_port()):
        text = "this version of viser lets pages of other sites connect: do not open pages that you do not trust"
        print(f"armlet: {command}: {text}", file=sys.stderr)
    server.gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
    server.gui.main_panel.dock_right()
    return server


def address(server: Server) -> str:
    """The address of the page for a browser."""
    host = server.get_host()
    return f"http://{f'[{host}]' if ':' in host else host}:{server.get_port()}"


def serve(server: Server, frame: Callable[[float], None], period: float) -> int:
    """Print the address, and call `frame` every `period` s, or later if a call takes longer, until Ctrl-C. Return the exit code.

    The argument of `frame` is the time since its last call, s, at most LATE.
    """
    print(f"armlet: {address(server)} (Ctrl-C ends it)", flush=True)
    try:
        last = time.perf_counter()
        while True:
            now = time.perf_counter()
            frame(min(now - last, LATE))
            last = now
            time.sleep(max(0.0, period - (time.perf_counter() - now)))
    except KeyboardInterrupt:
        return 0
    finally:
        close_server(server)


def close_server(server: Server) -> None:
    """Stop a server and suppress its messages."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()
