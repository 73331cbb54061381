# SPDX-License-Identifier: Apache-2.0
"""Who may look: a token in the address, kept as a cookie, and names of this host only (against DNS rebinding)."""

from __future__ import annotations

import hmac
from http.cookies import SimpleCookie
from urllib.parse import parse_qsl, urlencode

REFUSED = b"This page needs the whole address that `driveid workbench` printed, with its token.\n"
HEADERS = [
    (b"content-security-policy", b"default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'self'"),
    (b"x-content-type-options", b"nosniff"), (b"referrer-policy", b"no-referrer"), (b"cross-origin-resource-policy", b"same-origin"),
]


class TokenGate:
    """ASGI layer round the whole application: nothing, not even a style sheet, is given without the token."""

    def __init__(self, workbench, token: str, hosts: set[str], port: int) -> None:
        self.workbench, self.app = workbench, workbench.application()
        self.token, self.hosts, self.port = token, hosts, port
        self.cookie = f"driveid_{port}"

    async def __call__(self, scope, receive, send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = {k.decode("latin1").lower(): v.decode("latin1") for k, v in scope["headers"]}
        query = dict(parse_qsl(scope["query_string"].decode("latin1"), keep_blank_values=True))
        given = query.pop("token", None)
        allowed = self._host(headers) and self._origin(scope, headers) and self._known(given, headers)
        if not allowed:
            await self._refuse(scope, receive, send)
        elif given is not None and scope["type"] == "http" and scope["method"] == "GET":
            await self._enter(scope, query, send)
        else:
            await self.app(scope, receive, self._hardened(send))

    def _host(self, headers: dict[str, str]) -> bool:
        return headers.get("host", "").lower() in self.hosts

    def _origin(self, scope, headers: dict[str, str]) -> bool:
        """Requests that change something or open a socket must come from these pages."""
        origin = headers.get("origin")
        if origin is None:
            return scope["type"] == "http"
        return origin.split("//", 1)[-1].lower() in self.hosts

    def _known(self, given: str | None, headers: dict[str, str]) -> bool:
        if given is None:
            cookie = SimpleCookie(headers.get("cookie", "")).get(self.cookie)
            given = cookie.value if cookie else ""
        return hmac.compare_digest(given.encode(), self.token.encode())

    async def _refuse(self, scope, receive, send) -> None:
        if scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 4403})
            return
        await send({"type": "http.response.start", "status": 403, "headers": [(b"content-type", b"text/plain; charset=utf-8"), *HEADERS]})
        await send({"type": "http.response.body", "body": REFUSED})

    async def _enter(self, scope, query: dict, send) -> None:
        """Keep the token as a cookie and take it out of the address bar."""
        where = scope["path"] + (f"?{urlencode(query)}" if query else "")
        cookie = f"{self.cookie}={self.token}; HttpOnly; SameSite=Strict; Path=/"
        await send({"type": "http.response.start", "status": 303, "headers": [(b"location", where.encode()), (b"set-cookie", cookie.encode()), *HEADERS]})
        await send({"type": "http.response.body", "body": b""})

    @staticmethod
    def _hardened(send):
        async def wrapped(message) -> None:
            if message["type"] == "http.response.start":
                message = {**message, "headers": [*message.get("headers", []), *HEADERS]}
            await send(message)
        return wrapped
