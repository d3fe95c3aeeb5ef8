"""What the paper says, table by table, and what of it is not known here."""

from __future__ import annotations

from wakewise.studies.reproduce.claim import Claim
from wakewise.studies.reproduce.quoted_flights import ablation, flow, operator_claims, station
from wakewise.studies.reproduce.quoted_models import dynamic, field, sediment, success
from wakewise.studies.reproduce.quoted_parts import solver, wake

W_TRACKS = (1.0, 2.0, 5.0, 10.0, 20.0)

CLAIMS: dict[str, tuple[Claim, ...]] = {
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
"""By table; `comparison` has none of its own, since the paper's cells are not quoted here."""

UNKNOWN = (
    "which coral gave which RMSE: only the means of the four methods are quoted",
    "numbers of the ablation and of the sediment experiment, and the cells of both tables of methods",
    "against which method energy (31 %) and roll and pitch (45 %) are less: counted against `unaware`, asked of all",
    "success and completeness of the other methods",
    "a figure of 34 % that the paper itself lays to coverage: what it is a share of is not quoted",
    "features per image of its corals, 2847, 1856 and 982: by what detector is not quoted, ours do not rank alike",
)
"""What of the paper is not known here."""
