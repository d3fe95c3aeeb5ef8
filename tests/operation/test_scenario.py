"""Scenarios: presets, files, overrides, and one-line errors that name the field."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel

from wakewise.core.errors import InputError
from wakewise.operation import PRESETS, Scenario, differences, load_scenario, parse_overrides, read_scenario
from wakewise.operation.renamed import GONE, METHODS_GONE, RENAMED, became
from wakewise.operation.scenario import dump_scenario


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_is_a_valid_scenario_that_survives_its_file(preset: str, tmp_path: Path) -> None:
    """A preset loads, and writing then reading it changes nothing."""
    scenario = load_scenario(preset, None, {})
    path = tmp_path / "scenario.yaml"
    path.write_text(dump_scenario(scenario, {"wakewise": "0"}))
    assert differences(scenario, read_scenario(path)) == []


def test_overrides_lie_over_files_and_files_over_presets(tmp_path: Path) -> None:
    """The last word has the override, then the file, then the preset, then the defaults."""
    path = tmp_path / "mine.yaml"
    path.write_text("seed: 7\nmission: {standoff_m: 0.6, speed_m_s: 0.2}\n")
    scenario = load_scenario("quick", path, {"mission.speed_m_s": 0.05})
    assert scenario.seed == 7
    assert scenario.mission.standoff_m == 0.6
    assert scenario.mission.speed_m_s == 0.05
    assert scenario.mission.views == (20, 16, 12)


def test_a_kind_of_silt_replaces_what_lies_below_and_yields_to_what_lies_beside_and_above(tmp_path: Path) -> None:
    """Over a scenario that spells out load and grains, a kind of silt sets them anew, unless they are set, too."""
    path = tmp_path / "scenario.yaml"
    path.write_text(dump_scenario(load_scenario("quick", None, {"tank.silt.kind": "caco3-50mg"})))
    assert load_scenario(None, path, {}).tank.silt.grain_m == 3e-4
    clear = load_scenario(None, path, {"tank.silt.kind": "clear"}).tank.silt
    assert (clear.load_kg_m2, clear.suspended_mg_l) == (0.0, 0.0)
    silty = load_scenario(None, path, {"tank.silt.kind": "silt"}).tank.silt
    assert (silty.load_kg_m2, silty.suspended_mg_l, silty.grain_m) == (0.1, 0.0, 20e-6)
    for changes in (
        {"tank.silt.load_kg_m2": 0.4, "tank.silt.kind": "silt"},
        {"tank.silt.kind": "silt", "tank.silt.load_kg_m2": 0.4},
    ):
        assert load_scenario(None, path, changes).tank.silt.load_kg_m2 == 0.4
    assert load_scenario(None, path, {"tank.silt.load_kg_m2": 0.3}).tank.silt.suspended_mg_l == 50.0
    path.write_text("tank: {silt: {kind: clear, load_kg_m2: 0.2}}\n")
    assert load_scenario(None, path, {}).tank.silt.load_kg_m2 == 0.2
    assert load_scenario(None, path, {"tank": {"silt": {"kind": "caco3-50mg"}}}).tank.silt.load_kg_m2 == 0.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"tank.silty": 0}, ["tank.silty", "no such field", "silt"]),
        ({"nonsense.deep.field": 1}, ["nonsense", "no such field"]),
        ({"mission.standoff_m": -0.5}, ["mission.standoff_m", "-0.5", "greater than 0"]),
        ({"mission.views": [20]}, ["mission", "one count per orbit"]),
        ({"tank.failures": [{"thruster": 1, "att_s": 3}]}, ["tank.failures.0.att_s", "at_s"]),
        ({"tank.silt.kind": "mud"}, ["tank.silt.kind", "caco3-50mg"]),
        ({"method": "magic"}, ["method", "magic", "dp", "wake-aware"]),
        ({"seed": float("nan")}, ["seed"]),
        ({"mission": 3}, ["mission"]),
    ],
)
def test_a_fault_is_one_line_with_field_finding_and_remedy(changes: dict[str, object], words: list[str]) -> None:
    """The message names the field, what was found and what is allowed, and has no line break."""
    with pytest.raises(InputError) as caught:
        load_scenario("quick", None, changes)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message


@pytest.mark.parametrize("text", ["- a\n- b\n", "just words", "a: [1, 2", "a: b: c", ""])
def test_a_file_that_is_no_scenario_is_refused_by_name(text: str, tmp_path: Path) -> None:
    """Lists, prose, broken YAML and empty files are refused with the file's name."""
    path = tmp_path / "odd.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"odd\.yaml"):
        load_scenario(None, path, {})
    with pytest.raises(InputError, match=r"gone\.yaml: no such file"):
        load_scenario(None, tmp_path / "gone.yaml", {})
    with pytest.raises(InputError, match="--preset"):
        load_scenario("huge", None, {})


