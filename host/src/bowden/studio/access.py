"""Access control of the page: this machine, the browser that opened the address, that page.

The address that the command prints has a token that works once; it is exchanged for a cookie. A
page of another site can reach a port of this machine, but it has neither the cookie (SameSite) nor
our origin, and a name that resolves to this machine is not the one in our Host header.
"""

from __future__ import annotations

import secrets
from http.cookies import CookieError, SimpleCookie

COOKIE = "bowden_studio"
HOST = "127.0.0.1"


class Access:
    """Token, cookie and origin of one server.

    Parameters
    ----------
    port : int
        That it listens on.
    """

    def __init__(self, port: int) -> None:
        self.netloc = f"{HOST}:{port}"
        self.origin = f"http://{self.netloc}"
        self._token: str | None = secrets.token_urlsafe(32)
        self.cookie = secrets.token_urlsafe(32)

    @property
    def address(self) -> str:
        """What to open in a browser; works once."""
        return f"{self.origin}/?token={self._token}"

    def take_token(self, offered: str) -> bool:
        """Return whether this is the token, which is used up by that."""
        if self._token is None or not secrets.compare_digest(
            offered.encode(), self._token.encode()
        ):
            return False
        self._token = None
        return True

    def is_ours(self, host: str, cookie_header: str, origin: str | None) -> bool:
        """Return whether a request is the page's: right host, cookie and, where told, origin."""
        if host != self.netloc or origin not in (None, self.origin):
            return False
        try:
            morsel = SimpleCookie(cookie_header).get(COOKIE)
        except CookieError:
            return False
        return morsel is not None and secrets.compare_digest(
            morsel.value.encode(), self.cookie.encode()
        )
