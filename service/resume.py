"""Going on with a search from its journal: the same belief to the last bit, no report lost or counted twice."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from service.area import Grid, SearchArea
from service.config import ONLY, Settings, changed_settings, without_unknown
from service.drawing import RegionsRow
from service.entries import Entry, of_whom, read_entries, understanding
from service.errors import BadInput
from service.evidence.intake import Intake
from service.evidence.moments import HISTORY_S
from service.journal import read_meta, read_meta_if_any
from service.known import Judgement, Withdrawn
from service.mission.entering import still_enough
from service.mission.flight import Flight
from service.mission.orders import ASKED, FINISHED
from service.mission.standing import Standing, as_asked
from service.mission.states import FINAL, FLYING, MAY_MOVE, SEARCHED_TO, SETTLED, Event, State
from service.rows import (
    CommandRow,
    DecisionRow,
    FlightRow,
    NewsRow,
    ReplacedRow,
    ReportRow,
    ResumedRow,
    SortieRow,
    TransitionRow,
    VehicleRow,
    VerdictRow,
    WithdrawnRow,
)
from service.search import Search
from service.story import IN_THE_AIR, FlightSoFar
from service.survey import AREA, JOURNAL, PRIOR, is_of, read_survey, survey

log = logging.getLogger("roisearch")
MOSTLY = 0.5
NUMBER = "number"
"""The key of a run's number in its journal."""
_SAY_WHICH = frozenset({"link.connect", "link.system_id", "aircraft"})
"""Settings that say which aircraft it is."""


def stored_settings(journal: Path, changed: dict[str, Any]) -> Settings:
    """The settings that a run was started with, but for those `changed` ('section.key': value; None: as stored).

    What another version could set and this one cannot is left out, and said.
    """
    values, gone = without_unknown(read_meta(journal, "settings"))
    _say_gone(journal, gone)
    return changed_settings(values, changed, str(journal))


@cache
def _say_gone(journal: Path, gone: tuple[str, ...]) -> None:
    """Once for a journal, however often its settings are read."""
    for key in gone:
        log.warning("%s: its setting %s is none of this version, and left out", journal, key)


def stored_run(folder: Path) -> tuple[Settings, SearchArea, Grid, list[Entry]]:
    """What a run's folder holds, under way or over: settings, area, grid, and the journal as it is now.

    Raises BadInput when it holds no run that has begun, or its journal is of another grid.
    """
    journal = folder / JOURNAL
    settings = stored_settings(journal, {})
    prior = folder / PRIOR
    area, grid = survey(folder / AREA, prior if prior.exists() else None, settings)
    if read_meta(journal, "grid") != grid.frame.to_dict():
        raise BadInput(f"{folder}: its journal is of another grid than its area file makes")
    rows = list(read_entries(journal))
    if not rows:
        raise BadInput(f"{folder}: its journal is empty; nothing has happened yet that could be shown")
    return settings, area, grid, rows


def retrace(entry: Entry, search: Search) -> None:
    """Apply what a journal row says about the ground, if anything, to a search; rows come in their order."""
    said = entry.said
    if isinstance(said, VerdictRow):
        search.take(Judgement(said.cell, said.observation, said.confirmed), entry.time)
    elif isinstance(said, ReportRow) and said.observation is not None:
        search.take(said.observation, said.captured)
    elif isinstance(said, NewsRow):
        search.take(said.news, entry.time)
    elif isinstance(said, WithdrawnRow):
        search.take(Withdrawn(said.id), entry.time)
    elif isinstance(said, RegionsRow):
        search.take_drawing(said.drawing)


@dataclass(frozen=True)
class Remembered:
    """What an intake has to know of an earlier run of the same search: the names of the reports that count as known, in
    their order, each with its captured_at, and the last rows of reports, to whose passes the next ones may belong."""

    journal: Path
    names: tuple[tuple[str, float], ...]
    recent: tuple[Entry, ...]

    def tell(self, intake: Intake) -> None:
        """Make it known to an intake that has taken nothing in yet."""
        for entry in self.recent:
            with understanding(self.journal, entry.seq, ReportRow.kind):
                assert isinstance(entry.said, ReportRow)
                intake.recall(entry.said)
        intake.remember(self.names)
        intake.accepted = len(self.names)


