"""Server of the meter's page: state and history as JSON, polled five times per second, and three requests.

Polling passes through any proxy, also that of BlueOS. HTTP and access are those of `wakewise.ui.web.server`: this
computer needs no token, others do unless the pilot has opened the page to the network.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from wakewise.ui.web.blueos import ServiceDescription, as_json
from wakewise.ui.web.files import StaticFile, StaticFiles
from wakewise.ui.web.server import Site, WebServer

PAGE = Path(__file__).with_name("page")
OFFER = ServiceDescription(
    name="Wakewise wash meter",
    description="What the thrusters do to the target's water, and what gentler thrusts would spare. Listens only.",
    widget="Wakewise: wash meter",
)
PAGE_REQUESTS = ("mark", "unmark", "begin")

JsonSource = Callable[[], dict[str, Any]]
PageRequest = Callable[[str], str | None]


class MeterServer(WebServer):
    """Serves one meter; the port is reserved at once.

    `state`, `history`: content of /state.json and /history.json. `request` does one of `PAGE_REQUESTS` and returns why
    not, or None. `token`: whether callers from other computers need the token.

    Raises
    ------
    InputError
        If the port is in use, or the address is not one of this computer.
    """

    def __init__(
        self,
        state: JsonSource,
        history: JsonSource,
        request: PageRequest,
        host: str = "127.0.0.1",
        port: int = 0,
        *,
        token: bool = True,
    ) -> None:
        def answer(what: str) -> tuple[int, StaticFile]:
            why_not = request(what)
            return (200, as_json({"done": True})) if why_not is None else (409, as_json({"why_not": why_not}))

        site = Site(
            files=StaticFiles(folder=PAGE, more=OFFER.files()),
            private={"/state.json": lambda: as_json(state()), "/history.json": lambda: as_json(history())},
            post={f"/{what}": partial(answer, what) for what in PAGE_REQUESTS},
        )
        super().__init__(site, host, port, open_to_all=not token)
        self.bind()