@given(st.binary(max_size=200))
def test_random_bytes_never_end_in_anything_but_an_input_error(data: bytes) -> None:
    """Whatever a file holds, the reader returns a scenario or raises InputError."""
    import tempfile

    with tempfile.NamedTemporaryFile(suffix=".yaml") as file:
        file.write(data)
        file.flush()
        try:
            scenario = load_scenario(None, Path(file.name), {})
        except InputError as fault:
            assert "\n" not in str(fault)
        else:
            assert isinstance(scenario, Scenario)


def test_overrides_are_yaml_values() -> None:
    """Numbers, lists, words and null keep their kind; what is no pair is refused."""
    assert parse_overrides(
        ["tank.silt.load_kg_m2=0", "mission.views=[8, 8, 8]", "vehicle=paper", "tank.mismatch.trim_N=null"]
    ) == {
        "tank.silt.load_kg_m2": 0,
        "mission.views": [8, 8, 8],
        "vehicle": "paper",
        "tank.mismatch.trim_N": None,
    }
    for bad in ("silt", "=3", "a=[1"):
        with pytest.raises(InputError, match="--set"):
            parse_overrides([bad])


@pytest.mark.parametrize(
    "name", ["../x", "/abs/evil", "a/b", "a\\b", ".hidden", "..", " a", "a ", "a\nb", "a\x00b", "a\u202eb"]
)
def test_a_name_cannot_leave_its_folder(name: str) -> None:
    """A name becomes a folder's: separators, leading dots and what cannot be seen are refused in one line."""
    with pytest.raises(InputError, match=r"name: found .* names a folder") as caught:
        load_scenario("quick", None, {"name": name})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["scan", "Größe 2", "a..b", "reef-7_x", "珊瑚"])
def test_an_honest_name_is_kept(name: str) -> None:
    """Letters of any script, digits, inner dots and spaces are all a name."""
    assert load_scenario("quick", None, {"name": name}).name == name


def test_a_key_given_twice_is_refused_with_its_line(tmp_path: Path) -> None:
    """The second `seed` is not silently the one that counts, at the top or in a group."""
    path = tmp_path / "twice.yaml"
    path.write_text("seed: 1\nname: a\nseed: 2\n")
    with pytest.raises(InputError, match=r"twice\.yaml line 3: not YAML \(key seed given more than once\)"):
        load_scenario("quick", path, {})
    path.write_text("[" * 5000)
    with pytest.raises(InputError, match="too deep"):
        load_scenario("quick", path, {})
    with pytest.raises(InputError, match=r"--set a: .*too deep"):
        parse_overrides(["a=" + "[" * 5000])


