"""The bytes of a PointCloud2."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.core.errors import InputError, WakewiseError
from wakewise_ardusub.ros import PointField, cloud_points

XYZ = (
    PointField(name="x", offset=0, datatype=7),
    PointField(name="y", offset=4, datatype=7),
    PointField(name="z", offset=8, datatype=7),
)


@pytest.mark.parametrize("big", [False, True])
def test_places_and_weights_are_read_from_padded_rows(big: bool) -> None:
    """Rows with padding, fields in another order and of another type, either byte order; NaN is nobody's point."""
    kind = np.dtype(
        {"names": ["z", "x", "y", "weight"], "formats": ["f8", "f4", "f4", "u2"], "offsets": [0, 8, 12, 16]}
    )
    kind = kind.newbyteorder(">" if big else "<")
    table = np.zeros((2, 3), dtype=kind)
    table["x"], table["y"], table["z"] = [[1, 2, np.nan], [4, 5, 6]], 0.5, [[-1, -2, -3], [-4, -5, -6]]
    table["weight"] = [[1, 2, 3], [4, 5, 6]]
    rows = [row.tobytes() + b"\xee" * 5 for row in table]
    names = {"x": 7, "y": 7, "z": 8, "weight": 4}
    fields = [PointField(name=name, offset=kind.fields[name][1], datatype=code) for name, code in names.items()]
    places, weights = cloud_points(fields, kind.itemsize, 3 * kind.itemsize + 5, 3, 2, big, b"".join(rows))
    np.testing.assert_array_equal(places, [[1, 0.5, -1], [2, 0.5, -2], [4, 0.5, -4], [5, 0.5, -5], [6, 0.5, -6]])
    np.testing.assert_array_equal(weights, [1, 2, 4, 5, 6])


def test_an_empty_cloud_is_no_target() -> None:
    """A sensor that sees nothing sends no points."""
    places, weights = cloud_points(XYZ, 12, 0, 0, 1, False, b"")
    assert places.shape == (0, 3)
    assert weights.shape == (0,)


@given(
    fields=st.lists(
        st.builds(
            PointField,
            name=st.sampled_from(["x", "y", "z", "weight", "rgb"]),
            offset=st.integers(-4, 40),
            datatype=st.integers(-1, 9),
        ),
        max_size=6,
    ),
    sizes=st.tuples(st.integers(-1, 40), st.integers(-1, 90), st.integers(-1, 4), st.integers(-1, 4)),
    data=st.binary(max_size=200),
)
def test_any_message_is_read_or_refused(
    fields: list[PointField], sizes: tuple[int, int, int, int], data: bytes
) -> None:
    """Sizes that lie never lead beyond the bytes; what is read is finite."""
    try:
        places, weights = cloud_points(fields, *sizes, False, data)
    except WakewiseError:
        return
    assert np.isfinite(places).all()
    assert (weights >= 0.0).all()


@pytest.mark.parametrize(
    ("fields", "sizes", "data", "said"),
    [
        (XYZ[:2], (12, 12, 1, 1), bytes(12), "no z"),
        (XYZ, (12, 12, 1, 1), bytes(11), "11 bytes, must be 12"),
        (XYZ, (12, 8, 1, 1), bytes(8), "do not agree"),
        (XYZ, (10, 10, 1, 1), bytes(10), "beyond points of 10"),
    ],
)
def test_a_cloud_that_does_not_fit_its_sizes_is_refused(
    fields: tuple[PointField, ...], sizes: tuple[int, int, int, int], data: bytes, said: str
) -> None:
    """One line says what does not."""
    with pytest.raises(InputError, match=said):
        cloud_points(fields, *sizes, False, data)
