"""The door: detector reports in, state and map out, operator commands. One HTTP port.

It listens on loopback unless told otherwise; on any other address it wants bearer tokens. Every request passes
`guard`, which refuses in this order:

1. a Host that is not ours (421): another site's name that was made to resolve to this machine;
2. an Origin that is not ours (403): another site's page in the browser of somebody who can reach us;
3. no token, a wrong one, or one whose scope does not reach this far (401, 403);
4. more requests than allowed (429);
5. a body that is not JSON (415), too large (413, also when it comes in chunks) or too slow (408).
"""

from service.http.access import Access, Scope, read_access
from service.http.address import bind, split_address, url_of
from service.http.app import create_app
from service.http.run import PastRun, ShownRun
from service.http.server import Door, Server, open_door

__all__ = [
    "Access",
    "Door",
    "PastRun",
    "Scope",
    "Server",
    "ShownRun",
    "bind",
    "create_app",
    "open_door",
    "read_access",
    "split_address",
    "url_of",
]
