"""Vision: rendering (`imaging/`), photographs to models (`reconstruction/`), texture (`texturing/`), scores
(`evaluation/`), particle image velocimetry (`piv/`).
"""
