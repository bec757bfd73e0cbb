"""Records of the neighbours: extrapolated to the present, compared with the own value, averaged.

Each value counts with its edge's weight times the trust that the defences leave it, see ``airside.defence``.
"""

from __future__ import annotations

from ftcc.airside.elements.filters import critically_damped_step
from ftcc.airside.elements.vectors import added, scaled, turned
from ftcc.link.compiled import compiled
from ftcc.link.rotation import nearest_turn

__all__ = ["disagreement", "error_sums", "extrapolated", "filtered_error_sums", "motion_sums", "weighted_average"]


_VALUE, _RATE = range(2)
"""Columns of a record that begins with a value and its rate."""
_ERROR, _ERROR_RATE = 0, 3
"""Columns of a record of errors, each the first of three axes."""
_HEARD, _FILTERED, _FILTERED_RATE = 0, 1, 4
"""Columns of the memory of `filtered_error_sums`, the latter two the first of three axes each."""


@compiled
def _axes(row, first):
    return row[first], row[first + 1], row[first + 2]


@compiled
def _least_trust(trust):
    """Of a neighbour's three errors: whose error about one axis is left out is left out about all, as the sums of all
    three have one weight."""
    return min(trust[_ERROR], trust[_ERROR + 1], trust[_ERROR + 2])


@compiled
def extrapolated(value, rate, age, horizon):
    """A neighbour's value, extrapolated to the present by the rate that it sent, for at most ``horizon`` seconds."""
    return value + rate * min(age, horizon)


@compiled
def disagreement(estimate, heard, ahead, horizon, unheard, leave_out):
    """sum_j a_ij (estimate - x_j), sum_j a_ij and sum_j a_ij x_j' over the neighbours, eqs. (3.20), (5.12).

    x_j and its rate are the first two values of a record. x_j is extrapolated to the present and ``ahead`` seconds
    further, for at most ``horizon`` seconds. A neighbour not heard yet counts as ``unheard`` at rest, or is left out
    if ``leave_out`` > 0.
    """
    total = 0.0
    weights = 0.0
    rates = 0.0
    for j in range(heard.weight.shape[0]):
        weight = heard.weight[j] * heard.trust[j, _VALUE]
        if heard.valid[j] > 0.0:
            rate = heard.values[j, _RATE]
            neighbour = extrapolated(heard.values[j, _VALUE], rate, heard.age[j] + ahead, horizon)
        elif leave_out > 0.0:
            continue
        else:
            rate = 0.0
            neighbour = unheard
        total += weight * (estimate - neighbour)
        weights += weight
        rates += weight * rate
    return total, weights, rates


@compiled
def weighted_average(heard, column, oldest, horizon):
    """Average of the neighbours' value in ``column`` and of its rate in the next one, eqs. (4.10), (4.11).

    Values are extrapolated to the present by their rates, for at most ``horizon`` seconds. A neighbour is left out if
    its record is older than ``oldest`` seconds, or if it was never heard.

    Returns
    -------
    value, rate, weights : float
        ``weights`` is the sum of the weights that took part; the averages are 0 where it is.
    """
    value = 0.0
    rate = 0.0
    weights = 0.0
    for j in range(heard.weight.shape[0]):
        if heard.valid[j] > 0.0 and heard.age[j] <= oldest:
            weight = heard.weight[j] * heard.trust[j, column]
            value += weight * extrapolated(heard.values[j, column], heard.values[j, column + 1], heard.age[j], horizon)
            rate += weight * heard.values[j, column + 1]
            weights += weight
    if weights == 0.0:
        return 0.0, 0.0, 0.0
    return value / weights, rate / weights, weights


@compiled
def motion_sums(heard, column, carried):
    """sum_j a_ij, sum_j a_ij x_j at present and sum_j a_ij x_j', for x_j in ``column`` and its rate in the next one.

    ``carried`` = 1 extrapolates each x_j to the present by its rate, 0 holds it as it was sent. With the sums,
    sum_j a_ij (x - x_j) = weights x - positions, which moves on by ``rates`` within a control step, eqs. (6.22)-(6.23).
    A neighbour takes part from its first record on, however old.

    Returns
    -------
    weights, positions, rates : float
    """
    weights = 0.0
    positions = 0.0
    rates = 0.0
    for j in range(heard.weight.shape[0]):
        if heard.valid[j] > 0.0:
            weight = heard.weight[j] * heard.trust[j, column]
            rate = heard.values[j, column + 1]
            weights += weight
            positions += weight * (heard.values[j, column] + carried * rate * heard.age[j])
            rates += weight * rate
    return weights, positions, rates


@compiled
def error_sums(error, heard, oldest):
    """sum_j a_ij, sum_j a_ij (e - e_j) and sum_j a_ij e_j' over the neighbours, eqs. (7.12), (8.10).

    ``error`` is the own e of three angles (rad), and differences go the shorter way around; a record holds e_j and then
    its rate, both held between records. A neighbour takes part from its first record on, while that is at most
    ``oldest`` seconds old; 0 = for ever.
    """
    weights = 0.0
    total = (0.0, 0.0, 0.0)
    rates = (0.0, 0.0, 0.0)
    for j in range(heard.weight.shape[0]):
        if heard.valid[j] > 0.0 and (oldest <= 0.0 or heard.age[j] <= oldest):
            weight, record = heard.weight[j] * _least_trust(heard.trust[j]), heard.values[j]
            weights += weight
            total = added(total, scaled(weight, turned(error, _axes(record, _ERROR))))
            rates = added(rates, scaled(weight, _axes(record, _ERROR_RATE)))
    return weights, total, rates


@compiled
def filtered_error_sums(error, heard, memory, w, oldest, h):
    """As `error_sums`, with each neighbour's e_j through a `critically_damped_step` of ``w`` rad/s, whose rate is e_j'.

    ``memory`` (n, 7) holds a row per neighbour: 1 once heard, the filtered e_j, its rate. A filter starts at the first
    e_j, at rest, and stands still while its neighbour is left out. To be called once every ``h`` seconds.
    """
    weights = 0.0
    total = (0.0, 0.0, 0.0)
    rates = (0.0, 0.0, 0.0)
    for j in range(heard.weight.shape[0]):
        if heard.valid[j] > 0.0 and (oldest <= 0.0 or heard.age[j] <= oldest):
            row = memory[j]
            for axis in range(3):
                target = heard.values[j, _ERROR + axis]
                value, rate = row[_FILTERED + axis], row[_FILTERED_RATE + axis]
                if row[_HEARD] == 0.0:
                    value, rate = target, 0.0
                else:
                    value, rate = critically_damped_step(value, rate, nearest_turn(target, value), w, h)
                row[_FILTERED + axis], row[_FILTERED_RATE + axis] = value, rate
            row[_HEARD] = 1.0
            weight = heard.weight[j] * _least_trust(heard.trust[j])
            weights += weight
            total = added(total, scaled(weight, turned(error, _axes(row, _FILTERED))))
            rates = added(rates, scaled(weight, _axes(row, _FILTERED_RATE)))
    return weights, total, rates
