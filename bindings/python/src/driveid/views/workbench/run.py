# SPDX-License-Identifier: Apache-2.0
"""Start of the workbench: address, token, first project, browser."""

from __future__ import annotations

import secrets
import socket as sockets
import webbrowser
from collections.abc import Callable
from pathlib import Path

import uvicorn

from .app import Workbench
from .engine import Engine
from .live import Live
from .projects import Project, Projects, bundled_example
from .security import TokenGate

LOOPBACK = "127.0.0.1"


def free_port(host: str) -> int:
    with sockets.socket() as s:
        s.bind((host, 0))
        return s.getsockname()[1]


def build(projects: Projects, control_socket: str, port: int, token: str, host: str = LOOPBACK, project: Project | None = None, engine: Engine | None = None) -> tuple[TokenGate, str]:
    """The application behind its gate, and the address with the token."""
    first = project or (None if projects.all() else bundled_example())
    id = projects.add(first) if first else projects.all()[0].id
    page = "live" if project is None and Path(control_socket).exists() else "compare"
    start = "/live" if page == "live" else f"/compare?p={id}"
    workbench = Workbench(projects, engine or Engine(), Live(control_socket), start, token)
    names = {host, LOOPBACK, "localhost"} if host in (LOOPBACK, "localhost") else {host, LOOPBACK, "localhost", sockets.gethostname(), sockets.getfqdn()}
    hosts = {f"{name.lower()}:{port}" for name in names}
    address = f"http://{host if host != '0.0.0.0' else sockets.gethostname()}:{port}/?token={token}"
    return TokenGate(workbench, token, hosts, port), address


def run(project: Project | None = None, control_socket: str = "/run/driveid/control.sock", host: str = LOOPBACK, port: int = 0, browser: bool = True, say: Callable[[str], None] = print) -> None:
    """Serve until interrupted. Any host but loopback is the caller's explicit wish and is said aloud."""
    port = port or free_port(host)
    gate, address = build(Projects(), control_socket, port, secrets.token_urlsafe(24), host, project)
    say(f"driveid workbench: {address}")
    if host not in (LOOPBACK, "localhost"):
        say(f"It listens on {host}: whoever has this address can read the files of this user through it. The connection is not encrypted.")
    if browser:
        webbrowser.open(address)
    uvicorn.run(gate, host=host, port=port, log_level="warning", ws="websockets-sansio", timeout_graceful_shutdown=1)
