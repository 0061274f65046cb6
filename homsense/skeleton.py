"""The 1-skeleton of a landmark complex as a graph."""

import networkx as nx

from homsense.simplicial import LandmarkComplex


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
    graph: nx.Graph[str] = nx.Graph()
    landmarks = sorted(landmark_complex.landmarks)
    graph.add_nodes_from(landmarks)
    for landmark in landmarks:
        later = sorted(n for n in landmark_complex.neighbors(landmark) if n > landmark)
        graph.add_edges_from((landmark, other) for other in later)
    return graph


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
    return sum(len(landmark_complex.neighbors(landmark)) for landmark in landmarks) // 2
