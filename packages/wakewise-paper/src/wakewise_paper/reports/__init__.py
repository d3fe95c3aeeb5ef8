"""Pages and figures of the studies: wash reduction, operator, photograph robustness, wake models, the paper's
tables.
"""