@pytest.mark.parametrize(
    "text", ["seed: true", "seed: 12:30", "mission: {speed_m_s: true}", "tank: {silt: {load_kg_m2: yes}}"]
)
def test_neither_yes_nor_a_time_is_a_number(text: str, tmp_path: Path) -> None:
    """`true` is not 1 and `12:30` is not 750; a switch may be `true`, as before."""
    path = tmp_path / "odd.yaml"
    path.write_text(text + "\n")
    with pytest.raises(InputError, match=r"odd\.yaml: .*(number|integer)"):
        load_scenario("quick", path, {})
    path.write_text("tank: {jets: {inflow_loss: true}}\n")
    assert load_scenario("quick", path, {}).tank.jets.inflow_loss is True


@pytest.mark.parametrize("field", ["mission.speed_m_s", "mission.acceleration_m_s2"])
@pytest.mark.parametrize("value", [1e-300, 1e-9, 1e-6])
def test_a_speed_that_takes_months_is_refused(field: str, value: float) -> None:
    """Speeds and accelerations below a millimetre per second (squared) are refused before anything is computed."""
    with pytest.raises(InputError, match=rf"{field}: found .*0\.001"):
        load_scenario("quick", None, {field: value})


OLD_FIELDS = {
    "": "name seed method vehicle",
    "target": "kind size_m seed points delicate_gain",
    "mission": "elevations_deg views standoff_m speed_m_s acceleration_m_s2 approach_m settle_s clearance_m",
    "control": (
        "rate_hz kp_N_m kd_N_s_m ki_N_m_s estimator_lag_s gyro_lag_s integral_share hold_s w_disturbance "
        "w_effort w_previous obstacles"
    ),
    "control.wake": (
        "model sum floor edge_width_deg gain decay_power cosine_power soft_radius_m half_width_slope decay "
        "virtual_origin_diameters start_width_diameters"
    ),
    "control.plan": (
        "stages stage_s plan_hz w_disturbance w_effort w_change w_track w_path w_attitude w_twist w_time "
        "attitude_tolerance_rad rate_limit_N_s rho smooth_N edge_width_deg superposition quiet_gain "
        "exposure_s travel persistence clearance_m barrier_reach_m iterations tolerance second_start_every "
        "deadline_s"
    ),
    "control.levers": (
        "bed bed_points bed_radius_m bed_weight halo halo_points halo_m halo_weight quiet quiet_gain "
        "quiet_lead_s incoherent tilt_deg level_deg spare meet drift drift_m_s drift_s drift_spread_m_s "
        "drift_points drift_weight"
    ),
    "estimation": (
        "position_std_m attitude_std_rad tracking_std_m gyro_std_rad_s accelerometer_std_m_s2 depth_std_m "
        "gyro_bias_std_rad_s gyro_bias_walk_rad_s2 accelerometer_bias_std_m_s2 accelerometer_bias_walk_m_s3 "
        "acceleration_noise_m_s2 turning_noise_rad_s2 gain_std drag_std inertia_std current_std_m_s lasting_s "
        "pose_slow_std_m pose_slow_std_rad pose_slow_s force_std_N force_walk_N moment_std_N_m "
        "moment_walk_N_m start_std_m start_std_rad start_std_m_s start_std_rad_s settle_s gate gate_patience"
    ),
    "tank": (
        "size_m density_kg_m3 current_m_s current_file current_file_from_s current_file_to_s "
        "current_file_gain current_file_gap_s wave_amplitude_m wave_period_s wave_heading_deg pump_speed_m_s "
        "pump_diameter_m pump_at_m pump_towards background_m_s background_length_m turbulence swirl "
        "flow_step_s max_parcels water silt grain_m grain_density_kg_m3 suspended_mg_l pickup erosion_kg_m2_s "
        "erosion_threshold_Pa max_silt_particles trim_N trim_range_N mass_pct damping_pct added_mass_pct "
        "thrust_pct failures inflow_loss tether_diameter_m tether_length_m tether_from_m tether_at_B_m "
        "plant_step_s pose_rate_hz pose_noise_m pose_noise_rad pose_latency_s pose_dropout pose_range_m "
        "pose_outages_s tracking_rate_hz tracking_noise_m tracking_latency_s imu_rate_hz gyro_noise_rad_s "
        "gyro_bias_rad_s accelerometer_noise_m_s2 accelerometer_bias_m_s2 depth_rate_hz depth_noise_m"
    ),
    "imaging": (
        "width height fov_deg exposure_s instants samples distortion port_air_m port_glass_m port_index "
        "water_type ambient panels lamp lamp_offset_m gain flakes_per_m3 flakes_per_kg electrons_per_s "
        "photo_format jpeg_quality read_noise_e"
    ),
    "reconstruction": (
        "detector max_features first_octave peak_threshold matching exhaustive_up_to sequence_overlap "
        "pose_neighbours mapper bundle_iterations reprojection_px refine_camera position_priors prior_sigma_m "
        "min_registered dense dense_px dense_zoom stereo_paths stereo_partners agreeing_views agreement_px "
        "mesh mesh_depth threads random_seed"
    ),
}
"""Every field that a scenario had before research log 0018, by group."""


