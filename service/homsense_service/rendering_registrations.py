"""How the crowd of a site lies on its map -> wire."""

from typing import Any

import numpy as np

from homsense.registered.registration import Registration
from homsense_service import schemas
from homsense_service.registering import Registered
from homsense_service.site import Site


def render_registration(site: Site) -> schemas.RegistrationOut:
    """Return how far a registration is."""
    progress, known = site.registering.progress, site.registering.current
    return schemas.RegistrationOut(
        state=progress.state,
        done=progress.done,
        of=site.registering.words.steps,
        reason=progress.reason,
        tracked=site.tracked,
        placed=None if known is None else _placed(known),
    )


def render_floors(site: Site) -> schemas.FloorsOut:
    """Return how far a ranking of floors is."""
    progress, known = site.ranking_floors.progress, site.ranking_floors.current
    return schemas.FloorsOut(
        state=progress.state,
        done=progress.done,
        of=site.ranking_floors.words.steps,
        reason=progress.reason,
        floors=[]
        if known is None
        else [
            schemas.FloorOut(
                site=fit.name,
                map_version=known.maps[fit.name].digest,
                probability=fit.probability,
                **_fit(fit.complex.registration),
            )
            for fit in known.fits
        ],
    )


def _fit(found: Registration) -> dict[str, Any]:
    return {
        "cost_m": found.cost_m,
        "margin_m": found.margin_m,
        "mirror_margin_m": found.mirror_margin_m,
        "strain": found.strain,
        "doubtful": found.is_doubtful,
    }


def _placed(known: Registered) -> schemas.PlacedOut:
    found = known.complex
    return schemas.PlacedOut(
        map_version=known.map_digest,
        tracked=known.scans,
        laid_out=known.laid_out,
        scans=found.size,
        walks=len(np.unique(found.walk)),
        reach_m=found.reach_m,
        weakest_dbm=found.hearing.weakest_dbm,
        **_fit(found.registration),
        coverage=known.coverage,
        information_bits=known.information_bits,
        placements=[
            schemas.PlacementOut(
                rotation_rad=placement.rotation_rad,
                scale=placement.scale,
                cost_m=placement.cost_m,
                probability=probability,
            )
            for placement, probability in zip(
                found.registration.placements,
                found.registration.probabilities.tolist(),
                strict=True,
            )
        ],
    )


def render_registered_scans(site: Site) -> dict[str, Any]:
    """Return where the scans of a crowd were made, as GeoJSON in the frame of the map."""
    known = site.registering.current
    if known is None:
        return {"type": "FeatureCollection", "features": []}
    site_map, found = known.map_version.site_map, known.complex
    places = found.xy if site_map.origin is None else site_map.to_wgs84(found.xy)
    features = [
        {
            "type": "Feature",
            "properties": {"walk": int(walk)},
            "geometry": {"type": "Point", "coordinates": place},
        }
        for walk, place in zip(found.walk, places.tolist(), strict=True)
    ]
    frame = {"frame": "local"} if site_map.origin is None else {}
    return {"type": "FeatureCollection", **frame, "features": features}
