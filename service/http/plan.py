"""The door of a search that is still being drawn: the page to draw on, what is drawn so far, saving, and the start."""

from __future__ import annotations

import asyncio
import json
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from fastapi import Body, FastAPI, Query, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import FileResponse, JSONResponse, PlainTextResponse
from pydantic import BaseModel, ConfigDict, Field

from service.area.document import as_geojson
from service.area.lost_persons import SUBJECTS, terrains_of
from service.area.projection import surface_m2
from service.config import Settings
from service.errors import BadInput
from service.http.access import Access
from service.http.app import complaints
from service.http.guard import Guard, Refusal
from service.http.page import FOLDER, PageFiles, policy
from service.http.rate import Buckets
from service.places import written
from service.survey import read_survey, survey
from service.view.underlay import NO_UNDERLAY, Underlay

MOST_FEATURES = 500


class DrawnFeatures(BaseModel):
    """What was drawn: GeoJSON features with roles, as area files have them."""

    model_config = ConfigDict(extra="forbid")

    type: Literal["FeatureCollection"]
    name: str = Field(default="", max_length=80)
    features: list[dict[str, Any]] = Field(max_length=MOST_FEATURES)


class AreaPlan:
    """An area that is being drawn, and its file. `started` is set when a search of it is to begin."""

    def __init__(self, file: Path, settings: Settings) -> None:
        self.file, self.settings = file, settings
        self.started = asyncio.Event()

    def so_far(self) -> dict[str, Any] | None:
        """What the file holds, as GeoJSON; None where there is no file yet. Raises BadInput."""
        if not self.file.exists():
            return None
        area, document = read_survey(self.file, self.settings)
        drawn: dict[str, Any] = json.loads(as_geojson(document, area.name))
        return drawn

    def save(self, drawn: DrawnFeatures) -> dict[str, Any]:
        """Write what was drawn, once it is a search that could be flown; raises BadInput and leaves the file alone."""
        text = json.dumps(drawn.model_dump(), indent=1)
        try:
            with tempfile.TemporaryDirectory(dir=self.file.absolute().parent, prefix=".plan-") as folder:
                trial = Path(folder) / self.file.name
                trial.write_text(text, encoding="utf-8")
                told = self._checked(trial)
                trial.replace(self.file)
        except OSError as error:
            raise BadInput(
                f"{self.file}: cannot be written ({error.strerror}); give a writable --out"
            ) from error
        return {"file": str(self.file), **told}

    def _checked(self, trial: Path) -> dict[str, Any]:
        try:
            area, grid = survey(trial, None, self.settings)
        except BadInput as error:
            raise BadInput(str(error).replace(str(trial), self.file.name)) from error
        cells = int(grid.searchable.sum())
        notes = [note.replace(str(trial), self.file.name) for note in (*area.notes, *grid.notes)]
        return {"cells": cells, "km2": surface_m2(area.polygon) / 1e6, "notes": notes}


def create_plan_app(
    plan: AreaPlan,
    *,
    access: Access | None = None,
    names: Sequence[str] = (),
    any_address: bool = False,
    underlay: Underlay = NO_UNDERLAY,
) -> FastAPI:
    """The application behind its guard; for the arguments see `create_app`."""
    app = FastAPI(title="roisearch plan", docs_url=None, redoc_url=None, openapi_url=None)
    http = plan.settings.http
    guarded = {"http": http, "access": access or Access(), "names": names, "any_address": any_address}
    app.add_middleware(Guard, **guarded, buckets=Buckets())  # type: ignore[arg-type]

    @app.exception_handler(BadInput)
    async def bad(_: Request, error: Exception) -> Response:
        return JSONResponse({"detail": str(error)}, status_code=422)

    @app.exception_handler(RequestValidationError)
    async def not_valid(_: Request, error: Exception) -> Response:
        assert isinstance(error, RequestValidationError)
        return JSONResponse({"detail": str(complaints(error))}, status_code=422)

    @app.exception_handler(Refusal)
    async def refused(request: Request, error: Exception) -> Response:
        assert isinstance(error, Refusal)
        return error.response(request.scope)

    @app.get("/api/plan")
    async def read() -> dict[str, Any]:
        drawn = await asyncio.to_thread(plan.so_far)
        coordinates = plan.settings.run.coordinates
        return {
            "file": str(plan.file),
            "drawn": drawn,
            "tiles": underlay.describe(),
            "coordinates": coordinates,
            "subjects": {name: terrains_of(name) for name in SUBJECTS},
        }

    @app.get("/api/written")
    async def as_the_team_writes(
        lat: Annotated[float, Query(ge=-90, le=90, allow_inf_nan=False)],
        lon: Annotated[float, Query(ge=-180, le=180, allow_inf_nan=False)],
    ) -> dict[str, str]:
        return {"written": written((lat, lon), plan.settings.run.coordinates)}

    @app.post("/api/plan")
    async def save(drawn: Annotated[DrawnFeatures, Body()]) -> dict[str, Any]:
        return await asyncio.to_thread(plan.save, drawn)

    @app.post("/api/plan/start")
    async def start() -> dict[str, bool]:
        if not plan.file.exists():
            raise Refusal(409, "nothing is saved yet; save the area first")
        plan.started.set()
        return {"starting": True}

    @app.get("/tiles/{z}/{x}/{y}")
    async def tile(z: int, x: int, y: int) -> Response:
        data = await asyncio.to_thread(underlay.tile, z, x, y)
        if data is None:
            raise Refusal(404, "there is no such tile")
        return Response(data, media_type=underlay.kind, headers={"cache-control": "private, max-age=86400"})

    @app.get("/healthz")
    async def healthy() -> Response:
        return PlainTextResponse("plan\n")

    @app.get("/")
    async def page() -> Response:
        return FileResponse(
            FOLDER / "plan.html", headers={"content-security-policy": policy(underlay.source)}
        )

    app.mount("/page", PageFiles(directory=FOLDER))
    return app
