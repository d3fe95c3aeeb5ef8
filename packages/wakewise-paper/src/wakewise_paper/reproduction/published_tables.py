"""What the paper says, table by table, and what of it is not known here."""

from __future__ import annotations

from wakewise_paper.reproduction.claim import PublishedFigure
from wakewise_paper.reproduction.published_flights import ablation, flow, operator_claims, station
from wakewise_paper.reproduction.published_models import dynamic, field, sediment, success
from wakewise_paper.reproduction.published_parts import solver, wake

W_TRACKS = (1.0, 2.0, 5.0, 10.0, 20.0)

CLAIMS: dict[str, tuple[PublishedFigure, ...]] = {
    "dynamic": tuple(dynamic()),
    "success": tuple(success()),
    "station": tuple(station()),
    "ablation": tuple(ablation()),
    "sediment": tuple(sediment()),
    "flow": tuple(flow()),
    "solver": tuple(solver()),
    "wake": tuple(wake()),
    "field": tuple(field()),
    "operator": tuple(operator_claims(W_TRACKS)),
    "comparison": (),
}
"""By table; `comparison` has none of its own, since the paper's cells are words, which are not quoted here."""

UNKNOWN = (
    "which coral gave which RMSE: only the means of the four methods are given",
    "wash of the ablation's parts: its table has RMSE and success of models, our table has the wash of flights",
    "silt: the paper gives the disturbance (62 % less) and RMSE (about 40 % more) in its water with silt, not the silt",
    "a figure of 34 % that the paper itself lays to coverage: what it is a share of is not quoted",
    "features per image of its corals, 2847, 1856 and 982, and of its methods, 156, 342, 448 and 523: by what detector "
    "is not quoted, ours do not rank alike",
)
"""What of the paper is not known here, or measures something else than our tables do."""