@dataclass(frozen=True)
class Whose:
    """Whose rows are meant: those of `aircraft`, and where it is the `first`, those of a time when it was the only one,
    or, where it is that now, the first.

    With the default, those of the only one, which are all that name none.
    """

    aircraft: str = ""
    first: bool = True

    def __contains__(self, entry: Entry) -> bool:
        return self.owns(entry.aircraft)

    def owns(self, name: str) -> bool:
        """Whether rows with this name are meant."""
        return (of_whom(name, self.aircraft) if self.first else name) == self.aircraft


ALONE = Whose()


def retrace_all(
    journal: Path, search: Search, told: Callable[[float, float], None] = lambda time, pos: None
) -> dict[str, Remembered]:
    """Apply the journalled observations, verdicts and news to a fresh search, in their order; what the intake of each
    aircraft has to know.

    `told` hears the time of each row and the POS after it.
    """
    names: dict[str, dict[str, float]] = {}
    recent: dict[str, deque[Entry]] = {}
    for entry in read_entries(journal, ReportRow, VerdictRow, NewsRow, WithdrawnRow, RegionsRow):
        with understanding(journal, entry.seq, entry.said.kind):
            retrace(entry, search)
        if isinstance(entry.said, ReportRow):
            names.setdefault(entry.aircraft, {})[entry.said.name] = entry.said.captured_at
            lately = recent.setdefault(entry.aircraft, deque())
            lately.append(entry)
            while lately[0].time < entry.time - HISTORY_S:
                lately.popleft()
        told(entry.time, search.record.pos)
    return {name: Remembered(journal, tuple(names[name].items()), tuple(recent[name])) for name in names}


def replay(
    journal: Path,
    search: Search,
    intake: Intake,
    told: Callable[[float, float], None] = lambda time, pos: None,
) -> int:
    """Retrace a journal, and take up the passes that were going on: what hovers over a cell has looked at it once,
    whether or not the service was killed meanwhile. Returns how many reports there were."""
    remembered = remembered_of(retrace_all(journal, search, told), journal)
    remembered.tell(intake)
    return len(remembered.names)


def remembered_of(all_: dict[str, Remembered], journal: Path, whose: Whose = ALONE) -> Remembered:
    """What the intake of one aircraft has to know of them."""
    own = [all_[name] for name in sorted(all_) if whose.owns(name)]
    recent = sorted((entry for each in own for entry in each.recent), key=lambda entry: entry.seq)
    return Remembered(journal, tuple(name for each in own for name in each.names), tuple(recent))


def why_over(journal: Path) -> str:
    """Why a run is over, as a sentence's end: its target was found, there was nothing more to gain, or an operator
    ended it. Nothing when it was broken off, or is under way. Of several aircraft all have to have ended."""
    ended: dict[str, str] = {}
    states: dict[str, State] = {}
    for entry, row in _transitions(journal):
        states[entry.aircraft] = row.after
        why = ended.get(entry.aircraft, "")
        goes_on = row.after in FLYING or row.event == Event.RESUME  # or is not over after all, by the news
        ended[entry.aircraft] = "" if goes_on else _end_of(row) or why
    if any(state not in FINAL for state in states.values()):
        return ""
    finished = [why for why in ended.values() if why and why != ABORTED]
    every = bool(ended) and all(ended.values())
    return finished[0] if finished else ABORTED if every else ""


ABORTED = "an operator aborted it"


def _end_of(row: TransitionRow) -> str:
    """Why a search is over with a transition, or nothing."""
    if row.event in (Event.CONFIRMED, Event.SEARCHED):
        return row.reason
    if row.event == Event.ABORT and row.reason == ASKED:
        return ABORTED
    if row.event == Event.FINISH:
        return FINISHED if row.reason == ASKED else row.reason
    return ""


