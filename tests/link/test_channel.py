"""The emulated radio channel and the inbox: what is lost, when the rest can be used, and what a receiver holds."""

from __future__ import annotations

import math
import random
from collections.abc import Iterable

import numpy as np
import pytest

from ftcc.link.channel import SLOTS, Channel, Edge, Inbox, deliver, hear, new_inbox

LATENCY = EXCHANGE = 50_000
PERIOD = 10_000
"""us: 20 Hz records over a link of one exchange period, 100 Hz control."""

PERFECT = Channel()
RECEIVED, LOST, WAITING = (Edge._fields.index(name) for name in ("received", "lost", "waiting"))


class Edge7To1:
    """The edge from UAV 7 to UAV 1, alone in an inbox; record n is stamped n exchange periods and carries n."""

    def __init__(self, channel: Channel = PERFECT, seed: int = 1, latency: int = LATENCY) -> None:
        self.inbox = new_inbox([[7]], [1], 1, channel)
        self.seed = seed
        self.latency = latency

    def deliver(self, sequence: int, radio_on: bool = True, now: int | None = None) -> bool:
        """Admit a record, by default as soon as it is due; whether it passed the channel."""
        before = self.inbox.edges[0, 0, RECEIVED]
        stamp = sequence * EXCHANGE
        values = np.array([float(sequence)])
        due = stamp + self.latency if now is None else now
        deliver(self.inbox, 0, 0, sequence, stamp, radio_on, values, self.latency, due, self.seed)
        return bool(self.inbox.edges[0, 0, RECEIVED] > before)

    def verdicts(self, sequences: Iterable[int]) -> list[bool]:
        return [self.deliver(sequence) for sequence in sequences]

    def hear(self, now: int) -> tuple[bool, float, float]:
        """Validity, age and value held at ``now``."""
        hear(self.inbox, 0, now)
        return bool(self.inbox.valid[0, 0]), float(self.inbox.age[0, 0]), float(self.inbox.values[0, 0, 0])

    def count(self, column: int) -> int:
        return int(self.inbox.edges[0, 0, column])


# Loss.


@pytest.mark.parametrize("loss", [0.01, 0.1, 0.3, 0.5, 0.8])
def test_loss_rate_lies_within_binomial_bounds(loss):
    edge, n = Edge7To1(Channel(loss=loss)), 5000
    edge.verdicts(range(n))
    assert edge.count(LOST) == pytest.approx(loss * n, abs=4.0 * math.sqrt(n * loss * (1.0 - loss)))
    assert edge.count(LOST) + edge.count(RECEIVED) == n


@pytest.mark.parametrize(("loss", "passed"), [(0.0, 200), (1.0, 0)])
def test_a_perfect_link_loses_nothing_and_a_dead_one_everything(loss, passed):
    assert sum(Edge7To1(Channel(loss=loss)).verdicts(range(200))) == passed


def test_losses_of_consecutive_records_are_independent():
    lost = ~np.array(Edge7To1(Channel(loss=0.3)).verdicts(range(5000)))
    assert abs(np.corrcoef(lost[:-1], lost[1:])[0, 1]) < 4.0 / math.sqrt(5000)


def test_another_seed_loses_other_records():
    def verdicts(seed: int) -> list[bool]:
        return Edge7To1(Channel(loss=0.5), seed).verdicts(range(200))

    assert verdicts(1) == verdicts(1)
    assert verdicts(1) != verdicts(2)
    assert verdicts(1) != verdicts(1 + 2**32)


def test_a_draw_belongs_to_sender_receiver_and_number_and_not_to_the_order_of_arrival():
    """The same edge draws the same in any row, in any column and amid any traffic; every other edge draws otherwise."""
    channel = Channel(loss=0.4, burst_start=0.1, burst_end=0.4, jitter=0.2)
    alone = np.array(Edge7To1(channel).verdicts(range(300)))
    inbox = new_inbox([[2, 7], [1], [1, 5, 7]], [6, 2, 1], 1, channel)
    places = [(i, edge) for i in range(3) for edge in range(int(inbox.degree[i]))]
    following = dict.fromkeys(places, 0)
    verdicts: dict[tuple[int, int], list[bool]] = {place: [] for place in places}
    draw = random.Random(2)
    while places:
        i, edge = draw.choice(places)
        n = following[i, edge]
        before = inbox.edges[i, edge, RECEIVED]
        deliver(inbox, i, edge, n, n * EXCHANGE, True, np.array([0.0]), LATENCY, n * EXCHANGE + LATENCY, 1)
        verdicts[i, edge].append(bool(inbox.edges[i, edge, RECEIVED] > before))
        following[i, edge] += 1
        if n + 1 == 300:
            places.remove((i, edge))
    assert verdicts.pop((2, 2)) == alone.tolist()
    for others in verdicts.values():
        assert abs(np.corrcoef(others, alone)[0, 1]) < 4.0 / math.sqrt(300)


