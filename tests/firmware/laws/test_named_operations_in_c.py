"""The laws in C use the named operations of fixed.h; and the script that says so finds what it is there to find."""

from __future__ import annotations

from pathlib import Path

import pytest

from protocol.laws import IN_C
from tools.c_states import SHARED
from tools.check_c_operations import CORE, law_files, main, violations


def test_no_raw_operation_on_law_values(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0, capsys.readouterr().out


def test_all_that_a_law_is_made_of_is_looked_at() -> None:
    """By default a file is looked at; those that are not have no law in them."""
    names = {path.stem for path in law_files()}
    support = {"attitude_error", "fuzzy", "reference", "kinematics", "gain", "gyroscopic", "rls", "laws"}
    assert names >= support | set(IN_C) - set(SHARED)
    for path in CORE.glob("*.c"):
        if path.stem not in names | {"fixed"}:
            assert '"fixed.h"' not in path.read_text(), f"{path.name} computes like a law but is not looked at"


PLANTED = {
    "int64_t y = s->y[i] * 2;": "*",
    "x = a / b;": "/",
    "x = f(a) % 3;": "%",
    "x = s->y[0] >> 4;": ">>",
    "x = (a + b) << 1;": "<<",
    "x *= gain;": "*=",
    "x >>= n;": ">>=",
    "x /= 2;": "/=",
    "x = y & 7;": "&",
    "x = y ^ 1;": "^",
    "x = ~y;": "~",
    "x = s->F[5 * m + n] * s->phi[n];": "*",
    "x = sizeof(int) * y;": "*",
    "return 2 * x;": "*",
    "x = (int32_t)y * 3;": "*",
    "#define TWICE(x) ((x) * 2)": "*",
    "x = /* a * b */ a\n    * b;": "*",
    "x = 0.5;": "0.5",
    "double x = 1;": "double",
    "#include <math.h>": "<math.h>",
}
ALLOWED = [
    "s->F[25 * i + 6 * m] = params[MRAC_F0];",
    "const int32_t *p = &s->theta[5 * i];",
    "static void f(const law_input *in, reference *ref, struct law_input *other, void *memory);",
    "*flag = 1;",
    "return &x;",
    "size_t n = sizeof(a * b);",
    "x = 3 << 30;",
    "/* a * b / c */ x = y; // a * b",
    'const char *text = "a * b";',
    "if (a && b || !c) { x = -y + z; }",
    "static const law *const LAWS[2] = {&PD_LAW, &MRAC_LAW};",
    "x = 0x1E5 + 1000000;",
    "i++;",
    "typedef int32_t (*function)(const rls *self);",
]


@pytest.mark.parametrize("source", PLANTED)
def test_a_planted_violation_is_found(source: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = source.count("\n") + 2
    file = tmp_path / "planted.c"
    file.write_text("int32_t x;\n" + source + "\n")
    assert main([str(file)]) == 1
    (found,) = capsys.readouterr().out.splitlines()
    assert found.startswith(f"{file}:{line}: ") and found.endswith(PLANTED[source])


@pytest.mark.parametrize("source", ALLOWED)
def test_what_is_no_law_value_is_left_alone(source: str) -> None:
    assert violations(source + "\n") == []


@pytest.mark.parametrize(
    ("file", "before", "after"),
    [
        ("pd.c", "mul_q(par->kp[i], error, par->kp_shift)", "(par->kp[i] * error >> par->kp_shift)"),
        ("rls.c", "mul_q(self->F[5 * m + n], self->phi[n], 8)", "self->F[5 * m + n] * self->phi[n] / 256"),
        ("kinematics.c", "mul_q(v[2], ct, 30)", "((int64_t)v[2] * ct >> 30)"),
        ("reference.c", "shift_round(accel, 1)", "accel / 2"),
    ],
)
def test_a_violation_in_a_law_is_found(file: str, before: str, after: str) -> None:
    text = (CORE / file).read_text()
    assert before in text
    assert violations(text) == [] and violations(text.replace(before, after)) != []
