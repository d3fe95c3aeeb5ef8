"""The paper's tables beside ours: one page with pictures (`page.py`), or Markdown and small plots (`results.py`).

`sentences.py` says in both what was found, `plots.py` redraws the paper's figures from our data.
"""

from wakewise_paper.reports.reproduction.page import write_pages
from wakewise_paper.reports.reproduction.results import write_results

__all__ = ["write_pages", "write_results"]
