"""What an identified vehicle file says of itself in the spreads of labels: values, scatter, levels of healthy runs."""

from collections.abc import Sequence

import numpy as np

from glider.tools.inference.hyperparameters import HEALTHY
from glider.tools.inference.pooled import Scatter
from glider.tools.own.decision import Healthy, UsualLabels
from glider.tools.own.declare import RUN
from glider.tools.own.effects import (
    NOISE,
    Effect,
    ModelPoint,
    form_errors,
    moved,
    noise_effects,
    standard_effects,
    unexplained,
)
from glider.tools.own.error_components import Components, Whitening, patterns
from glider.tools.own.files import IdentifiedTable
from glider.tools.own.hierarchy import ChannelErrors
from glider.tools.own.identify import USUAL_SESSION_SHARE
from glider.tools.own.observer import Observer
from glider.tools.own.runs_fit import USUAL_OWN_SCATTER, USUAL_SCATTER
from glider.tools.own.sessions import session_share

UNIDENTIFIED_INFLATION = 30.0  # rows of a window that err alike, of a vehicle that was never identified


def healthy_of(observer: Observer) -> Healthy:
    """What an identified vehicle file says of itself; one that is not identified, what it allows for."""
    declared, table = observer.declared, observer.vehicle.file.identified
    labels = standard_effects(declared, observer.runs, observer.tolerances)
    effects = [*labels, *noise_effects(declared), *unexplained(declared, observer.runs), *form_errors(declared)]
    names = [one.label for one in effects]
    k = len(effects)
    # noise of healthy runs is taken from the evidence of more by itself (`noise_gain`)
    usual_scatter = np.array([0.0 if one.family == NOISE else USUAL_SCATTER for one in effects])
    usual = UsualLabels(usual_scatter, *np.zeros((3, k)))
    scatter, V = np.zeros(k), np.zeros((k, k))
    if table is None:
        for one in declared.parameters:
            V[names.index(one.name), names.index(one.name)] = (
                one.uncertainty / effects[names.index(one.name)].spread
            ) ** 2
        errors = ChannelErrors(np.ones(len(declared.outputs)), np.full(len(declared.outputs), UNIDENTIFIED_INFLATION))
        scatter[[names.index(one.name) for one in declared.parameters if one.scope == RUN]] = USUAL_OWN_SCATTER
        of_sessions = Scatter(np.sqrt(USUAL_SESSION_SHARE) * scatter)
        return Healthy(effects, V, Scatter(scatter), of_sessions, UsualLabels(*np.zeros((4, k))), errors, 1.0, 1,
                       HEALTHY.run_scale)  # fmt: skip
    # an effect that the vehicle has of an input that never moves here is none of these runs
    known = [n for n, name in enumerate(table.parameters) if name in names]
    places = [names.index(table.parameters[n]) for n in known]
    spreads, count = np.array([effects[k].spread for k in places]), len(table.parameters)
    covariance = np.array(table.covariance).reshape(count, count)[np.ix_(known, known)]
    V[np.ix_(places, places)] = covariance / np.outer(spreads, spreads)
    for n, effect in enumerate(effects):  # of other operating points than identified ones, how large such forces are
        if effect.at_point is not None and effect.at_point >= len(table.operating_points):
            V[n, n] = (table.operating_scatter.get(effect.name, 0.0) / effect.spread) ** 2
    session = np.zeros(k)
    shared = table.session_scatter or {
        name: float(np.sqrt(table.session_share)) * value for name, value in table.scatter.items()
    }
    for into, values in ((scatter, table.scatter), (session, shared), (usual.scatter, table.label_scatter),
                         (usual.session, table.label_session_scatter), (usual.mean, table.label_mean),
                         (usual.error, table.label_mean_error)):  # fmt: skip
        for name, value in values.items():
            if name in names:
                into[names.index(name)] = value / effects[names.index(name)].spread
    errors = ChannelErrors(
        np.array([max(table.gap.get(one.name, 1.0), 1e-3) for one in declared.outputs]),
        np.array([table.channel_inflation.get(one.name, 1.0) for one in declared.outputs]),
        _whitenings(observer, table),
    )
    together = [_correlation(effects, table, one) for one in (table.scatter_correlation, table.session_correlation)]
    runs, sessions = (Scatter(sizes, one) for sizes, one in zip((scatter, session), together, strict=True))
    if not table.label_session_scatter:  # a file that does not say
        usual.session[:] = np.sqrt(session_share(runs, sessions, effects)) * usual.scatter
    return Healthy(effects, V, runs, sessions, usual, errors, table.inflation, table.runs, table.level_scatter,
                   table.noise_gain, table.run_inflation, table.sessions)  # fmt: skip


def _correlation(
    effects: Sequence[Effect], table: IdentifiedTable, rows: Sequence[Sequence[float]]
) -> np.ndarray | None:
    """Of deviations (k, k), rows of the numbers of `scatter`; None of a file that does not say."""
    if not rows:
        return None
    names, found = [one.label for one in effects], np.eye(len(effects))
    known = [n for n, name in enumerate(table.scatter) if name in names]
    places = [names.index(name) for name in table.scatter if name in names]
    found[np.ix_(places, places)] = np.array(rows)[np.ix_(known, known)]
    return found


def _whitenings(observer: Observer, table: IdentifiedTable) -> list[Whitening]:
    """Of every run, by the vehicle's own model; none where the file does not say what errors are made of."""
    declared = observer.declared
    if not table.row_noise or not observer.vehicle.level:
        return []
    by = Components(np.array([table.row_noise.get(one.name, 1.0) for one in declared.outputs]),
                    np.array([table.force_variance.get(one.name, 1.0) for one in declared.noises]),
                    np.array([table.held_force_variance.get(one.name, 1.0) for one in declared.noises]),
                    table.start_variance)  # fmt: skip
    return observer.each_run(lambda n: Whitening(patterns(observer, n, observer.horizon), by))


def effect_point(observer: Observer, healthy: Healthy, labels: Sequence[str], sizes: np.ndarray) -> ModelPoint:
    """The vehicle's model with labels of sizes (labels,) in spreads."""
    values = np.zeros(len(healthy.effects))
    values[healthy.at(labels)] = sizes
    return moved(observer.declared, observer.point, healthy.effects, values)
