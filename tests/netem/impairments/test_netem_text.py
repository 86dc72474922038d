"""Netem's option strings: what is read as a link profile, what is noted, and what is refused and why."""

import json
import re

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from netem.impairments.netem_string import NetemTextError, Reading, read

CHAIN_NOTE = 'step = "packet" as in netem: the chain freezes on an idle link; step = "time" steps with simulated time'
HALF_WIDTH = "jitter is a half-width here (no distribution given)"
STANDARD_DEVIATION = "jitter is a standard deviation here (distribution given)"
BELOW_ZERO = "jitter is above the mean: delays below zero count as zero"
PARETO = "netem's pareto table has 0.82 of this jitter and ends 4 jitters above the mean; affinet's has it all"
CORRELATED = "affinet's correlation keeps the stated distribution exactly; netem's bends it, or hardly correlates"


def gilbert_elliott(p, r, bad, good):
    return {"loss": [{"model": "gilbert-elliott", "p": p, "r": r, "bad": bad, "good": good, "step": "packet"}]}


def markov(p13, p31, p32, p23, p14):
    chain = {"model": "markov", "p13": p13, "p31": p31, "p32": p32, "p23": p23, "p14": p14, "step": "packet"}
    return {"loss": [chain]}


def delay(model, **parameters):
    return {"delay": {"model": model, **parameters}}


@pytest.mark.parametrize(
    ("text", "profile"),
    [
        ("loss 10%", {"loss": [{"model": "bernoulli", "p": 0.1}]}),
        ("loss random 10%", {"loss": [{"model": "bernoulli", "p": 0.1}]}),
        ("loss 10% 0%", {"loss": [{"model": "bernoulli", "p": 0.1}]}),
        ("loss 0%", {"loss": [{"model": "bernoulli", "p": 0.0}]}),
        ("loss 100%", {"loss": [{"model": "bernoulli", "p": 1.0}]}),
        ("loss 0.3%", {"loss": [{"model": "bernoulli", "p": 0.003}]}),
        ("delay 10ms", delay("constant", mean=0.01)),
        ("delay 0ms", delay("constant", mean=0.0)),
        ("delay 100us", delay("constant", mean=0.0001)),
        ("delay 1s", delay("constant", mean=1.0)),
        ("delay 2.5ms", delay("constant", mean=0.0025)),
        ("delay 500ns", delay("constant", mean=5e-7)),
        ("delay 2.3MS", delay("constant", mean=0.0023)),
        ("duplicate 1%", {"duplicate": 0.01}),
        ("duplicate 1% 0%", {"duplicate": 0.01}),
        ("corrupt 0.1%", {"corrupt": [{"kind": "bit-flip", "p": 0.001}]}),
        ("corrupt 0.1% 0%", {"corrupt": [{"kind": "bit-flip", "p": 0.001}]}),
        ("delay 10ms reorder 25%", {**delay("constant", mean=0.01), "reorder": 0.25}),
        ("reorder 25% 0% delay 10ms", {**delay("constant", mean=0.01), "reorder": 0.25}),
        ("rate 250kbit", {"rate": {"rate": 250000.0}}),
        ("rate 1mbit", {"rate": {"rate": 1e6}}),
        ("rate 64Kbit", {"rate": {"rate": 64000.0}}),
        ("rate 1gbit", {"rate": {"rate": 1e9}}),
        ("rate 1tbit", {"rate": {"rate": 1e12}}),
        ("rate 9600bit", {"rate": {"rate": 9600.0}}),
    ],
)
def test_what_means_the_same_is_read_without_a_note(text, profile):
    assert read(text) == Reading(profile, ())


@pytest.mark.parametrize(
    ("text", "profile"),
    [
        ("loss gemodel 1%", gilbert_elliott(0.01, 0.99, 1.0, 0.0)),
        ("loss gemodel 1% 10%", gilbert_elliott(0.01, 0.1, 1.0, 0.0)),
        ("loss gemodel 1% 10% 70%", gilbert_elliott(0.01, 0.1, 0.7, 0.0)),
        ("loss gemodel 1% 10% 70% 0.1%", gilbert_elliott(0.01, 0.1, 0.7, 0.001)),
        ("loss state 10%", markov(0.1, 0.9, 0.0, 1.0, 0.0)),
        ("loss state 10% 20%", markov(0.1, 0.2, 0.0, 1.0, 0.0)),
        ("loss state 10% 20% 30%", markov(0.1, 0.2, 0.3, 1.0, 0.0)),
        ("loss state 10% 20% 30% 40%", markov(0.1, 0.2, 0.3, 0.4, 0.0)),
        ("loss state 10% 20% 30% 40% 50%", markov(0.1, 0.2, 0.3, 0.4, 0.5)),
    ],
)
def test_a_chain_has_netems_defaults_and_the_note_that_packets_step_it(text, profile):
    assert read(text) == Reading(profile, (CHAIN_NOTE,))


