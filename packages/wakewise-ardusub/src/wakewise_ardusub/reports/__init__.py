"""Pages about logs of real vehicles: `log.py` writes the page, `log_plots.py` draws its figures."""
