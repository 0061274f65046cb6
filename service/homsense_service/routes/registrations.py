"""The crowd of a site on its map."""

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query

from homsense_service import rendering_registrations as rendering
from homsense_service import schemas
from homsense_service.errors import SiteNotFoundError
from homsense_service.routes.access import CallerDep, OperationsDep, SiteParam, needs, problems

router = APIRouter(prefix="/v1/sites/{site}", tags=["sites"])


@router.get(
    "/registration",
    dependencies=[needs("read")],
    summary="The crowd on the map",
    responses=problems(404, 422),
)
def get_registration(
    site: SiteParam,
    operations: OperationsDep,
    format: Annotated[  # noqa: A002 - the name of the query parameter
        Literal["geojson"] | None, Query(description="The places of the scans instead.")
    ] = None,
) -> schemas.RegistrationOut | dict[str, Any]:
    """Return how far the registration is and where the crowd lies, or the places of its scans."""
    found = operations.sites.get(site)
    if format == "geojson":
        return rendering.render_registered_scans(found)
    return rendering.render_registration(found)


@router.post(
    "/registration",
    status_code=202,
    dependencies=[needs("localize")],
    summary="Place the crowd",
    responses=problems(404, 409, 422),
)
def post_registration(site: SiteParam, operations: OperationsDep) -> schemas.RegistrationOut:
    """Begin to place the crowd in the background, unless map and scans are as they were."""
    operations.register(site)
    return rendering.render_registration(operations.sites.get(site))


@router.get(
    "/floors",
    dependencies=[needs("read")],
    summary="Which floor the crowd walks on",
    responses=problems(404, 422),
)
def get_floors(site: SiteParam, operations: OperationsDep) -> schemas.FloorsOut:
    """Return how far the ranking of floors is, and what the last one has told."""
    return rendering.render_floors(operations.sites.get(site))


@router.post(
    "/floors",
    status_code=202,
    dependencies=[needs("localize")],
    summary="Place the crowd on several maps",
    responses=problems(400, 404, 409, 413, 422),
)
def post_floors(
    site: SiteParam, wanted: schemas.FloorsIn, caller: CallerDep, operations: OperationsDep
) -> schemas.FloorsOut:
    """Begin to place the crowd on the maps of several sites, unless all is as it was.

    While one ranking goes on, that one is answered.
    """
    for name in wanted.sites:
        if not caller.sees(name):
            raise SiteNotFoundError(name)
    operations.rank_floors(site, wanted.sites)
    return rendering.render_floors(operations.sites.get(site))
