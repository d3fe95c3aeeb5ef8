"""Colours of models and photographs, for display; no figure depends on them.

- `colour.py`: removal of the water from a photograph, colour balance without ranges.
- `photo_colours.py`: corrected copies of a folder of photographs; ranges of a model in its photographs.
- `textured.py`: vertex colours, GLB. `atlas.py`: texture atlas, OBJ and GLB.
- `orthophoto.py`: a flat subject from above.
"""
