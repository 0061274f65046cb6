"""Sites, maps and height maps."""

from typing import Annotated, Any

from fastapi import APIRouter, Body, Path, Request, Response
from fastapi.responses import JSONResponse, StreamingResponse

from homsense_service import rendering, schemas
from homsense_service.routes.access import CallerDep, OperationsDep, SiteParam, needs, problems
from homsense_service.routes.pages import CursorParam, LimitParam, page
from homsense_service.routes.versions import ExpectedDep, tagged

router = APIRouter(prefix="/v1/sites", tags=["sites"])


@router.get("", dependencies=[needs("read")], summary="List sites", responses=problems(404, 422))
def list_sites(
    operations: OperationsDep,
    caller: CallerDep,
    limit: LimitParam = 100,
    cursor: CursorParam = None,
) -> schemas.SiteList:
    """Return the sites that the key is for, by name."""
    seen = {site.name: site for site in operations.sites.all() if caller.sees(site.name)}
    names, following = page(list(seen), limit, cursor)
    return schemas.SiteList(
        sites=[rendering.render_site(seen[name]) for name in names], next=following
    )


@router.put(
    "/{site}",
    dependencies=[needs("admin")],
    summary="Create or configure a site",
    responses={
        201: {"model": schemas.SiteOut, "description": "Created"},
        **problems(400, 412, 413, 422),
    },
)
def put_site(
    site: SiteParam,
    config: schemas.SiteIn,
    operations: OperationsDep,
    expected: ExpectedDep,
    response: Response,
) -> schemas.SiteOut:
    """Create a site, or replace its configuration; scans and map stay."""
    found, created = operations.sites.put(site, config.to_config(), expected)
    response.status_code = 201 if created else 200
    response.headers["etag"] = tagged(str(found.revision))
    return rendering.render_site(found)


@router.get(
    "/{site}",
    dependencies=[needs("read")],
    summary="Read a site",
    responses=problems(404, 422),
)
def get_site(site: SiteParam, operations: OperationsDep, response: Response) -> schemas.SiteOut:
    """Return a site's configuration and what it holds; the tag is of configuration and map."""
    found = operations.sites.get(site)
    response.headers["etag"] = tagged(str(found.revision))
    return rendering.render_site(found)


@router.delete(
    "/{site}",
    status_code=204,
    dependencies=[needs("admin")],
    summary="Delete a site",
    responses=problems(404, 412, 422),
)
def delete_site(site: SiteParam, operations: OperationsDep, expected: ExpectedDep) -> None:
    """Delete a site with its map, scans and sessions."""
    operations.delete_site(site, expected)


@router.get(
    "/{site}/export",
    dependencies=[needs("admin")],
    summary="Export a site",
    response_class=StreamingResponse,
    responses={200: {"content": {"application/gzip": {}}}, **problems(404, 422)},
)
def export_site(site: SiteParam, operations: OperationsDep) -> StreamingResponse:
    """Return configuration, map and scans as one file, for `homsense import`."""
    headers = {"content-disposition": f'attachment; filename="{site}.homsense"'}
    pieces = operations.export(site)
    return StreamingResponse(pieces, media_type="application/gzip", headers=headers)


@router.delete(
    "/{site}/devices/{device:path}",
    dependencies=[needs("admin")],
    summary="Delete the scans of a device",
    responses=problems(404, 422),
)
def delete_device(
    site: SiteParam,
    device: Annotated[str, Path(min_length=1, max_length=200)],
    operations: OperationsDep,
) -> schemas.DeletedOut:
    """Delete all scans of a device; the complex is as if they had never been."""
    return schemas.DeletedOut(scans=operations.delete_device(site, device))


@router.put(
    "/{site}/map",
    dependencies=[needs("admin")],
    summary="Put the map",
    responses=problems(400, 404, 412, 413, 422),
)
def put_map(
    site: SiteParam,
    document: Annotated[dict[str, Any], Body(description="GeoJSON of polygons.")],
    operations: OperationsDep,
    expected: ExpectedDep,
    response: Response,
) -> schemas.MapOut:
    """Replace the map; open sessions stay on the map they were opened on."""
    version = operations.sites.put_map(operations.sites.get(site), document, expected)
    response.headers["etag"] = tagged(version.digest)
    return rendering.render_map(version)


@router.get(
    "/{site}/map",
    dependencies=[needs("read")],
    summary="Read the map",
    response_model=dict[str, Any],
    responses={304: {"description": "Not modified"}, **problems(404, 409, 422)},
)
def get_map(site: SiteParam, operations: OperationsDep, expected: ExpectedDep) -> Response:
    """Return the map as it was put, unless the caller has it already."""
    version = operations.sites.get(site).require_map()
    headers = {"etag": tagged(version.digest), "cache-control": "no-cache"}
    if not expected(version.digest):
        return Response(status_code=304, headers=headers)
    return JSONResponse(version.document, headers=headers)


@router.get(
    "/{site}/heightmaps/{hops}",
    dependencies=[needs("read")],
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
