"""The paper's tables beside ours: one page with pictures (`page.py`), or Markdown and small plots (`results.py`).

`sentences.py`: the findings in words. `plots.py`: the paper's figures from our data. `model_sheet.py`: worst models.
"""

from wakewise_paper.reports.reproduction.page import write_pages
from wakewise_paper.reports.reproduction.results import write_results

__all__ = ["write_pages", "write_results"]
