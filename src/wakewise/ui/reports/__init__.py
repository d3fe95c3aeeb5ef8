"""Reports: one HTML file per trial, comparison, campaign, vehicle or model; it opens with no network.

- `report.py`: a trial's page; `model.py`: its part about the model; `compare.py`: trials side by side.
- `campaign.py`: a campaign; `methods_compared.py`: its methods. `vehicle/`: a vehicle. `target.py`: a target.
- `photo_preview.py`: photographs before the long stages. `photo_model/`: a model made of photographs.
- `page.py`: templates (`templates/`) and parts of a page. `text.py`, `references.py`: words, reference values.
- `figures.py`, `views.py`, `media.py`, `errors.py`, `scene3d.py`: pictures; `svg_style.py`: their colours.
- `trial.py`: reads a trial's folder.
"""

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.ui.reports.campaign import write_campaign
    from wakewise.ui.reports.compare import write_comparison
    from wakewise.ui.reports.page import PageParts
    from wakewise.ui.reports.report import begin_report, write_report

__all__ = ["PageParts", "begin_report", "write_campaign", "write_comparison", "write_report"]

lazy_attributes(__name__, "reports", "photos")
