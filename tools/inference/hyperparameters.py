"""Hyperparameters: every number that decides what a diagnosis, a watch, or a test of the gap concludes.

A number decides if another value of it moves a probability, a verdict, `selected` or an event while all fits stay as
they are: a prior, a threshold, the width of a threshold. Budgets of a search, steps of a derivative, which rows of a
recording can be judged, and what a page shows are not here. A test counts these fields and rejects such a number
elsewhere in diagnose, watch, the gap's shares and heading, and healthy_level; docs/generate.py writes the table of the
reference from them. Not here are the numbers of the comparison of readings (tools/readings), of a user's vehicles
(tools/own) and of identification, the priors of parameters that a fit has, and prior odds of single labels of ocean
gliders (in their catalogue).
"""

from collections.abc import Iterator
from dataclasses import Field, dataclass, field, fields
from typing import Any

CONTRACT = "contract"  # docs/reference/gap.md
DOMAIN = "domain"  # known of vehicles and their instruments
FITTED = "fitted"  # to opened sets of simulated cases
CONVENTION = "convention"  # a round number that was assumed, and never fitted


def number(value: float, unit: str, meaning: str, source: str) -> Any:
    """Declare a hyperparameter: a field with its default, and what the reference prints beside it.

    Args:
        value: in `unit`.
        unit: "1" for a ratio.
        meaning: what it is a prior or a bound of.
        source: CONTRACT, DOMAIN, FITTED or CONVENTION.
    """
    return field(default=value, metadata={"unit": unit, "meaning": meaning, "source": source})


@dataclass(frozen=True)
class DiagnosisNumbers:
    """Of a diagnosis by the vehicle file (docs/explanation/diagnosis.md)."""

    evidence_needed: float = number(12.0, "nat", "prior log odds of no effect to one effect", FITTED)
    confounded_evidence: float = number(
        6.0, "nat", "log evidence within which two labels are not distinguished", CONVENTION
    )
    gate_width: float = number(2.0, "1", "what a rule asks for in full, over where it begins", CONVENTION)
    material: float = number(0.1, "tolerance", "least movement of a channel in a window that is a gap", CONTRACT)
    held_out_share: float = number(
        0.3, "1", "least gap closed on held-out runs by an effect beside another, over the gap that is left", FITTED
    )
    error_rate: float = number(0.03, "1", "probability that the search has missed the cause", FITTED)
    none_ratio: float = number(
        0.9, "1", "largest ratio of P(none) to P(main cause) once an effect is there", CONVENTION
    )
    specified_main_size: float = number(
        1.2, "floors", "`own_size` of a main cause if the noise is as in the file", FITTED
    )
    main_size_width: float = number(0.25, "e-folds", "width of `own_size` for a main cause, 1 sigma", FITTED)
    own_size: float = number(
        1.8, "floors", "size at which a main cause, or a residual, is as likely as not an effect of its own", FITTED
    )
    specified_unknown_size: float = number(
        0.8, "floors", "`own_size` of a residual if the noise is as in the file", FITTED
    )
    unknown_width: float = number(
        0.35, "e-folds", "width of `own_size` and of `misfit_share` for a residual, 1 sigma", FITTED
    )
    misfit_share: float = number(
        0.145, "1", "share of the explainable misfit, or squared gap, left at which unknown is as likely as not", FITTED
    )
    misfit_share_width: float = number(
        1.1, "e-folds", "width of `misfit_share` beside disorder and at a sensor alone, 1 sigma", FITTED
    )
    sensor_misfit_share: float = number(
        0.03, "1", "the same if all of it is left at the sensor of a selected effect", FITTED
    )
    alone_ratio: float = number(
        2.0, "1", "gain of one element's noise over any other from which the residual may be there alone", FITTED
    )
    residual_sigma: float = number(6.0, "sigma", "whiteness statistic from which something is left", CONVENTION)
    far_gap: float = number(
        3.0, "tolerances", "gap of the best explanation from which the vehicle may be another", FITTED
    )
    far_full_gap: float = number(8.0, "tolerances", "the same from which it is another", FITTED)
    least_unknown: float = number(0.002, "1", "least P(unknown)", CONVENTION)
    kept_gap_share: float = number(
        0.9, "1", "largest gap left, over the recalibrated one, with which effects beside unknown stay", CONVENTION
    )
    single_axis_share: float = number(
        0.65, "1", "largest gain of one axis over that of turbulence with which it is turbulence", FITTED
    )
    wave_share: float = number(0.5, "1", "least power about one frequency with which it is waves", FITTED)
    wave_band: float = number(0.25, "1", "half width of that line over its frequency", CONVENTION)
    clock_share: float = number(0.5, "1", "least gain of the clock's noise over the largest gain", CONVENTION)
    clock_scale_share: float = number(
        0.9, "1", "gain over the best of the largest scale at which a clock wanders", FITTED
    )
    other_clock_share: float = number(
        0.5, "1", "squared error of the other label of a clock over its own at which it is that one", CONVENTION
    )
    noise_accurate: float = number(0.03, "e-folds", "error of the file's noise level if it is right, 1 sigma", DOMAIN)
    noise_free: float = number(0.35, "e-folds", "the same if it is not", DOMAIN)
    noise_factor: float = number(2.0, "1", "largest factor by which a noise level differs from the file", DOMAIN)
    noise_factor_rejected: float = number(
        2.5, "1", "factor of the disturbance at which the file is as likely as not right", FITTED
    )
    identified_unknown: float = number(
        0.9, "1", "P(unknown) of a vehicle that had to be identified from the same runs", CONVENTION
    )
    selected_probability: float = number(0.9, "1", "probability from which a label is selected", CONVENTION)


