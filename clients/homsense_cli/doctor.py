"""``homsense doctor``: what a site has learnt about itself, and whether counting holes helps."""

from homsense_client import Client, Diagnosis
from rich.console import Console
from rich.progress import Progress

from homsense_cli.demo_run import learn

_MARKS = {"good": "green", "doubtful": "yellow", "bad": "red"}


def run_doctor(
    url: str, site: str, console: Console, *, key: str | None = None, apply: bool = False
) -> Diagnosis:
    """Let a site of a running service judge itself, and print its findings.

    Parameters
    ----------
    url : str
        The service.
    site : str
        A site with a map and scans.
    console : rich.console.Console
        Where progress and findings go.
    key : str, optional
        An API key of the service.
    apply : bool, default False
        Whether to set what it advises.

    Returns
    -------
    Diagnosis
        What was printed.
    """
    with Client(url, key=key, timeout_s=300.0) as client:
        with Progress(console=console, transient=True) as bars:
            task = bars.add_task("the site learns its radio")
            learn(client, site, lambda done, of: bars.update(task, completed=done, total=of))
        diagnosis = client.diagnosis(site)
        changes = {
            name: value
            for finding in diagnosis.findings
            for name, value in (finding.setting or {}).items()
        }
        if apply and changes:
            client.put_site(site, **{**client.get_site(site).config, **changes})
    for finding in diagnosis.findings:
        color = _MARKS[finding.verdict]
        advice = f" -> {finding.advice}" if finding.advice else ""
        console.print(
            f"[{color}]{finding.verdict:<9}[/{color}] {finding.topic}: {finding.text}{advice}",
            highlight=False,
            soft_wrap=True,
        )
    color = _MARKS[diagnosis.verdict]
    console.print(f"[{color}]{diagnosis.summary}[/{color}]", soft_wrap=True)
    if changes:
        told = ", ".join(
            f"{name} = {value if isinstance(value, list) else f'{value:g}'}"
            for name, value in changes.items()
        )
        console.print(f"{'set' if apply else '--apply sets'}: {told}", soft_wrap=True)
    return diagnosis
