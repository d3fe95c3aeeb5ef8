"""The pilot's page: a flight in the browser, its helm, and who may hold it.

Start reading in `session.py` (a scenario becomes flights that are shown) and `server.py` (one port for page and socket,
in a thread that no flight waits for; `view_model.py` is what it asks for). `control_mailbox.py` says who may fly and
which sticks count, `control_mailbox.py` is where the flight reads them; `messages.py` is what a page may say,
`client.py` what waits to be sent to it; `requests.py` is one connection before that, `requests.py` what a request is
answered, `requests.py` the page's files in `page/` and what other ground stations ask for. Who may come
in, and how many may wait, is `serving`'s. What is shown: `flight_snapshot.py` takes it down in the flight's thread,
`state.py` holds flown thrusts against direct ones, `state.py` makes numbers of it, `live_coverage.py` follows
the photographs, `live_camera.py` draws the camera's picture in a process of its own, `client.py` says when and for
whom, `scene.py` is viser's view from outside. `latency.py` measures how a flight under a page keeps its time.
"""
