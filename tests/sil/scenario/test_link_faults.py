"""Section link.faults: what it means for the channel, and every contradiction in one line with its key and line."""

from __future__ import annotations

from pathlib import Path

import pytest

from protocol.channel import Clear
from protocol.faulty import Burst, Faults, Faulty, Jitter
from sil.checks import check_scenario
from sil.rig import channel_of
from sil.scenario import load_scenario, load_values

# name: (lines below `link:`, key below link, line of the file, expected, got), the last two as parts of the text
BROKEN = {
    "a probability above 1": ("faults: {drop: 1.5}", "faults.drop", 3, "a probability from 0 to 1", "1.5"),
    "a negative probability": ("faults: {up: {byte_loss: -0.1}}", "faults.up.byte_loss", 3, "a probability", "-0.1"),
    "a probability in words": ("faults: {duplicate: often}", "faults.duplicate", 3, "a probability", "'often'"),
    "a misspelt fault": ("faults: {dorp: 0.1}", "faults.dorp", 3, "did you mean drop?", "unknown key"),
    "a negative delay": ("faults: {delay_s: -1}", "faults.delay_s", 3, "a number in s not below 0", "-1"),
    "half a burst": ("faults: {burst: {p_bad: 0.1}}", "faults.burst", 3, "share and mean_ticks", "p_bad"),
    "two bursts in one": (
        "faults: {burst: {p_bad: 0.1, p_good: 0.1, share: 0.1}}", "faults.burst", 3, "p_bad and p_good, or", "share",
    ),
    "bursts that cannot be so short": (
        "faults: {down: {burst: {share: 0.9, mean_ticks: 2}}}", "faults.down.burst.share", 3, "at most 0.6667", "0.9",
    ),
    "better in the bad state": (
        "faults: {burst: {p_bad: 0.1, p_good: 0.1, loss_bad: 0.1, loss_good: 0.2}}",
        "faults.burst.loss_good", 3, "at most loss_bad (0.1)", "0.2",
    ),
    "an unknown distribution": (
        "faults: {jitter: {distribution: gauss, max_s: 0.1}}",
        "faults.jitter.distribution", 3, "one of uniform, normal, exponential", "'gauss'",
    ),
    "a distribution without its number": (
        "faults: {jitter: {distribution: exponential, max_s: 0.1}}", "faults.jitter.mean_s", 3, "a number in s", "null",
    ),
    "a number of another distribution": (
        "faults: {jitter: {max_s: 0.1, mean_s: 0.05}}", "faults.jitter.mean_s", 3, "none for uniform", "0.05",
    ),
    "overtaking on a byte stream": ("faults: {reorder: 0.1}", "faults.reorder", 3, "0 on a byte stream", "0.1"),
    "jitter that overtakes on a byte stream": (
        "faults: {jitter: {max_s: 0.6}}", "faults.jitter.max_s", 3, "below the period (0.5)", "0.6",
    ),
    "longer than anybody waits": ("faults: {delay_s: 51}", "faults.delay_s", 3, "at most 100 periods (50)", "51"),
    "a disconnection that ends first": (
        "faults: {disconnect: [[20, 10]]}", "faults.disconnect[0]", 3, "the earlier first", "[20.0, 10.0]",
    ),
    "a disconnection beyond the end": (
        "faults: {disconnect: [[590, 610]]}", "faults.disconnect[0]", 3, "within the run (600 s)", "[590.0, 610.0]",
    ),
    "disconnections out of order": (
        "faults: {disconnect: [[50, 60], [40, 45]]}", "faults.disconnect[1]", 3, "not before 60 s", "[40.0, 45.0]",
    ),
    "no list of spans": (
        "faults: {disconnect: [10, 20]}", "faults.disconnect", 3, "a list of [from_s, to_s]", "[10, 20]",
    ),
    "no time for the frames": (
        "faults: {delay_s: 0.2}", "faults.delay_s", 3, "SAMPLE within sample_timeout_s (0.1 s)", "every one is late",
    ),
    "no time for the answers": (
        "faults: {down: {delay_s: 0.6}}", "faults.down.delay_s", 3, "COMMAND within 1 x 0.5 s", "600 ms",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_each_is_one_line_with_key_and_line(tmp_path: Path, name: str) -> None:
    lines, key, line, expected, got = BROKEN[name]
    file = tmp_path / "broken.yaml"
    file.write_text(f"seed: 1\nlink:\n  {lines}\n")
    (found,) = [each for each in check_scenario(str(file)) if each.severity == "error"]
    assert (found.key, found.line) == (f"link.{key}", line)
    assert expected in found.expected
    assert got in found.got
    assert "\n" not in str(found)


def test_no_board_no_link_to_be_faulty() -> None:
    found = check_scenario("rigid-open-loop", ["link.faults.drop=0.1"])
    assert any("no link faults with board none" in str(each) for each in found)


@pytest.mark.parametrize("url", ["udp", "inproc", "udp://127.0.0.1:5005"])
def test_datagrams_may_overtake(url: str) -> None:
    faults = {"reorder": 0.1, "jitter": {"max_s": 3.0}}
    assert load_values({"link": {"url": url, "faults": faults}}).link.models()[0].reorder == 0.1


def test_some_late_frames_are_a_warning() -> None:
    (found,) = check_scenario("appc-rs232", ["link.faults.up.jitter={max_s: 0.2}"])
    assert (found.severity, found.key) == ("warning", "link.faults.up.jitter")


def test_expect_missed_admits_frames_that_are_always_late() -> None:
    assert check_scenario("appc-rs232", ["link.faults.delay_s=0.2", "expect_missed=true"]) == []


def test_one_direction_overrides_both_key_by_key() -> None:
    link = load_values({
        "link": {
            "baud": 9600,
            "faults": {
                "drop": 0.2,
                "delay_s": 0.01,
                "burst": {"share": 0.1, "mean_ticks": 5},
                "disconnect": [[1, 2], [3.5, 4]],
                "up": {"drop": 0, "jitter": {"distribution": "normal", "max_s": 0.1, "mean_s": 0.05, "sigma_s": 0.01}},
                "down": {"baud": 115200, "bit_error_rate": 1e-5, "delay_s": 0.02},
            },
        }
    }).link  # fmt: skip
    burst = Burst(pytest.approx(0.2 / 9), 0.2)  # type: ignore[arg-type]
    spans = ((10**9, 2 * 10**9), (3_500_000_000, 4 * 10**9))
    up, down = link.models()
    jitter = Jitter("normal", 10**8, 5 * 10**7, 10**7)
    assert up == Faults(burst=burst, delay_ns=10**7, jitter=jitter, disconnect_ns=spans, baud=9600)
    assert down == Faults(
        drop=0.2, burst=burst, bit_error_rate=1e-5, delay_ns=2 * 10**7, disconnect_ns=spans, baud=115200
    )


def test_a_scenario_without_faults_has_the_clear_channel() -> None:
    assert isinstance(channel_of(load_scenario("appc-rs232")), Clear)
    assert isinstance(channel_of(load_scenario("appc-rs232", ["link.faults.drop=0"])), Faulty)


def test_faults_load_again_from_what_the_log_keeps() -> None:
    first = load_scenario("appc-rs232", ["link.faults.burst={share: 0.1, mean_ticks: 5}", "link.faults.up.drop=0.1"])
    kept = first.identity()
    assert set(kept["link"]) == {"faults"}
    again = load_values({**kept, "link": {**kept["link"], "url": "udp"}})
    assert again.link.faults == first.link.faults
