"""User interface: pages (`reports/`), films (`film/`), the pilot's page (`cockpit/`), the web server (`web/`), commands
(`cli/`).
"""
