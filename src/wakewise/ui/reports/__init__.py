"""Reports: one HTML page per trial or comparison, with plots, photographs and a 3D scene; it opens with no network.

Start reading in `report.py` (a trial's page, part by part; `model.py` is the part of its model, `page.py` keeps
what is made early) and `compare.py` (trials side by side). `trial.py` reads a trial's folder, `text.py` and
`references.py` say figures in words, `page.py` is HTML with its style and script, `figures.py`, `views.py`,
`media.py`, `errors.py`, `media.py` and `scene3d.py` are the pictures, `svg_style.py` their colours, `references.py`
what the water gets wrong, `report.py` what ballast the flight lacked, `model.py` what its photographs saw. Studies have
pages of their own: `wake.py` with `wake_plots.py`, `target.py`, `gentle.py`, `operator.py`, `degradation.py`;
`vehicle/` is a vehicle's, `log.py` with `log_plots.py` a real vehicle's log's, `photo_preview.py` that of a look at
photographs, `photo_model/` that of the model made from them, `campaign.py` a campaign's and `reproduce/` that of the
paper's tables (both with `methods_compared.py` and `methods_compared.py`).
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
