"""Pages that a program of this package serves to a browser: who may ask for them, and what lies at which address.

`origin_check.py` says who may come in, `origin_check.py` how many may wait at the door, `files.py` what is answered,
`origin_check.py` where others find a page, `blueos.py` what other ground stations are told of it. `page/` holds what
every page has: colours, theme, drawing, numbers, icon. Standard library only, so that a page can be served from the
small computer of a vehicle.
"""