def leaves(model: type[BaseModel], prefix: str = "") -> list[str]:
    """Dotted names of the fields that hold values."""
    names: list[str] = []
    for name, field in model.model_fields.items():
        kind = field.annotation
        group = isinstance(kind, type) and issubclass(kind, BaseModel)
        names += leaves(kind, f"{prefix}{name}.") if group else [f"{prefix}{name}"]  # type: ignore[arg-type]
    return names


def test_a_scenario_has_at_most_220_fields() -> None:
    """What nobody would set, and no world, test, bench, study or document varies, is a constant with its argument."""
    assert len(leaves(Scenario)) <= 220


def test_every_field_of_an_older_scenario_is_still_one_or_is_told_what_became_of_it() -> None:
    """229 old names: each is a field, or the table says its new name, which exists, or why it is gone."""
    old = [f"{group}.{name}".lstrip(".") for group, names in OLD_FIELDS.items() for name in names.split()]
    new = set(leaves(Scenario))
    assert len(old) == len(set(old)) == 229
    for name in old:
        assert (name in new) + (name in RENAMED) + (name in GONE) == 1, name
    assert set(RENAMED) | set(GONE) <= set(old)
    assert set(RENAMED.values()) <= new


@pytest.mark.parametrize("name", [*RENAMED, *GONE])
def test_an_old_name_is_refused_with_what_became_of_it(name: str) -> None:
    """In one line, whichever value the older scenario had there."""
    with pytest.raises(InputError) as caught:
        load_scenario("quick", None, {name: 0.1})
    message = str(caught.value)
    assert message == f"scenario: {name}: {(RENAMED.get(name) and 'now ' + RENAMED[name]) or GONE[name]}"


def test_all_old_names_of_a_file_are_told_at_once_and_new_groups_are_not_taken_for_old_names() -> None:
    """A file of before names each of its old fields; `tank.silt` with fields of its own is the group of now."""
    with pytest.raises(
        InputError, match=r"tank\.trim_N: now tank\.mismatch\.trim_N; tank\.water: now tank\.silt\.kind"
    ):
        load_scenario(None, None, {"tank.trim_N": 0.3, "tank.water": "clear", "seed": 2})
    assert became("tank.silt", {"load_kg_m2": 0.2}) is None
    with pytest.raises(InputError, match=r"tank\.silt: now tank\.silt\.load_kg_m2"):
        load_scenario(None, None, {"tank.silt": 0.3})
    for method, words in METHODS_GONE.items():
        with pytest.raises(InputError, match=words.split(":")[0]):
            load_scenario(None, None, {"method": method})


def test_a_scenario_without_a_preset_is_gentle() -> None:
    """The levers that the tank bore out are defaults, and no preset speaks of control."""
    control = Scenario().control
    assert control.levers.spare and control.levers.meet and control.levers.drift and control.wake.floor
    assert control.levers.drift_m_s is None
    assert all(load_scenario(preset, None, {}).control == control for preset in PRESETS)
