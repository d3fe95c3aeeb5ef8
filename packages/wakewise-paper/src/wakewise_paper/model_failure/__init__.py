"""Where wash ruins a model: candidate mechanisms one by one, dose and response, what helps (`wakewise bench models`).

- `cases.yaml`: what is flown, written down before it was; `cases.py` reads it.
- `bench.py`: the study and its tables.
"""