def left_standing(journal: Path, search: Search, whose: Whose = ALONE) -> Standing:
    """How the mission of a journal stood when it was left, with the search retraced.

    A restart that came no further than to hear the vehicle has changed nothing, nor has a fault that ended a process.
    What was over for this aircraft while the run went on with another one is over.
    """
    standing = Standing()
    rows = list(_transitions(journal))
    out = _out_of_it(rows, whose)
    for row in (row for entry, row in rows if entry in whose):
        if row.after in (State.READY, State.ABORTED):
            continue
        settled = standing.settled or row.event in SETTLED
        enough = still_enough(standing, row.event, row.after)
        if row.after == row.before == State.WAITING:  # what was wanted before the aircraft was heard
            standing = as_asked(standing, row.event, row.reason) or standing
            continue
        if row.after == row.before:  # nothing but that it is settled, or not any more
            settled = settled and row.event != Event.RESUME
            enough = settled and row.reason.startswith(SEARCHED_TO)
            standing = replace(
                standing, settled=settled, enough=enough, searched=True, why_stopped=row.reason
            )
            continue
        if row.after in FLYING:
            standing, settled = Standing(state=row.after, why=row.reason), False
        elif row.after == State.RETURNING and standing.state != State.FOUND:
            searched = standing.searched or row.event in (Event.SEARCHED, Event.ENERGY_LOW)
            stopped = standing.why_stopped or row.reason
            standing = Standing(state=row.after, why=row.reason, why_stopped=stopped, searched=searched)
        else:
            standing = replace(standing, state=row.after, why=row.reason)
        standing = replace(standing, settled=settled, enough=enough)
    if out is not None:
        why = standing.why_stopped or out.reason
        return replace(
            standing,
            state=out.after,
            why=out.reason,
            why_stopped=why,
            causes=frozenset(),
            found=search.found(),
        )
    if standing.state == State.DONE:  # down before the search was over: whatever comes next is another flight
        return Standing()
    found = search.found()
    if standing.state == State.FOUND and search.settings.search.on_found == "hover" and not search.confirmed:
        return replace(
            standing, state=State.HOLDING, found=found
        )  # over a place that waits for a person's word
    going = standing.state in (State.RETURNING, State.FOUND)
    return replace(standing, found=found, why_stopped="" if found and going else standing.why_stopped)


def _out_of_it(rows: Sequence[tuple[Entry, TransitionRow]], whose: Whose) -> TransitionRow | None:
    """The row by which an aircraft landed for good or was aborted by an operator, while the run goes on with others."""
    last = {entry.aircraft: (entry, row) for entry, row in rows}
    if all(row.after in FINAL for _, row in last.values()):
        return None
    own = [row for entry, row in last.values() if entry in whose]
    out = own[-1] if own else None
    return out if out is not None and (out.after == State.DONE or _end_of(out) == ABORTED) else None


def left_flight(journal: Path, search: Search, whose: Whose = ALONE) -> Flight:
    """What was flown in the run of a journal.

    What can be counted is counted as its story does. The seconds and the track are what was last written of them: a
    story reckons on to its last row, and a flight that goes on adds what has passed since by itself.
    """
    flight, so_far = Flight(), FlightSoFar()
    vehicle: tuple[int, str] | None = None
    for entry in read_entries(
        journal, FlightRow, SortieRow, DecisionRow, CommandRow, ReportRow, TransitionRow, VehicleRow
    ):
        if entry not in whose:
            continue
        so_far.take(entry, search.grid.frame)
        match entry.said:
            case SortieRow() as sortie:
                flight.recall_sortie(sortie)
            case FlightRow() as row:
                flight.recall(row, entry.time)
                flight.by = vehicle
            case CommandRow(command="reposition", lat=float(lat), lon=float(lon)):
                flight.goal = lat, lon
            case TransitionRow(after=state):
                flight.flown |= state in MAY_MOVE
            case VehicleRow(system_id=system_id, autopilot=autopilot):
                vehicle = system_id, autopilot
    flight.decisions, flight.waypoints, flight.hits = so_far.decisions, so_far.waypoints, so_far.hits
    flight.told_s, flight.told_at = so_far.flown_s, so_far.last_time or 0.0
    return flight


