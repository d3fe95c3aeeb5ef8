"""The page of a model made from photographs: `page.py` its parts, `page.py` that on metres, `page.py` rows of text,
`page.py` the model and its cameras in 3D.
"""

from wakewise.ui.reports.photo_model.page import write_model_report

__all__ = ["write_model_report"]
