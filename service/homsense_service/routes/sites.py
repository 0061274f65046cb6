"""Sites, maps and height maps."""

from typing import Annotated, Any

from fastapi import APIRouter, Body, Path, Request, Response

from homsense_service import rendering, schemas
from homsense_service.routes.access import OperationsDep, SiteParam, problems

router = APIRouter(prefix="/v1/sites", tags=["sites"])


@router.get("", summary="List all sites")
def list_sites(operations: OperationsDep) -> schemas.SiteList:
    """Return every site by name."""
    return schemas.SiteList(sites=[rendering.render_site(s) for s in operations.sites.all()])


@router.put(
    "/{site}",
    summary="Create or configure a site",
    responses={201: {"model": schemas.SiteOut, "description": "Created"}, **problems(400, 422)},
)
def put_site(
    site: SiteParam, config: schemas.SiteIn, operations: OperationsDep, response: Response
) -> schemas.SiteOut:
    """Create a site, or replace its configuration; scans and map stay."""
    found, created = operations.sites.put(site, config.to_config())
    response.status_code = 201 if created else 200
    return rendering.render_site(found)


@router.get("/{site}", summary="Read a site", responses=problems(404, 422))
def get_site(site: SiteParam, operations: OperationsDep) -> schemas.SiteOut:
    """Return a site's configuration and what it holds."""
    return rendering.render_site(operations.sites.get(site))


@router.delete("/{site}", status_code=204, summary="Delete a site", responses=problems(404, 422))
def delete_site(site: SiteParam, operations: OperationsDep) -> None:
    """Delete a site with its map, scans and sessions."""
    operations.delete_site(site)


@router.put("/{site}/map", summary="Put the map", responses=problems(400, 404, 413, 422))
def put_map(
    site: SiteParam,
    document: Annotated[dict[str, Any], Body(description="GeoJSON of polygons.")],
    operations: OperationsDep,
) -> schemas.MapOut:
    """Replace the map; open sessions stay on the map they were opened on."""
    version = operations.sites.put_map(operations.sites.get(site), document)
    return rendering.render_map(version)


@router.get("/{site}/map", summary="Read the map", responses=problems(404, 409, 422))
def get_map(site: SiteParam, operations: OperationsDep) -> dict[str, Any]:
    """Return the map as it was put."""
    return operations.sites.get(site).require_map().document


@router.get(
    "/{site}/heightmaps/{hops}",
    summary="Expected holes over the map",
    response_model=schemas.HeightMapOut,
    responses={200: {"content": {"image/png": {}}}, **problems(404, 409, 422)},
)
def get_height_map(
    site: SiteParam,
    hops: Annotated[int, Path(ge=0, le=schemas.MAX_HOPS)],
    operations: OperationsDep,
    request: Request,
) -> schemas.HeightMapOut | Response:
    """Return the height map of a neighborhood: numbers, or a picture for ``image/png``."""
    sensor = operations.sites.get(site).sensor([hops])
    if "image/png" in request.headers.get("accept", ""):
        return Response(rendering.render_height_png(sensor.heights[0]), media_type="image/png")
    return rendering.render_height_map(sensor)