# Burst loss (Gilbert-Elliott).


def burst_lengths(lost: np.ndarray) -> np.ndarray:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], lost.astype(int), [0]))))
    return edges[1::2] - edges[::2]


def test_bursts_have_the_mean_length_and_the_stationary_loss_of_gilbert_and_elliott():
    """Leaving a burst with probability r per record makes bursts 1/r long; p/(p + r) of all records are lost."""
    p, r, n = 0.05, 0.25, 20_000
    lost = ~np.array(Edge7To1(Channel(burst_start=p, burst_end=r)).verdicts(range(n)))
    bursts = burst_lengths(lost)
    share = p / (p + r)
    correlation = 1.0 - p - r
    spread = math.sqrt(share * (1.0 - share) * (1.0 + correlation) / (1.0 - correlation) / n)
    assert lost.mean() == pytest.approx(share, abs=4.0 * spread)
    assert bursts.mean() == pytest.approx(1.0 / r, abs=4.0 * math.sqrt((1.0 - r) / r**2 / len(bursts)))


def test_loss_in_and_between_bursts_follows_its_own_probability():
    p, r, n = 0.1, 0.1, 20_000
    lost = ~np.array(Edge7To1(Channel(loss=0.1, burst_start=p, burst_end=r, burst_loss=0.7)).verdicts(range(n)))
    correlation = 1.0 - p - r
    spread = math.sqrt(0.25 * (1.0 + correlation) / (1.0 - correlation) / n)
    assert lost.mean() == pytest.approx(0.5 * 0.1 + 0.5 * 0.7, abs=4.0 * spread)


def test_the_burst_chain_also_steps_for_records_that_were_never_received():
    """In real time a receiver may see only every third record: it must lose the same ones as if it had seen all."""
    channel = Channel(loss=0.2, burst_start=0.05, burst_end=0.25, burst_loss=0.9)
    every = Edge7To1(channel).verdicts(range(3000))
    assert Edge7To1(channel).verdicts(range(0, 3000, 3)) == every[::3]
    ragged = sorted(random.Random(3).sample(range(3000), 500))
    assert Edge7To1(channel).verdicts(ragged) == [every[n] for n in ragged]


def test_a_record_that_comes_twice_or_late_is_taken_once():
    edge = Edge7To1()
    assert edge.verdicts([0, 1, 1, 0, 2]) == [True, True, False, False, True]
    assert edge.count(RECEIVED) == 3
    assert edge.count(LOST) == 0


# Delay.


@pytest.mark.parametrize("delay", [0.0, 0.004, 0.01, 0.02, 0.055, 0.3])
def test_a_record_can_be_used_from_the_first_tick_at_stamp_plus_latency_plus_delay(delay):
    edge = Edge7To1(Channel(delay=delay))
    edge.deliver(0)
    usable = LATENCY + round(delay * 1e6)
    for now in range(LATENCY, 500_000, PERIOD):
        valid, age, _ = edge.hear(now)
        assert valid == (now >= usable)
        if valid:
            assert age == now / 1e6


def test_jitter_spreads_the_delay_evenly_between_0_and_its_value():
    edge = Edge7To1(Channel(delay=0.02, jitter=0.1))
    delays = []
    for n in range(2000):
        edge.deliver(n)
        slot = n % SLOTS
        delays.append(int(edge.inbox.slot_usable[0, 0, slot]) - n * EXCHANGE - LATENCY)
        edge.hear(n * EXCHANGE + LATENCY)
    seconds = np.array(delays) / 1e6
    assert seconds.min() >= 0.02
    assert seconds.max() <= 0.12
    assert seconds.mean() == pytest.approx(0.07, abs=4.0 * 0.1 / math.sqrt(12 * 2000))
    assert seconds.std() == pytest.approx(0.1 / math.sqrt(12.0), rel=0.05)


def test_newest_stamp_wins_where_jitter_lets_records_overtake_each_other():
    edge = Edge7To1(Channel(jitter=0.3))
    usable: dict[int, int] = {}
    overtaken = 0
    for now in range(LATENCY, 200 * EXCHANGE, PERIOD):
        if (now - LATENCY) % EXCHANGE == 0:
            n = (now - LATENCY) // EXCHANGE
            edge.deliver(n)
            waits = edge.inbox.slot_stamp[0, 0, n % SLOTS] == n * EXCHANGE
            usable[n] = int(edge.inbox.slot_usable[0, 0, n % SLOTS]) if waits else now
        valid, age, value = edge.hear(now)
        held = [n for n, time in usable.items() if time <= now]
        assert valid == bool(held)
        if held:
            assert value == max(held)
            assert age == pytest.approx((now - max(held) * EXCHANGE) / 1e6, abs=1e-12)
            overtaken += any(usable[n] > now for n in range(max(held)))
    assert overtaken > 100


