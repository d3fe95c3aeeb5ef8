"""The model in the photographs' colours, for people: the water's veil undone, meshes with texture.

Nothing here enters a figure. Start reading in `textured.py` (a mesh coloured from its photographs) and
`photo_colours.py` (photographs without the water's veil); `colour.py` is the image formation model that both invert.
`atlas.py` puts photographs on a mesh as one picture, `orthophoto.py` sees a flat subject from straight above.
"""