@dataclass(frozen=True)
class HealthyNumbers:
    """Of a diagnosis against healthy runs (docs/explanation/against-healthy.md)."""

    changed: float = number(0.5, "1", "prior probability of a change", CONVENTION)
    unexplained: float = number(0.15, "1", "prior probability of something unknown where no effect is", CONVENTION)
    stands_in: float = number(0.25, "1", "prior probability that a label stands for something unknown", CONVENTION)
    seldom: float = number(-2.0, "nat", "prior log odds of a changed inertia or added mass, over other labels", FITTED)
    unknown_scale: float = number(1.5, "e-folds", "size of something unknown in a mean square, 1 sigma", CONVENTION)
    site_scale: float = number(0.25, "e-folds", "mean square from site to site, 1 sigma", CONVENTION)
    run_scale: float = number(0.5, "e-folds", "mean square from run to run before any is seen, 1 sigma", CONVENTION)
    prior_runs: float = number(1.0, "runs", "weight of what is usual of a scatter from run to run", CONVENTION)
    form_error: float = number(0.2, "1", "share of a change that its label's equations miss, 1 sigma", CONVENTION)
    file_error: float = number(
        0.2, "prior", "error of the vehicle file in an effect's prior standard deviations, 1 sigma", CONVENTION
    )
    least_scale: float = number(0.05, "tolerance", "least residual of healthy runs in a channel", CONVENTION)


