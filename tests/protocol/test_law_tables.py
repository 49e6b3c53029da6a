"""CONFIG words: numbers to words and back, errors that name key, range and unit, and what makes two ends agree."""

from __future__ import annotations

import contextlib
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.law_tables import (
    COMMON,
    LAWS,
    NO_LIMIT,
    TELEMETRY_COMMON,
    ConfigError,
    LawTable,
    config_words,
    dequantise,
    law_by_name,
    lsb_of,
    parse_configuration,
    quantise,
    refusal,
    table_hash,
    user_table,
    variant_of,
)
from protocol.laws.appc import APPC
from protocol.laws.mrac import MRAC
from protocol.laws.pd import PD

TABLES = list(LAWS.values())
tables = pytest.mark.parametrize("table", TABLES, ids=lambda table: table.name)


@tables
def test_defaults_make_a_configuration_that_flies(table: LawTable) -> None:
    configuration = parse_configuration(config_words(table, {}))
    assert refusal(configuration) is None
    assert configuration.table is table and configuration.rows == ()
    assert list(configuration.common) == [word.name for word in COMMON]
    assert list(configuration.params) == [word.name for word in table.params]


@tables
def test_words_and_values_agree_within_half_an_lsb(table: LawTable) -> None:
    configuration = parse_configuration(config_words(table, {}))
    words = configuration.common | configuration.params
    for word in table.params:
        if word.default >= 0:
            assert abs(configuration.values[word.name] - word.default) <= lsb_of(word, words) / 2


def test_rows_follow_the_parameters() -> None:
    rows = ((0, 1, -2, 3), (120, 2**31 - 1, -(2**31), 0))
    words = config_words(APPC, {}, rows)
    assert words[-8:] == (0, 1, -2, 3, 120, 2**31 - 1, -(2**31), 0)
    assert parse_configuration(words).rows == rows


@given(st.lists(st.floats(-1e5, 1e5).filter(lambda x: abs(x) > 1e-9), min_size=3, max_size=3))
def test_gains_get_all_the_bits_there_are(kp: list[float]) -> None:
    configuration = parse_configuration(config_words(PD, {"kp": kp}))
    peak = max(abs(configuration.params[f"kp_{axis}"]) for axis in "xyz")
    assert peak >= 2**30 - 1 or configuration.params["kp_bits"] == 45
    for mine, given_ in zip(configuration.vector("kp"), kp, strict=True):
        assert mine == pytest.approx(given_, abs=2.0 ** -configuration.params["kp_bits"])


def test_a_choice_by_name_and_its_defaults() -> None:
    printed = parse_configuration(config_words(MRAC, {"design": "printed"}))
    assert printed.params["design"] == 0 and printed.common["reference_lead"] == 1
    assert printed.values["c2_pole"] == pytest.approx(0.001, abs=1e-9)
    repaired = parse_configuration(config_words(MRAC, {}))
    assert repaired.common["reference_lead"] == 2 and repaired.values["c2_pole"] == pytest.approx(0.8)
    assert parse_configuration(config_words(MRAC, {"design": "printed", "c2_pole": 0.5})).values["c2_pole"] == 0.5


def test_the_ends_of_a_range_survive_their_rounding_and_zero_does_not_become_one() -> None:
    assert parse_configuration(config_words(APPC, {"inertia_kgm2": 0.05})).values["inertia_kgm2_x"] < 0.05
    with pytest.raises(ConfigError, match=r"inertia_kgm2_x: expected 1e-06 to 1e\+06 kg m\^2, got 0"):
        parse_configuration(config_words(law_by_name("predictor"), {"inertia_bits": 0, "inertia_kgm2": 0.4}))


