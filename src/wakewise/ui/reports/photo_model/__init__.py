"""The page of a model made from photographs: `page.py` its parts, `scale.py` that on metres, `rows.py` rows of text,
`scene.py` the model and its cameras in 3D.
"""

from wakewise.ui.reports.photo_model.page import write_model_report

__all__ = ["write_model_report"]