def test_a_delayed_record_never_displaces_a_newer_one():
    edge = Edge7To1(Channel(delay=0.2))
    edge.deliver(0)
    edge.inbox.quality[0, 0] = Channel()
    edge.deliver(1)
    assert edge.hear(2 * EXCHANGE)[2] == 1.0
    assert edge.hear(20 * EXCHANGE)[2] == 1.0
    assert edge.count(WAITING) == 0


def test_age_grows_in_silence_and_is_never_negative():
    edge = Edge7To1(latency=0)
    assert edge.hear(0) == (False, 0.0, 0.0)
    edge.deliver(4)
    assert edge.hear(3 * EXCHANGE)[:2] == (True, 0.0)
    assert edge.hear(4 * EXCHANGE)[:2] == (True, 0.0)
    assert edge.hear(7 * EXCHANGE)[:2] == (True, 0.15)


def test_a_record_that_comes_late_in_wall_time_is_used_at_once_if_its_channel_delay_is_over():
    edge = Edge7To1(Channel(delay=0.05))
    edge.deliver(0, now=400_000)
    assert edge.hear(400_000)[:2] == (True, 0.4)


def test_as_many_records_as_there_are_slots_can_be_under_way_without_loss():
    """0.05 s of latency and 1.55 s of delay at 20 Hz: 31 records under way, each used at its time."""
    edge = Edge7To1(Channel(delay=1.55))
    most = 0
    for n in range(200):
        edge.deliver(n)
        valid, _, value = edge.hear(n * EXCHANGE + LATENCY)
        most = max(most, edge.count(WAITING))
        assert valid == (n >= 31)
        if valid:
            assert value == n - 31
    assert most == 31 < SLOTS


def test_more_records_under_way_than_slots_leave_the_books_true():
    """Beyond the slots (which scenarios refuse) older records give way; what is heard has its own stamp and value."""
    edge = Edge7To1(Channel(jitter=3.0))
    for n in range(500):
        edge.deliver(n)
        valid, age, value = edge.hear(n * EXCHANGE + LATENCY)
        assert 0 <= edge.count(WAITING) <= SLOTS
        assert edge.count(WAITING) == (edge.inbox.slot_stamp[0, 0] >= 0).sum()
        if valid:
            assert age == pytest.approx((n + 1 - value) * EXCHANGE / 1e6, abs=1e-12)
    assert edge.hear(600 * EXCHANGE)[0]
    assert edge.count(WAITING) == 0


# Cuts.


def test_blackout_lets_nothing_through_and_leaves_what_was_heard():
    edge = Edge7To1()
    edge.deliver(0)
    edge.inbox.quality[0, 0] = Channel(blocked=1.0)
    assert not any(edge.verdicts(range(1, 10)))
    assert edge.count(LOST) == 9
    valid, age, value = edge.hear(10 * EXCHANGE)
    assert (valid, age, value) == (True, 0.5, 0.0)
    edge.inbox.quality[0, 0] = Channel()
    assert edge.deliver(10)
    assert edge.hear(11 * EXCHANGE)[1:] == (0.05, 10.0)


def test_a_radio_that_is_off_is_a_lost_record():
    edge = Edge7To1()
    assert not edge.deliver(0, radio_on=False)
    assert edge.hear(LATENCY) == (False, 0.0, 0.0)
    assert edge.deliver(1)
    assert (edge.count(LOST), edge.count(RECEIVED)) == (1, 1)


def test_a_cut_does_not_shift_the_draws_of_the_records_after_it():
    channel = Channel(loss=0.3, burst_start=0.1, burst_end=0.3)
    whole = Edge7To1(channel).verdicts(range(200))
    edge = Edge7To1(channel)
    edge.verdicts(range(50))
    edge.inbox.quality[0, 0, Channel._fields.index("blocked")] = 1.0
    edge.verdicts(range(50, 100))
    edge.inbox.quality[0, 0, Channel._fields.index("blocked")] = 0.0
    assert edge.verdicts(range(100, 200)) == whole[100:]


def test_plain_python_and_compiled_code_pass_the_same_records():
    channel = Channel(0.3, 0.1, 0.3, 0.8, 0.02, 0.2)

    def books(through, listen) -> Inbox:
        inbox = new_inbox([[7]], [1], 1, channel)
        for n in range(300):
            now = n * EXCHANGE + LATENCY
            through(inbox, 0, 0, n, n * EXCHANGE, True, np.array([float(n)]), LATENCY, now, 2**40 + 9)
            listen(inbox, 0, now)
        return inbox

    plain = books(getattr(deliver, "py_func", deliver), getattr(hear, "py_func", hear))
    for one, other in zip(plain, books(deliver, hear), strict=True):
        assert np.array_equal(one, other)
