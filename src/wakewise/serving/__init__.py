"""Pages that a program of this package serves to a browser: who may ask for them, and what lies at which address.

`gate.py` says who may come in, `files.py` what is answered, `stations.py` what other ground stations are told of a
page. `page/` holds what every page has: colours, theme, drawing, numbers, icon. Standard library only, so that a page
can be served from the small computer of a vehicle.
"""
