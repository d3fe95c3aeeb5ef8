"""Experiments: one trial (`trials/`), many trials and their statistics (`campaigns/`), files for other tools
(`exports/`).
"""