@dataclass(frozen=True)
class WatchNumbers:
    """Of a watch (docs/explanation/watch.md) and of the diagnosis of ocean gliders (docs/explanation/ocean.md)."""

    evidence_by_chance: float = number(
        7.3, "nat", "log evidence needed, less the logarithm of the number of changes compared", FITTED
    )
    false_alarms: float = number(0.05, "1", "probability of a change in an unchanged vehicle", CONVENTION)
    scatter_runs: int = number(3, "runs", "reference runs from which run-to-run scatter is known", CONVENTION)
    scatter_vehicle: float = number(0.05, "prior", "usual scatter of a vehicle's parameter, 1 sigma", CONVENTION)
    scatter_bias: float = number(0.3, "prior", "usual scatter of a sensor's bias, 1 sigma", CONVENTION)
    scatter_effect: float = number(0.01, "prior", "usual scatter of an effect, 1 sigma", CONVENTION)
    scatter_width: float = number(1.0, "e-folds", "width of the usual scatter, 1 sigma", CONVENTION)
    scatter_nis: float = number(0.02, "1", "usual scatter of a run's mean squared innovation, 1 sigma", CONVENTION)
    reference_runs: int = number(4, "runs", "largest number of first runs that are the reference", CONVENTION)
    reference_part: int = number(3, "1", "one run in so many is the reference without a given one", CONVENTION)
    growth_runs: int = number(3, "runs", "runs in which growth can be distinguished from a step", CONVENTION)
    form_error: float = number(0.06, "1", "error of an effect's form in its size, 1 sigma", FITTED)
    form_evidence_share: float = number(
        0.15, "1", "evidence of a further event over that of one in the same runs", FITTED
    )
    same_cosine: float = number(0.98, "1", "cosine from which a label is not a second effect", CONVENTION)
    rival_share: float = number(0.1, "1", "share of a label's deficit that an error of form cannot explain", CONVENTION)
    clean_run: float = number(5.0, "nat", "evidence that a run without excess noise counts against noise", CONVENTION)
    excess_noise_sigma: float = number(
        4.0, "sigma", "mean squared innovation of a run from which something is left", CONVENTION
    )
    burst_ratio: float = number(0.65, "1", "largest burstiness of turbulence", FITTED)
    burst_seconds: float = number(5.0, "s", "stretch of a run of which burstiness is taken", CONVENTION)
    fragments: int = number(3, "1", "adjacent changes that are one unknown change", FITTED)
    other_regime_ratio: float = number(
        2.0, "1", "`material` of a change in runs flown in another way, over the usual", FITTED
    )
    majority: float = number(0.5, "1", "probability, or share of the runs, from which a statement holds", CONVENTION)
    water_share: float = number(0.9, "1", "least share of the explainable misfit that is the water", CONVENTION)
    lasting_speed: float = number(0.02, "m/s", "speed of a force that lasts, 1 sigma", DOMAIN)
    lasting_odds: float = number(
        3.0,
        "nat",
        "prior log odds of such a force beside excess noise of the water, and against it beside a change",
        CONVENTION,
    )
    lasting_motion: float = number(
        0.01, "1", "least motion of depth or speed, over `lasting_speed`, of a label beside it", CONVENTION
    )
    ocean_form_error: float = number(0.1, "1", "`form_error` of an ocean glider", FITTED)
    ocean_form_share: float = number(0.1, "1", "share of an effect's evidence that another form may miss", FITTED)
    ocean_material: float = number(0.4, "tolerance", "`material` of an ocean glider", FITTED)
    ocean_growth: float = number(0.6, "tolerance", "`material` of slow growth of an ocean glider", FITTED)
    ocean_reference_runs: int = number(24, "runs", "`reference_runs` of an ocean glider", FITTED)


@dataclass(frozen=True)
class GapNumbers:
    """Of the gap's shares by part of the model and of the test of the heading (docs/reference/gap.md)."""

    part_evidence: float = number(5.0, "nat", "log evidence that a part of the model needs for a share", CONVENTION)
    independent_samples: float = number(4.0, "1", "independent samples of a channel in a window", CONVENTION)
    allowed_sigma: float = number(
        3.0, "sigma", "largest change of a parameter that the vehicle file allows", CONVENTION
    )
    heading_confidence: float = number(0.99, "1", "probability of the sign of an error with the heading", CONVENTION)
    heading_speed: float = number(0.01, "m/s", "least size of that error", DOMAIN)


DIAGNOSIS, HEALTHY, WATCH, GAP = DiagnosisNumbers(), HealthyNumbers(), WatchNumbers(), GapNumbers()
SECTIONS: dict[str, DiagnosisNumbers | HealthyNumbers | WatchNumbers | GapNumbers] = {
    "Diagnosis": DIAGNOSIS, "Against healthy runs": HEALTHY, "Watch and ocean gliders": WATCH, "Gap": GAP,
}  # fmt: skip


def listed() -> Iterator[tuple[str, Field, float]]:
    """Every hyperparameter: its section, its field with unit, meaning and source, and its value."""
    for section, numbers in SECTIONS.items():
        for one in fields(numbers):
            yield section, one, getattr(numbers, one.name)
