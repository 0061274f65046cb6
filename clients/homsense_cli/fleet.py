"""``homsense fleet``: simulated phones map a site of a running service."""

from homsense_client import Client, Complex
from homsense_fleet.driver import Crowd
from homsense_fleet.world import World
from rich.console import Console
from rich.progress import Progress

from homsense_cli.demo_run import map_world, prepare_site


def run_fleet(
    url: str, site: str, world: World, crowd: Crowd, console: Console, *, key: str | None = None
) -> Complex:
    """Create a site for a world, let phones map it, and print what became of it.

    Parameters
    ----------
    url : str
        The service.
    site : str
        Name of the site.
    world : World
        Where the phones walk.
    crowd : Crowd
        The phones.
    console : rich.console.Console
        Where progress goes.
    key : str, optional
        An API key of the service.

    Returns
    -------
    Complex
        The landmark complex.
    """
    with Client(url, key=key, timeout_s=120.0) as client, Progress(console=console) as bars:
        prepare_site(client, site, world)
        total = crowd.phones * crowd.scans_each
        task = bars.add_task(f"{crowd.phones} phones post scans", total=total)
        map_world(url, site, world, crowd, lambda count: bars.advance(task, count))
        grown = client.get_complex(site)
    console.print(
        f"{site}: {len(world.city.buildings)} buildings, {grown.observations} observations, "
        f"{grown.landmarks} landmarks, {grown.facets} facets, "
        f"b0 = {grown.betti[0]}, b1 = {grown.betti[1]}"
    )
    return grown
