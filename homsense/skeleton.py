"""The 1-skeleton of a landmark complex as a graph.

networkx is loaded when it is needed: that takes as long as to load all of `homsense`.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from homsense.neighborhood import hop_order
from homsense.simplicial import LandmarkComplex

if TYPE_CHECKING:
    import networkx as nx


def skeleton(landmark_complex: LandmarkComplex) -> "nx.Graph[str]":
    """Return the 1-skeleton: landmarks joined when seen together.

    Parameters
    ----------
    landmark_complex : LandmarkComplex
        The complex.

    Returns
    -------
    networkx.Graph
        Vertices and edges in sorted order.

    Examples
    --------
    >>> skeleton(LandmarkComplex.from_observations([{"a", "b", "c"}])).number_of_edges()
    3
    """
    graph: nx.Graph[str] = import_module("networkx").Graph()
    landmarks = sorted(landmark_complex.landmarks)
    graph.add_nodes_from(landmarks)
    for landmark in landmarks:
        later = sorted(n for n in neighbors(landmark_complex, landmark) if n > landmark)
        graph.add_edges_from((landmark, other) for other in later)
    return graph


def neighbors(landmark_complex: LandmarkComplex, landmark: str) -> frozenset[str]:
    """Return the landmarks that were seen together with one.

    Parameters
    ----------
    landmark_complex : LandmarkComplex
        The complex.
    landmark : str
        A vertex.

    Returns
    -------
    frozenset of str
        Its neighbors in the 1-skeleton.
    """
    near, _ = hop_order(landmark_complex.version, landmark_complex.numbers([landmark]), [1])
    return landmark_complex.names(near) - {landmark}


def n_edges(landmark_complex: LandmarkComplex) -> int:
    """Return the number of edges of the 1-skeleton.

    Parameters
    ----------
    landmark_complex : LandmarkComplex
        The complex.

    Returns
    -------
    int
        Pairs of landmarks that were seen together.
    """
    landmarks = landmark_complex.landmarks
    return sum(len(neighbors(landmark_complex, landmark)) for landmark in landmarks) // 2
