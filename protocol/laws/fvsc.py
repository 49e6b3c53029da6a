"""Words of the laws fvsc, vsc, ifvsc: fuzzy variable structure, the same without its fuzzy part, with an integral."""

from __future__ import annotations

from protocol.law_words import AUTOMATIC, ERROR_QUATERNION, READ_EULER, READ_RATE, LawTable, array, error_word, vector
from protocol.words import Word

RATE_SENSED, RATE_DIFFERENCE = 0, 1
INFERENCE_CLOSED, INFERENCE_TABLE = 0, 1
ENTRIES = 65
DEFAULT_TABLE = tuple(a * a * (3 - a) / (3 * (2 - a * a)) for a in (i / (ENTRIES - 1) for i in range(ENTRIES)))
_INERTIA = (2.13, 3.04, 3.09)  # so that a volt is one rad/s^2


def _switching(Ks: float, unit: str, Kr: float, m: float) -> tuple[Word, ...]:
    """The words of all three, with the gains of study 000, section 5, as defaults."""
    return (
        Word("ka_bits", "", 0, 10, 45, AUTOMATIC, "fractional bits of ka"),
        error_word(ERROR_QUATERNION),
        Word("rate_in_S", "", 0, 0, 1, RATE_SENSED, "rate in the switching function: sensor, or change of the error",
             ("sensed", "difference")),
        *vector("ka", "N m/V", "ka_bits", 0, 1e6, _INERTIA, "actuator gain"),
        Word("Ks", unit, 20, 0, 2000, Ks, "switching gain"),
        Word("Kr", "V s/rad", 20, 0, 2000, Kr, "damping, on the sensed rate"),
        Word("m", "1/s", 24, 0, 100, m, "slope of the switching line m e + w = 0"),
    )  # fmt: skip


_FUZZY = (
    Word("inference", "", 0, 0, 1, INFERENCE_CLOSED, "f by its closed form, or by f_table", ("closed", "table")),
    Word("E", "rad", 28, 2.0**-9, 3.2, 0.571, "peak of the outer input sets: |f| is largest from here on"),
    Word("L", "", 20, 2.0**-10, 1, 1, "peak of the outer output sets, in switching gains"),
    *array("f_table", "", 15, -1, 1, (ENTRIES,), "-f(e)/L at 65 errors from 0 to E", DEFAULT_TABLE),
)
_INTEGRAL = (
    Word("Ki", "V/(rad s)", 20, 0, 2000, 0.005, "gain of the integral of the error"),
    Word("integral_limit", "rad s", 20, 0, 2000, 10, "limit of the integral"),
)
_TELEMETRY = (
    *vector("error", "rad", 29, -4, 3.999, (0, 0, 0), "e: measured minus reference"),
    *vector("switching", "V", 20, -2048, 2048 - 2.0**-20, (0, 0, 0), "Ks sgn(S) f(e)"),
    *vector("sign", "", 0, -1, 1, (0, 0, 0), "sgn(S)"),
)


def _table(law_id: int, name: str, params: tuple[Word, ...], telemetry: tuple[Word, ...] = ()) -> LawTable:
    return LawTable(
        law_id=law_id,
        version=1,
        name=name,
        params=params,
        telemetry=_TELEMETRY + telemetry,
        transport_delays=(0, 1, 2, 3, 4),
        period_s=(0.001, 10.0),
        reference_leads=(2, 1),
        needs=READ_EULER | READ_RATE,
        has_model=False,
        arrays={"f_table": ("entries",)} if name != "vsc" else {},
        sizes={"entries": ENTRIES} if name != "vsc" else {},
    )


FVSC = _table(4, "fvsc", _switching(0.9, "V", 0.37, 0.25) + _FUZZY)
VSC = _table(5, "vsc", _switching(0.232, "V/rad", 0.366, 0.352))
IFVSC = _table(
    6,
    "ifvsc",
    _switching(0.9, "V", 0.37, 0.25) + _FUZZY + _INTEGRAL,
    vector("integral", "rad s", 20, -2000, 2000, (0, 0, 0), "integral of e"),
)
