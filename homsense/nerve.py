"""The two nerves of a visibility relation, which are Dowker duals."""

from homsense.relation import VisibilityRelation
from homsense.simplicial import LandmarkComplex


def landmark_complex(relation: VisibilityRelation) -> LandmarkComplex:
    """Return the nerve whose vertices are the landmarks.

    Parameters
    ----------
    relation : VisibilityRelation
        Observations x landmarks.

    Returns
    -------
    LandmarkComplex
        One simplex for each observation.
    """
    return LandmarkComplex.from_observations(relation.rows)


def observation_complex(relation: VisibilityRelation) -> LandmarkComplex:
    """Return the Dowker dual, whose vertices are the observations.

    Parameters
    ----------
    relation : VisibilityRelation
        Observations x landmarks.

    Returns
    -------
    LandmarkComplex
        One simplex for each landmark, on the row numbers of the observations that see it; its
        homology is that of the landmark complex.

    Examples
    --------
    >>> relation = VisibilityRelation.from_observations([{"a", "b"}, {"b", "c"}, {"a", "c"}])
    >>> observation_complex(relation).betti_numbers()
    (1, 1)
    """
    return LandmarkComplex.from_observations(relation.transposed().rows)
