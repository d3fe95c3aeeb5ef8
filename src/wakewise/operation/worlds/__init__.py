"""Where a flight really takes place: worlds by name (`library.py`, a YAML file each), and what makes one from the parts
of a flight (`makers.py`): water of parcels, or water that answers at once.
"""