@pytest.mark.parametrize(
    ("text", "profile", "notes"),
    [
        ("delay 10ms 2ms", delay("uniform", mean=0.01, jitter=0.002), [HALF_WIDTH]),
        ("delay 10ms 0ms", delay("uniform", mean=0.01, jitter=0.0), [HALF_WIDTH]),
        ("delay 10ms 10ms", delay("uniform", mean=0.01, jitter=0.01), [HALF_WIDTH]),
        ("delay 10ms 20ms", delay("uniform", mean=0.01, jitter=0.02), [HALF_WIDTH, BELOW_ZERO]),
        ("delay 10ms 2ms 0%", delay("uniform", mean=0.01, jitter=0.002), [HALF_WIDTH]),
        ("delay 10ms 2ms 25%", delay("uniform", mean=0.01, jitter=0.002, correlation=0.25), [HALF_WIDTH, CORRELATED]),
        (
            "delay 10ms 2ms distribution uniform",
            delay("uniform", mean=0.01, jitter=0.002),
            ["jitter is a half-width here (distribution given)"],
        ),
        ("delay 10ms 2ms distribution normal", delay("normal", mean=0.01, jitter=0.002), [STANDARD_DEVIATION]),
        ("distribution normal delay 10ms 20ms", delay("normal", mean=0.01, jitter=0.02), [STANDARD_DEVIATION]),
        ("delay 10ms 2ms distribution pareto", delay("pareto", mean=0.01, jitter=0.002), [STANDARD_DEVIATION, PARETO]),
        (
            "delay 10ms 2ms 50% distribution normal",
            delay("normal", mean=0.01, jitter=0.002, correlation=0.5),
            [STANDARD_DEVIATION, CORRELATED],
        ),
    ],
)
def test_jitter_is_read_with_a_note_of_what_it_measures(text, profile, notes):
    assert read(text) == Reading(profile, tuple(notes))


def test_options_add_up_in_any_order():
    options = ["loss gemodel 1% 10%", "delay 30ms 5ms", "duplicate 1%", "corrupt 0.1%", "reorder 25%", "rate 1mbit"]
    profile, notes = read(" ".join(options))
    assert list(profile) == ["loss", "delay", "duplicate", "corrupt", "reorder", "rate"]
    assert notes == (CHAIN_NOTE, HALF_WIDTH)
    assert read("\n ".join(reversed(options))) == (profile, notes)


@pytest.mark.parametrize(
    ("mean", "correlation", "p", "r"),
    [
        (10.0, 50.0, 0.05, 0.45),
        (0.3, 25.0, 0.00225, 0.74775),
        (30.0, 10.0, 0.27, 0.63),
        (10.0, 100.0, 0.001, 0.009),
        (0.0, 25.0, 0.0, 0.75),
    ],
)
def test_correlated_loss_is_refused_with_a_chain_of_the_same_mean_and_burstiness(mean, correlation, p, r):
    with pytest.raises(
        NetemTextError, match=r"almost nothing .*0\.3% 25% loses none .*10% 50% loses 0\.11%"
    ) as refusal:
        read(f"loss {mean:g}% {correlation:g}%")
    assert str(refusal.value).startswith(f"'{correlation:g}%': ")
    offered = re.search("`(loss gemodel [^`]*)`", str(refusal.value))
    (chain,) = read(offered[1]).profile["loss"]
    assert (chain["p"], chain["r"]) == pytest.approx((p, r))
    assert chain["p"] / (chain["p"] + chain["r"]) == pytest.approx(mean / 100)
    assert 1 - chain["p"] - chain["r"] == pytest.approx(min(correlation / 100, 0.99))