def left_system_id(journal: Path, whose: Whose, asked: int | None) -> int | None:
    """The MAVLink system id of the aircraft that a journal's run goes on with; None: of the next one heard.

    As an operator has ordered, where one was replaced by another; as the settings have it (`asked`) otherwise, and
    where they say since then over which link it is, or which one. Of several, one that was left in the air is the one
    that it was: another one that answers on its link, where two were exchanged, is not flown in its place.
    """
    wanted, aloft, flew = asked, False, None
    for entry in read_entries(journal, ReplacedRow, ResumedRow, VehicleRow, TransitionRow):
        if isinstance(entry.said, ResumedRow):
            if not _SAY_WHICH.isdisjoint(entry.said.changed):
                wanted, flew = asked, None
        elif entry not in whose:
            continue
        elif isinstance(entry.said, ReplacedRow):
            wanted, flew = entry.said.system_id, None
        elif isinstance(entry.said, VehicleRow):
            flew = entry.said.system_id
        elif isinstance(entry.said, TransitionRow) and entry.said.after not in (State.WAITING, State.READY):
            aloft = entry.said.after in (*IN_THE_AIR, State.YIELDED)
    return flew if aloft and whose.aircraft and flew is not None else wanted


def interrupted_run(parent: Path, area_file: Path, settings: Settings) -> tuple[Path | None, str]:
    """The folder of the last run over an area, if it is not over, and what a person must know of that, or nothing.

    It is of that area if it was begun with just this file, or if most of its ground is in this one, or this one cannot
    be read any more: a file that is changed, or lost, while an aircraft flies must not cost the search what it knows.

    Raises BadInput when its journal cannot be read, or there is no such run and no such file.
    """
    begun = runs_in_order(parent)
    if not begun or why_over(begun[-1][0] / JOURNAL):
        return None, ""
    folder = begun[-1][0]
    if area_file.is_file() and is_of(folder, area_file):
        return folder, ""
    goes_on = f"it goes on over the area as it was, which is {folder / AREA}"
    kept, _ = read_survey(folder / AREA, settings)
    try:
        given, _ = read_survey(area_file, settings)
    except BadInput as error:
        return folder, f"{error}; {goes_on}"
    common = kept.polygon.intersection(given.polygon).area
    if common > MOSTLY * kept.polygon.area:
        return folder, f"{area_file} is not what it was begun with; {goes_on}"
    return None, f"{folder} was interrupted too, over other ground: --resume goes on with it"


def runs_in_order(parent: Path) -> list[tuple[Path, int]]:
    """The folders of the runs that were begun, in the order in which they were last gone on with, with their numbers.

    A number counts what was begun or gone on with under `parent`: a computer that does not know the date gives its
    runs names that say nothing. Where there is none, of an earlier version or in a journal that cannot be read, the
    name says which runs were before it. Nobody can go on with a run that ended before it had its settings.
    """
    found: list[tuple[Path, int]] = []
    so_far = 0
    for journal in sorted(parent.glob(f"*/{JOURNAL}"), key=lambda path: path.parent.name):
        number = so_far
        try:
            if read_meta_if_any(journal, "settings") is None:
                continue
            number = int(read_meta_if_any(journal, NUMBER) or so_far)
        except BadInput:
            pass  # whoever wants to go on with it is told
        so_far = max(so_far, number)
        found.append((journal.parent, number))
    return sorted(found, key=lambda each: each[1])  # equal ones keep the order of their names


def _transitions(journal: Path) -> Iterator[tuple[Entry, TransitionRow]]:
    """Those of all aircraft, each by one name, whether it flew alone then or not."""
    tables = (read_meta_if_any(journal, "settings") or {}).get("aircraft") or []
    first = tables[0].get("name") or ONLY if tables else ""
    for entry in read_entries(journal, TransitionRow):
        if isinstance(entry.said, TransitionRow):
            yield replace(entry, aircraft=of_whom(entry.aircraft, first)), entry.said
