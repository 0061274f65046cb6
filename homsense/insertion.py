"""Joining scans into the facet table: Algorithm 2 with nothing but the maximal simplices kept.

The reference; `homsense.compiled.insertion` does the same on the same arrays.
"""

import numpy as np

from homsense.facet_table import FacetTable, Numbers, Ragged, Version


def insert(table: FacetTable, scans: Ragged) -> None:
    """Append the scans that lie in no facet, each swallowing the facets that lie in it.

    Parameters
    ----------
    table : FacetTable
        Claimed by the caller.
    scans : Ragged
        Landmark numbers of each scan, rising, none empty.
    """
    for start, end in zip(scans.ends[:-1].tolist(), scans.ends[1:].tolist(), strict=True):
        scan = scans.values[start:end]
        version = table.version()
        if not _lies_in_a_facet(table, version, scan):
            facets, shared = np.unique(version.posting_lists(scan).values, return_counts=True)
            sizes = version.row_start[facets + 1] - version.row_start[facets]
            table.append(scan, facets[shared == sizes].tolist())


def _lies_in_a_facet(table: FacetTable, version: Version, scan: Numbers) -> bool:
    rarest = scan[[int(table.used[scan].argmin())]]
    candidates = version.posting_lists(rarest).values
    sizes = version.row_start[candidates + 1] - version.row_start[candidates]
    wanted = set(scan.tolist())
    rows = version.rows(candidates[sizes >= len(scan)])
    return any(wanted.issubset(row) for row in rows.lists())