def test_no_limit() -> None:
    configuration = parse_configuration(config_words(PD, {"torque_limit": (0.1, math.inf, 0.1)}))
    assert configuration.common["torque_limit_y"] == NO_LIMIT and configuration.values["torque_limit_y"] == math.inf
    assert configuration.common["torque_limit_x"] == round(0.1 * 2**30)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"c2_pole": 1.5}, r"c2_pole: expected 0 to 0.999, got 1.5"),
        ({"inertia_kgm2": 100.0}, r"inertia_kgm2_x: expected 0.05 to 30 kg m\^2, got 100.0"),
        ({"inertia_kgm2": (1.0, 2.0)}, r"inertia_kgm2: expected 3 numbers, got \(1.0, 2.0\)"),
        ({"design": "best"}, r"design: expected one of printed, repaired, got 'best'"),
        ({"gyro": 1}, r"law.params.gyro: unknown for law mrac; known: F0, c2_pole, decouple"),
        ({"kappa": (1.0, 2.0, 3.0)}, r"kappa: expected one number"),
        ({"torque_limit": 5.0}, r"torque_limit_x: 5.0 N m does not fit 32 bits"),
    ],
)
def test_bad_values_are_said_in_one_line(values: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        config_words(MRAC, values)


def test_unknown_law_lists_the_known() -> None:
    known = ", ".join(sorted(table.name for table in LAWS.values()))
    with pytest.raises(ConfigError, match=f"expected one of {known}, got 'lqr'"):
        law_by_name("lqr")


def test_bad_words_carry_their_index() -> None:
    words = list(config_words(APPC, {}))
    index = [word.name for word in (*COMMON, *APPC.params)].index("observer_pole")
    words[index] = -5
    with pytest.raises(ConfigError, match="observer_pole") as error:
        parse_configuration(words)
    assert (error.value.status, error.value.index) == (1, index)
    with pytest.raises(ConfigError) as error:
        parse_configuration([99, *words[1:]])
    assert (error.value.status, error.value.index) == (2, 0)
    for cut in (words[:-1], words[:5], [], [*words, 0]):
        with pytest.raises(ConfigError) as error:
            parse_configuration(cut)
        assert error.value.status == 4


def test_rows_must_come_in_order() -> None:
    with pytest.raises(ConfigError, match="guidance row 1"):
        parse_configuration(config_words(PD, {}, ((5, 0, 0, 0), (5, 0, 0, 0))))


@given(st.lists(st.integers(-(2**31), 2**31 - 1), max_size=80))
def test_any_words_are_understood_or_refused(words: list[int]) -> None:
    for start in ([], list(config_words(MRAC, {}))[:24]):
        with contextlib.suppress(ConfigError):
            parse_configuration(start + words)


def test_the_hash_tells_values_and_meanings_apart() -> None:
    words = config_words(APPC, {})
    assert table_hash(APPC, words) == parse_configuration(words).hash
    assert table_hash(APPC, words) != table_hash(APPC, (*words[:-1], words[-1] + 1))
    other = APPC._replace(params=(APPC.params[0]._replace(q=29), *APPC.params[1:]))
    assert table_hash(APPC, words) != table_hash(other, words)


def test_a_users_law() -> None:
    table = user_table("MyPd", {"kp": (0.02, "N m/rad", 1e-6)})
    words = config_words(table, {"kp": 0.0300004})
    assert words[-1] == 30000
    assert parse_configuration(words, table).values["kp"] == pytest.approx(0.03)
    with pytest.raises(ConfigError, match="law id 65535"):
        parse_configuration(words)


@tables
def test_words_are_well_formed(table: LawTable) -> None:
    assert table.period_s[0] < table.period_s[1] and table.transport_delays and table.reference_leads
    names = [word.name for word in (*COMMON, *table.params)]
    assert len(set(names)) == len(names)
    telemetry = [word.name for word in (*TELEMETRY_COMMON, *table.telemetry)]
    assert len(set(telemetry)) == len(telemetry)
    for word in (*COMMON, *table.params):
        assert word.about and word.minimum < word.maximum
        assert word.default == -1.0 or word.minimum <= word.default <= word.maximum
        if isinstance(word.q, int) and math.isfinite(word.maximum):
            for edge in (word.minimum, word.maximum):
                assert dequantise(word, quantise(word, edge, {}), {}) == pytest.approx(edge, abs=2.0**-word.q)


@tables
def test_readings_are_those_of_the_design(table: LawTable) -> None:
    assert variant_of(table, {}).needs == table.needs
    for value, variant in enumerate(table.variants):
        configuration = parse_configuration(config_words(table, {table.variant_word: value}))
        assert configuration.common["readings_mask"] == variant.needs


@pytest.mark.parametrize(
    ("table", "values", "says"),
    [
        (APPC, {}, "law appc: expected attitude_sequence 321, got 123"),
        (MRAC, {"decouple": 1}, "law mrac with decouple: expected attitude_sequence 321, got 123"),
        (MRAC, {}, None),
        (PD, {}, None),
    ],
)
def test_a_law_for_321_refuses_123(table: LawTable, values: dict[str, float], says: str | None) -> None:
    """Its kinematics would be those of other angles, and nothing else would show it."""
    assert refusal(parse_configuration(config_words(table, {**values, "attitude_sequence": "123"}))) == says
    assert refusal(parse_configuration(config_words(table, {**values, "attitude_sequence": "321"}))) is None
