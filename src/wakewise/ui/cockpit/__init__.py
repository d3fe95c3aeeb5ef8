"""The pilot's page: a flight in the browser, and who controls it.

- `session.py`: from a scenario to flights that are shown. `server.py`: one port for page and socket, in its own thread.
- `view_model.py`: what the server asks of a session. `messages.py`: what a page may send. `client.py`: its queue.
- `control_mailbox.py`: who may fly (a lease), and where the flight reads the sticks.
- `flight_snapshot.py`, `state.py`: the state that is sent. `live_camera.py`: the camera, in its own process.
- `live_coverage.py`: coverage of the photographs. `scene.py`: the view from outside (viser).
- `page/`: HTML, style and JavaScript.
"""
