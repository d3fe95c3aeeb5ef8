"""User interface: pages (`reports/`), films (`film/`), the pilot's page (`cockpit/`), the web server (`web/`), plots
for scripts (`plot.py`), commands (`cli/`).
"""
