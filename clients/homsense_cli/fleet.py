"""``homsense fleet``: simulated phones map a site of a running service."""


from rich.console import Console
from rich.progress import Progress

from homsense_cli.demo_run import map_world, prepare_site
from homsense_client import Client, Complex
from homsense_fleet.world import World


def run_fleet(
    url: str, site: str, world: World, *, seed: int, phones: int, scans_each: int, console: Console
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
    seed : int
        Decides routes and radio noise.
    phones : int
        How many phones.
    scans_each : int
        Scans of each phone.
    console : rich.console.Console
        Where progress goes.

    Returns
    -------
    Complex
        The landmark complex.
    """
    with Client(url, timeout_s=120.0) as client, Progress(console=console) as bars:
        prepare_site(client, site, world)
        task = bars.add_task(f"{phones} phones post scans", total=phones * scans_each)
        map_world(
            url,
            site,
            world,
            seed=seed,
            phones=phones,
            scans_each=scans_each,
            on_posted=lambda count: bars.advance(task, count),
        )
        grown = client.get_complex(site)
    console.print(
        f"{site}: {len(world.city.buildings)} buildings, {grown.observations} observations, "
        f"{grown.landmarks} landmarks, {grown.facets} facets, "
        f"b0 = {grown.betti[0]}, b1 = {grown.betti[1]}"
    )
    return grown
