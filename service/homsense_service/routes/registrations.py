"""The crowd of a site on its map."""

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query

from homsense_service import rendering_registrations as rendering
from homsense_service import schemas
from homsense_service.routes.access import OperationsDep, SiteParam, needs, problems

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
