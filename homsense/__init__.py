"""Homological sensing: localization by counting holes in a landmark complex.

The method of J. Derenick, A. Speranzon and R. Ghrist, "Homological Sensing for Mobile Robot
Localization", ICRA 2013. Pure: values in, values out.
"""

from homsense.adaptive import KldSampling
from homsense.calibration import calibrate_r_geo
from homsense.code_map import CodeMap
from homsense.composition import composed
from homsense.configuration import LocalizerConfig
from homsense.detection import (
    Detection,
    DetectionPoint,
    choose_detection,
    detection_curve,
)
from homsense.diagnosis import Diagnosis, Finding, diagnose
from homsense.epochs import EpochFiltration
from homsense.errors import (
    ComputationLimitError,
    HomsenseError,
    InvalidComplexError,
    InvalidConfigurationError,
    InvalidInputError,
    InvalidMapError,
    InvalidScanError,
)
from homsense.estimate import PoseDistribution
from homsense.expectation import Expectation, expect
from homsense.free_space import FreeSpace
from homsense.grid import Grid
from homsense.height import HeightMap
from homsense.imu import ImuNoise, ImuSample, Velocity, preintegrate
from homsense.kriging import Counted, krige
from homsense.likelihood import JointLikelihood, JointMeasurement, Likelihood
from homsense.localizer import Localizer, LocalizerState
from homsense.modes import Mode
from homsense.motion import ImuMotion, MotionModel, OdometryMotion
from homsense.nerve import landmark_complex, observation_complex
from homsense.noise import CountNoise, FieldNoise, Noise
from homsense.particles import Particles
from homsense.pedestrian import walked
from homsense.pose import Delta
from homsense.prior import GaussianPrior, HeadingPrior, PolygonPrior, Prior, UniformPrior
from homsense.profiles import Profiles
from homsense.quarantine import Displaced, displaced
from homsense.radio import RadioModel, estimate_radio
from homsense.range_check import RangePoint, choose_cut, range_curve
from homsense.recovery import AugmentedMcl, Doubt, Recovery, Relocation
from homsense.registered.complex import RegisteredComplex, Sighting
from homsense.registered.crowd import WalkScan
from homsense.registered.floors import FloorFit, rank_floors
from homsense.registered.place import HolesAtPlace, PlaceLikelihood
from homsense.registered.placing import LaidOutCrowd, register_crowd
from homsense.registered.radio_likelihood import RadioMapLikelihood
from homsense.registered.retracing import Retraced, retrace
from homsense.registered.similarity import Hearing
from homsense.relation import VisibilityRelation
from homsense.scan import Reading, visible_landmarks
from homsense.sensing import LocalHomology, sense_local_homology, sense_within
from homsense.simplicial import LandmarkComplex
from homsense.site_map import SiteMap
from homsense.smoothing import extend, smooth
from homsense.travel import Travel
from homsense.witness import WitnessFiltration
from homsense.witness_check import (
    WitnessPoint,
    median_witnesses,
    suggested_quorum,
    witness_curve,
)

__all__ = [
    "AugmentedMcl",
    "CodeMap",
    "ComputationLimitError",
    "CountNoise",
    "Counted",
    "Delta",
    "Detection",
    "DetectionPoint",
    "Diagnosis",
    "Displaced",
    "Doubt",
    "EpochFiltration",
    "Expectation",
    "FieldNoise",
    "Finding",
    "FloorFit",
    "FreeSpace",
    "GaussianPrior",
    "Grid",
    "HeadingPrior",
    "Hearing",
    "HeightMap",
    "HolesAtPlace",
    "HomsenseError",
    "ImuMotion",
    "ImuNoise",
    "ImuSample",
    "InvalidComplexError",
    "InvalidConfigurationError",
    "InvalidInputError",
    "InvalidMapError",
    "InvalidScanError",
    "JointLikelihood",
    "JointMeasurement",
    "KldSampling",
    "LaidOutCrowd",
    "LandmarkComplex",
    "Likelihood",
    "LocalHomology",
    "Localizer",
    "LocalizerConfig",
    "LocalizerState",
    "Mode",
    "MotionModel",
    "Noise",
    "OdometryMotion",
    "Particles",
    "PlaceLikelihood",
    "PolygonPrior",
    "PoseDistribution",
    "Prior",
    "Profiles",
    "RadioMapLikelihood",
    "RadioModel",
    "RangePoint",
    "Reading",
    "Recovery",
    "RegisteredComplex",
    "Relocation",
    "Retraced",
    "Sighting",
    "SiteMap",
    "Travel",
    "UniformPrior",
    "Velocity",
    "VisibilityRelation",
    "WalkScan",
    "WitnessFiltration",
    "WitnessPoint",
    "calibrate_r_geo",
    "choose_cut",
    "choose_detection",
    "composed",
    "detection_curve",
    "diagnose",
    "displaced",
    "estimate_radio",
    "expect",
    "extend",
    "krige",
    "landmark_complex",
    "median_witnesses",
    "observation_complex",
    "preintegrate",
    "range_curve",
    "rank_floors",
    "register_crowd",
    "retrace",
    "sense_local_homology",
    "sense_within",
    "smooth",
    "suggested_quorum",
    "visible_landmarks",
    "walked",
    "witness_curve",
]
