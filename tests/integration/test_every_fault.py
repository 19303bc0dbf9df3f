"""Every fault that the mock can have is flown into by the real service, in the tests that this table names."""

from __future__ import annotations

import ast
from pathlib import Path

from sim.autopilot.fault_kinds import KINDS

DOUBTFUL = "test_what_is_told_no_longer_or_cannot_be_holds_the_search_until_it_passes"
HARMLESS = "test_what_says_nothing_about_the_flight_does_not_touch_it"
HEIGHT = "test_the_height_over_the_ground_stays_when_what_it_is_counted_from_moves"
TAKEN = "test_who_takes_the_aircraft_has_it_until_an_operator_resumes"
BATTERY = "test_a_battery_that_is_low_or_not_told_leads_home"
LACKS = "test_what_a_vehicle_lacks_is_said_before_the_ground_is_left"

ANSWERS: dict[str, tuple[str, ...]] = {
    "link_lost": ("test_a_silent_autopilot_is_waited_for_and_nothing_is_sent_blindly",),
    "packets": ("test_a_bad_radio_does_not_keep_the_search_from_its_target",),
    "acks_lost": ("test_lost_acknowledgements_do_not_keep_the_search_from_its_target",),
    "not_flown": ("test_a_waypoint_that_is_accepted_and_not_flown_holds_until_an_operator_resumes",),
    "frozen": ("test_a_frozen_autopilot_that_still_heartbeats_is_not_steered",),
    "gps_lost": (
        "test_a_short_loss_of_gps_holds_and_passes",
        "test_the_autopilots_own_landing_without_a_position_is_not_disturbed",
    ),
    "gps_jump": ("test_a_jump_of_the_position_holds_and_what_is_reported_meanwhile_is_not_believed",),
    "ekf_bad": (
        "test_the_autopilots_own_landing_without_a_position_is_not_disturbed",
        "test_a_search_goes_on_after_an_estimate_that_was_bad_for_a_while",
    ),
    "battery": ("test_a_low_battery_flies_home_and_says_so",),
    "battery_critical": (
        "test_a_critical_battery_that_the_autopilot_flies_home_with_is_not_steered_against",
    ),
    "wind": (
        "test_an_aircraft_that_is_blown_out_of_the_area_flies_home",
        "test_a_wind_that_it_cannot_fly_against_is_noticed",
    ),
    "reboot": ("test_a_reboot_in_flight_is_told_and_answered_by_nothing_that_moves",),
    "pilot": (
        "test_a_pilots_mode_change_stops_all_motion_until_an_operator_resumes",
        "test_a_pilots_sticks_stop_all_motion",
        "test_a_pilot_who_stops_the_climb_is_not_an_error",
    ),
    "failsafe": ("test_the_autopilots_own_return_is_left_alone_and_ends_the_run",),
    "fence_breach": ("test_the_autopilots_own_return_is_left_alone_and_ends_the_run",),
    "second_autopilot": ("test_other_voices_on_the_link_change_nothing",),
    "gcs_heartbeat": ("test_other_voices_on_the_link_change_nothing",),
    "camera_heartbeat": ("test_other_voices_on_the_link_change_nothing",),
    "one_way": (DOUBTFUL, LACKS),
    "mavlink1": ("test_a_vehicle_of_the_old_protocol_is_flown",),
    "stream_stops": (DOUBTFUL,),
    "stream_freezes": (DOUBTFUL, HARMLESS),
    "no_message": (LACKS,),
    "field": (DOUBTFUL, HARMLESS),
    "field_shifts": (DOUBTFUL,),
    "home_datum": (DOUBTFUL,),
    "battery_unknown": (BATTERY,),
    "battery_drains": (BATTERY,),
    "second_battery": (BATTERY,),
    "command_refused": (LACKS,),
    "arming_refused": ("test_arming_that_is_refused_for_a_while_is_tried_again",),
    "amsl_corrected": (HEIGHT,),
    "home_moved": (HEIGHT,),
    "origin_moved": (HARMLESS,),
    "distance_sensor": (HARMLESS,),
    "terrain_report": (HARMLESS,),
    "second_gps": (HARMLESS,),
    "second_estimator": (HARMLESS,),
    "pilot_hold": (TAKEN,),
    "failsafe_hold": (TAKEN,),
    "gcs_goes": (TAKEN,),
    "gcs_altitude": (TAKEN,),
    "gcs_speed": (TAKEN,),
    "gcs_pauses": (TAKEN,),
    "gcs_velocity": (TAKEN,),
    "second_service": (TAKEN,),
}


def flights() -> dict[str, set[str]]:
    """The tests that fly with faults, and the words in quotation marks in each and in the tables that it names."""
    found: dict[str, set[str]] = {}
    for path in Path(__file__).parent.glob("test_faults_*.py"):
        parts = ast.parse(path.read_text(encoding="utf-8")).body
        tables = {
            part.target.id: words_in(part)
            for part in parts
            if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name)
        }
        for part in parts:
            if isinstance(part, ast.FunctionDef):
                named = {each.id for each in ast.walk(part) if isinstance(each, ast.Name)}
                found[part.name] = words_in(part).union(*(tables.get(name, set()) for name in named))
    return found


def words_in(part: ast.AST) -> set[str]:
    """What stands in quotation marks in a part of a file."""
    return {
        word.value
        for word in ast.walk(part)
        if isinstance(word, ast.Constant) and isinstance(word.value, str)
    }


def test_every_fault_of_the_mock_has_its_flight() -> None:
    assert set(ANSWERS) == set(KINDS)
    words = flights()
    assert {
        f"{kind}: {test}"
        for kind, tests in ANSWERS.items()
        for test in tests
        if kind not in words.get(test, ())
    } == set()
    (radio,) = ANSWERS["packets"]
    assert set(KINDS["packets"].options) <= words[radio]
