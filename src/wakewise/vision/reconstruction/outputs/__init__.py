"""What comes out: point files and the surface.

- `clouds.py`: PLY and LAS files of points, PLY files of meshes. `meshing.py`: screened Poisson surface.
"""
