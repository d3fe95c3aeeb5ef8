"""Web server of the pages, for the cockpit and the wash meter.

`server.py`: HTTP server with access rules, JSON, POST requests and a WebSocket. `websocket.py`: the WebSocket.
`origin_check.py`: allowed hosts and origins, the token, bounds on connections. `files.py`: static files.
`blueos.py`: descriptions for BlueOS and BlueRobotics Cockpit. `page/`: style and scripts that all pages share.
"""
