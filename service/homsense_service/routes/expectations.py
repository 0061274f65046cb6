"""What a site has learnt about itself."""

from fastapi import APIRouter

from homsense_service import rendering_expectations as rendering
from homsense_service import schemas
from homsense_service.routes.access import OperationsDep, SiteParam, needs, problems

router = APIRouter(prefix="/v1/sites/{site}", tags=["sites"])


@router.get(
    "/expectation",
    dependencies=[needs("read")],
    summary="What the sensor expects",
    responses=problems(404, 422),
)
def get_expectation(site: SiteParam, operations: OperationsDep) -> schemas.ExpectationOut:
    """Return how far the simulation is, and what the last one has taught."""
    return rendering.render_expectation(operations.sites.get(site).expecting)


@router.post(
    "/expectation",
    status_code=202,
    dependencies=[needs("localize")],
    summary="Simulate the sensor",
    responses=problems(404, 409, 422),
)
def post_expectation(site: SiteParam, operations: OperationsDep) -> schemas.ExpectationOut:
    """Begin to simulate in the background, unless map and scans are as they were."""
    return rendering.render_expectation(operations.expect(site))


@router.get(
    "/diagnosis",
    dependencies=[needs("read")],
    summary="Judge the site",
    responses=problems(404, 409, 422, 503),
)
def get_diagnosis(site: SiteParam, operations: OperationsDep) -> schemas.DiagnosisOut:
    """Tell whether counting holes helps on this site, why, and what could be set."""
    return rendering.render_diagnosis(operations.diagnose(site))