def test_the_offered_chain_is_ready_to_copy():
    with pytest.raises(NetemTextError, match=r"write `loss gemodel 5% 45%`$"):
        read("loss random 10% 50%")


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "'': nothing to read; write an option, such as `loss 10%`"),
        (" \t\n", "'': nothing to read"),
        ("10%", "'10%': not read; what is read: loss, delay, duplicate, corrupt, reorder, rate, distribution"),
        ("netem loss 10%", "'netem': not read; what is read: loss, "),
        ("loss 10% ecn", "'ecn': not read; what is read: "),
        ("seed 42", "'seed': not read; what is read: "),
        ("slot 10ms", "'slot': not read; what is read: "),
        (
            "limit 1000",
            "'limit': netem counts packets, affinet's queue is in bytes; leave it out and set rate.queue in bytes",
        ),
        ("delay 10ms reorder 25% gap 5", "'gap': affinet reorders by chance, not by count; write `reorder P%` alone"),
        ("loss 10% delay 10ms loss 1%", "'loss': given twice; give each option once"),
        ("delay 10ms 2ms distribution normal distribution pareto", "'distribution': given twice"),
        ("loss", "'loss': expected at least 1 value and at most 2, got 0"),
        ("loss 1% 0% 3%", "'loss': expected at least 1 value and at most 2, got 3"),
        ("loss random", "'loss': expected at least 1 value and at most 2, got 0"),
        ("loss gemodel", "'loss gemodel': expected at least 1 value and at most 4, got 0"),
        ("loss gemodel 1% 1% 1% 1% 1%", "'loss gemodel': expected at least 1 value and at most 4, got 5"),
        ("loss state 1% 1% 1% 1% 1% 1%", "'loss state': expected at least 1 value and at most 5, got 6"),
        ("loss fancy 10%", "'fancy': not a loss model of netem; write loss random, state or gemodel"),
        ("loss 0.1", "'0.1': expected a percentage from 0% to 100%, such as 10% (tc takes a bare 0.1 for 0.1%)"),
        ("loss -5%", "'-5%': expected a percentage from 0% to 100%"),
        ("loss 100.1%", "'100.1%': expected a percentage from 0% to 100%"),
        ("loss gemodel 1% 10% 101%", "'101%': expected a percentage from 0% to 100%"),
        ("loss 1e1%", "'1e1%': expected a percentage"),
        ("loss .5%", "'.5%': expected a percentage"),
        ("loss ١%", "'١%': expected a percentage"),
        ("delay", "'delay': expected at least 1 value and at most 3, got 0"),
        ("delay 1ms 1ms 1% 1%", "'delay': expected at least 1 value and at most 3, got 4"),
        (
            "delay 100",
            "'100': expected a time in s, ms, us or ns, such as 10ms (tc takes a bare number for microseconds, ",
        ),
        ("delay 10ms 5", "'5': expected a time in s, ms, us or ns"),
        ("delay 1min", "'1min': expected a time in s, ms, us or ns"),
        ("delay -1ms", "'-1ms': expected a time in s, ms, us or ns"),
        ("delay 10ms 25%", "'25%': expected a time in s, ms, us or ns"),
        (f"delay {'9' * 400}s", "9s': expected a time in s, ms, us or ns"),
        ("delay 10ms 2ms 0.25", "'0.25': expected a percentage"),
        ("delay 10ms 2ms 100%", "'100%': such a delay never changes; write a correlation below 100%"),
        ("delay 10ms 2ms distribution", "'': not a distribution that is read; write uniform, normal, pareto, or "),
        ("delay 10ms 2ms distribution normal 5%", "'normal 5%': not a distribution that is read"),
        ("delay 10ms 2ms distribution paretonormal", 'or give measured delays with model = "table"'),
        ("delay 10ms 2ms distribution experimental", "'experimental': not a distribution that is read; "),
        (
            "distribution normal",
            "'distribution': needs a delay and a jitter above zero; write `delay 10ms 2ms` with it",
        ),
        ("delay 10ms distribution normal", "'distribution': needs a delay and a jitter above zero"),
        ("delay 10ms 0ms distribution normal", "'distribution': needs a delay and a jitter above zero"),
        ("delay 0ms 5ms distribution normal", "'distribution': needs a delay and a jitter above zero"),
        ("duplicate 1% 10%", "'10%': netem's correlation changes the share; write `duplicate 1%`"),
        ("corrupt 1% 10%", "'10%': netem's correlation changes the share; write `corrupt 1%`"),
        ("delay 10ms reorder 1% 10%", "'10%': netem's correlation changes the share; write `reorder 1%`"),
        ("reorder 25%", "'reorder': only what is delayed can be overtaken; give a delay, such as `delay 10ms`"),
        ("delay 0ms reorder 25%", "'reorder': only what is delayed can be overtaken"),
        ("rate", "'rate': expected at least 1 value and at most 1, got 0"),
        ("rate 1mbit 20 100", "'rate': expected at least 1 value and at most 1, got 3"),
        ("rate 250kbps", "'250kbps': kbps misleads, as tc counts bytes by it; write 8kbit for 1kbps"),
        ("rate 1Bps", "'1Bps': bps misleads, as tc counts bytes by it; write 8bit for 1bps"),
        ("rate 1mibps", "'1mibps': expected a rate in bits per second, such as 250kbit (bit, kbit, mbit, gbit, tbit)"),
        ("rate 9600", "'9600': expected a rate in bits per second"),
        ("rate 50%", "'50%': expected a rate in bits per second"),
        ("rate -1mbit", "'-1mbit': expected a rate in bits per second"),
        ("rate 0kbit", "'0kbit': expected a rate above zero; leave rate out for no limit"),
    ],
)
def test_what_is_refused_names_the_word_and_what_would_be_right(text, problem):
    with pytest.raises(NetemTextError, match=re.escape(problem)):
        read(text)


OPTIONS = ["loss", "delay", "distribution", "duplicate", "corrupt", "reorder", "rate", "gap", "limit"]
MODELS = ["random", "state", "gemodel", "uniform", "normal", "pareto", "table"]
VALUES = ["0%", "10%", "100%", "0.1", "10ms", "0s", "2.5us", "1", "-1ms", "1mbit", "1kbps", "0bit", "bps", "%"]
VOCABULARY = st.sampled_from(OPTIONS + MODELS + VALUES)


@given(st.one_of(st.text(), st.lists(VOCABULARY, max_size=8).map(" ".join)))
@example("loss \ud800")
@example("rate \u212abps")
def test_any_text_is_read_or_refused(text):
    try:
        reading = read(text)
    except NetemTextError:
        return
    assert reading.profile
    assert json.loads(json.dumps(reading.profile, allow_nan=False)) == reading.profile
