"""`sil check`: what a scenario will run into, said before it runs. Errors stop it, warnings are for a person to weigh.

Arithmetic only, nothing is run: wire and execution time against T_s, what the law admits, what the wheels can give.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise

from protocol.config import MAX_WORDS
from protocol.law_tables import ConfigError, refusal
from protocol.laws import IN_C
from sil import scenario_law as laws
from sil.boards import FIRMWARE, WITHOUT_TIMER
from sil.check_deadlines import deadline
from sil.check_findings import Finding, error, finding, problem_at, warning
from sil.configure import Orders, orders
from sil.instruments import ages_s
from sil.scenario import Scenario, load_scenario
from sil.scenario_errors import ScenarioInvalid, shown
from sil.scenario_events import RESTART
from sil.schedule import read_schedule
from sil.sensors import SENSORS

ENDS_FOR_GOOD = ("process", "inproc", "native")  # boards without a reset of their own
USUAL_TORQUE_Nm = 0.1  # of wheels without a limit
COARSE = 1 / 500  # of the torque limit: what a step of the momentum may look like before it shows in the pointing
READY_AGAIN_S = 0.25  # the Python board takes 0.1 s
TO_REFERENCE = ("rms_error_deg", "peak_error_deg", "residual_error_deg")
ANGLES = ("roll", "pitch", "yaw")


def check_scenario(
    name_or_path: str, sets: Iterable[str] = (), user_table: laws.UserTable = laws.table_of_user_law
) -> list[Finding]:
    """Load and check; a scenario that cannot be loaded is a list of errors, too."""
    try:
        return check(load_scenario(name_or_path, sets, user_table))
    except ScenarioInvalid as invalid:
        return [finding("error", problem) for problem in invalid.problems]


def check(scenario: Scenario) -> list[Finding]:
    """Everything worth saying about a scenario that loads, errors first."""
    checks: list[Callable[[Scenario], Iterator[Finding]]] = [_wheels, _noise, _disturbance]
    if scenario.board == "none":
        checks.insert(0, _schedule)
    else:
        checks = [
            firmware_flies,
            _law,
            _sensors,
            _old_readings,
            _unknown_reference,
            _clock,
            deadline,
            _lateness_limit,
            _restarts,
            _planned_restarts,
            *checks,
            _manoeuvre,
        ]
    found = [one for each in checks for one in each(scenario)]
    return sorted(found, key=lambda one: one.severity != "error")


# -- errors -----------------------------------------------------------------------------------------------------------


def firmware_flies(scenario: Scenario) -> Iterator[Finding]:
    """A board that runs the C firmware has the product's laws in fixed point; an emulated one steps by SAMPLE only."""
    board, url = scenario.board, scenario.link.url
    if board not in FIRMWARE:
        return
    if (law := scenario.law.name) not in IN_C:
        others = "flies yours" if laws.is_user_law(law) else "has the others"
        expected = f"{', '.join(sorted(IN_C))} for board {board}, the laws in C (board process {others})"
        yield error(scenario, "law.name", expected, shown(law))
    elif scenario.law.form != "fixed":
        expected = f"fixed for board {board}, the firmware's arithmetic (board process has both)"
        yield error(scenario, "law.form", expected, scenario.law.form)
    if url == "inproc" or url.startswith("serial:"):
        yield error(scenario, "link.url", f"pty or udp for board {board}, a process of this machine", shown(url))
    if board in WITHOUT_TIMER and scenario.clock.mode != "lockstep":
        expected = f"lockstep for board {board}, which has no timer of its own (board native has one)"
        yield error(scenario, "clock", expected, scenario.clock.mode)


def _law(scenario: Scenario) -> Iterator[Finding]:
    """Can CONFIG be written, and does the law fly with it?"""
    table = scenario.law_table
    try:
        made = orders(scenario)
    except ConfigError as refused:
        yield error(scenario, "law.params", "values that fit the words of CONFIG", str(refused))
        return
    if len(made.words) > MAX_WORDS:
        got = f"{len(made.words)} with {len(made.configuration.rows)} set-points"
        yield error(scenario, "guidance.profile", f"at most {MAX_WORDS} words of CONFIG", got)
    found = [*_law_form(scenario), *_law_period(scenario), *_law_delay(scenario), *_law_momentum(scenario, made)]
    yield from (*found, *_law_torque(scenario))
    reason = refusal(made.configuration)
    if reason is not None and not found:
        yield error(scenario, "law.name", f"a configuration that law {table.name} admits", reason)


def _law_form(scenario: Scenario) -> Iterator[Finding]:
    if scenario.law_table.float_only and scenario.law.form != "float":
        yield error(scenario, "law.form", f"float for law {scenario.law.name}", scenario.law.form)


def _law_period(scenario: Scenario) -> Iterator[Finding]:
    low, high = scenario.law_table.period_s
    if not low <= scenario.period_s <= high:
        expected = f"a number in s from {low:g} to {high:g} for law {scenario.law.name}"
        yield error(scenario, "period_s", expected, shown(scenario.period_s))


def _law_torque(scenario: Scenario) -> Iterator[Finding]:
    """More than a law's registers hold is no torque that it can ask for."""
    most, key = scenario.law_table.fixed_most_Nm, f"actuators.{scenario.actuators.kind}.torque_max_Nm"
    if scenario.law.form == "fixed" and (scenario.actuators.largest_on_the_wire or 0.0) > most:
        expected = f"at most {most:g} N m, all that law {scenario.law.name} can ask for in its fixed form"
        yield warning(scenario, key, expected, f"{scenario.actuators.largest_on_the_wire:.3g} N m")


def _law_momentum(scenario: Scenario, made: Orders) -> Iterator[Finding]:
    """A law that reads in the wheels' momentum what torque acted would read there that thrusters never do anything.

    And of wheels a torque as large as one step of that momentum.
    """
    if not made.configuration.params.get("recover_torque"):
        return
    if scenario.actuators.kind != "wheels":
        expected = f"false with actuators.kind {scenario.actuators.kind}, whose torque does not show in the momentum"
        yield error(scenario, "law.params.recover_torque", expected, "true")
        return
    bits, limits = scenario.wire.momentum_bits, scenario.actuators.wheels.torque_max_Nm
    step_Nm, most_Nm = 2.0**-bits / scenario.period_s, min(limit or USUAL_TORQUE_Nm for limit in limits)
    if step_Nm > COARSE * most_Nm:
        least = bits + math.ceil(math.log2(step_Nm / (COARSE * most_Nm)))
        expected = f"at least {least}: after lost SAMPLEs law {scenario.law.name} takes a step for {step_Nm:.2g} N m"
        yield warning(scenario, "wire.momentum_bits", expected, str(bits))


def _law_delay(scenario: Scenario) -> Iterator[Finding]:
    delays = scenario.law_variant.transport_delays
    if scenario.transport_delay_ticks not in delays:
        expected = f"{' or '.join(map(str, delays))} for law {scenario.law.name}"
        yield error(scenario, "transport_delay_ticks", expected, shown(scenario.transport_delay_ticks))


def _sensors(scenario: Scenario) -> Iterator[Finding]:
    needs = scenario.law_variant.needs
    for bit, name in enumerate(SENSORS):
        if needs >> bit & 1 and not getattr(scenario.sensors, name).enabled:
            yield error(scenario, f"sensors.{name}.enabled", f"true, law {scenario.law.name} reads it", "false")


def _old_readings(scenario: Scenario) -> Iterator[Finding]:
    """A law that knows one delay only takes its readings for those of t_k."""
    knows, sampled = scenario.law_variant.transport_delays, not scenario.sensors.times_of("attitude").instantaneous
    if not (sampled and scenario.sensors.attitude.enabled) or max(knows) > 1:
        return
    mean_s, half_s = ages_s(scenario, "attitude")[0], 0.5 * scenario.period_s
    if mean_s >= half_s:
        own = scenario.sensors.attitude.sampling.delay_s is not None
        key = f"sensors.{'attitude.' if own else ''}sampling.delay_s"
        expected = f"readings less than half a period old ({half_s:g} s), law {scenario.law.name} takes them for fresh"
        yield warning(scenario, key, expected, f"{mean_s:.3g} s on average")


def _unknown_reference(scenario: Scenario) -> Iterator[Finding]:
    """Where a reference starts only the board knows: without TELEMETRY errors are those to the set-point."""
    guidance = scenario.guidance
    if scenario.telemetry_every or (guidance.reference == "none" and guidance.rate_limit_degps is None):
        return
    about = [index for index, line in enumerate(scenario.require) if line.metric.partition(".")[0] in TO_REFERENCE]
    for index in about:
        expected = "a metric that can be known with telemetry_every 0, such as rms_setpoint_error_deg"
        place, key = scenario.where(f"require.{index}.metric"), f"require[{index}].metric"
        yield finding("error", problem_at(place, key, expected, shown(scenario.require[index].metric)))
    if not about:
        expected = "1 or more: without TELEMETRY nobody knows the reference, and errors are those to the set-point"
        yield warning(scenario, "telemetry_every", expected, "0")


def _clock(scenario: Scenario) -> Iterator[Finding]:
    if scenario.transport_delay_ticks == 0 and scenario.clock.mode != "lockstep":
        got = f"{scenario.clock.mode} with transport_delay_ticks 0"
        yield error(scenario, "clock", "lockstep, where the plant waits for the answer", got)
    if scenario.sample_timeout_us >= scenario.period_us:
        expected = f"a number in s below the period ({scenario.period_s:g})"
        yield error(scenario, "sample_timeout_s", expected, shown(scenario.sample_timeout_us * 1e-6))


def _lateness_limit(scenario: Scenario) -> Iterator[Finding]:
    """A tick that is a period late moves the clock and is late, whatever the scenario permits."""
    limit_ms, scale = scenario.timing.max_lateness_ms, scenario.clock_scale
    if limit_ms is not None and scale and limit_ms * 1e-3 > scenario.period_s / scale:
        most = f"at most a period on the wall ({scenario.period_s / scale * 1e3:g} ms), beyond it every tick is late"
        yield warning(scenario, "timing.max_lateness_ms", most, f"{limit_ms:g}")


def _restarts(scenario: Scenario) -> Iterator[Finding]:
    """A board process that is gone stays gone: nothing starts it again, and the run ends with exit code 3."""
    limit, board = scenario.restart_limit, scenario.board
    if limit and board in ENDS_FOR_GOOD and not scenario.link.url.startswith("serial:"):
        expected = "0, or a board that can restart by itself (cortex-m, qemu, serial://PATH, udp://HOST:PORT)"
        yield warning(scenario, "restart_limit", expected, f"{limit} with board {board}")


def _planned_restarts(scenario: Scenario) -> Iterator[Finding]:
    """On a clock the board has so much wall time to be ready again; a slower one costs real misses."""
    scale = scenario.clock_scale
    for index, event in enumerate(scenario.events):
        if event.do == RESTART and event.for_s is not None and scale and event.for_s / scale < READY_AGAIN_S:
            expected = f"at least {READY_AGAIN_S * scale:g} s, {READY_AGAIN_S:g} s on the wall for it to be ready"
            got, place = f"{event.for_s:g} at {scenario.clock.mode}", scenario.where(f"events.{index}.for_s")
            yield finding("warning", problem_at(place, f"events[{index}].for_s", expected, got))


def _schedule(scenario: Scenario) -> Iterator[Finding]:
    file = scenario.file_of("schedule")
    try:
        if file is not None:
            read_schedule(file, scenario.period_s, scenario.ticks)
    except ScenarioInvalid as invalid:
        yield from (finding("error", problem) for problem in invalid.problems)


# -- warnings ---------------------------------------------------------------------------------------------------------


def _wheels(scenario: Scenario) -> Iterator[Finding]:
    wheels = scenario.actuators.wheels
    for axis in range(3 if scenario.actuators.kind == "wheels" else 0):
        speed, inertia, most = (
            wheels.initial_speed_radps[axis],
            wheels.inertia_kgm2[axis],
            wheels.momentum_max_Nms[axis],
        )
        if speed and not inertia:
            expected = "0 without actuators.wheels.inertia_kgm2: it carries no momentum"
            yield warning(scenario, "actuators.wheels.initial_speed_radps", expected, f"{speed:g} rad/s")
        elif most is not None and abs(speed * inertia) > most:
            expected = f"a start within momentum_max_Nms ({most:g})"
            yield warning(scenario, "actuators.wheels.initial_speed_radps", expected, f"{speed * inertia:g} N m s")


def _noise(scenario: Scenario) -> Iterator[Finding]:
    """Noise far below the LSB hardly ever changes a reading."""
    sensors = scenario.sensors
    steps = (
        ("attitude.noise_deg", sensors.attitude.noise_deg, 360.0 / 2 ** (sensors.attitude.bits or 32)),
        (
            "quaternion.noise_deg",
            sensors.quaternion.noise_deg,
            math.degrees(4.0 / 2 ** (sensors.quaternion.bits or 31)),
        ),
        ("rate.noise_degps", sensors.rate.noise_degps, sensors.rate.lsb_degps),
    )
    for key, noise, lsb in steps:
        if 0 < noise < 0.1 * lsb:
            yield warning(scenario, f"sensors.{key}", f"0, or at least a tenth of the LSB ({lsb:.3g})", f"{noise:g}")


def _disturbance(scenario: Scenario) -> Iterator[Finding]:
    """A constant torque fills the wheels; no law can help that."""
    for axis in range(3):
        torque, most = scenario.plant.disturbance_Nm.constant_Nm[axis], scenario.actuators.momentum_max_Nms[axis]
        if most is not None and abs(torque) * scenario.duration_s > most:
            expected = f"less than momentum_max_Nms ({most:g}) over {scenario.duration_s:g} s"
            got = f"{abs(torque) * scenario.duration_s:g} N m s about axis {'xyz'[axis]}"
            yield warning(scenario, "plant.disturbance_Nm.constant_Nm", expected, got)


def _manoeuvre(scenario: Scenario) -> Iterator[Finding]:
    """Largest step through a critically damped reference: peak rate wn * step / e, peak acceleration wn^2 * step."""
    wn, actuators = scenario.guidance.wn_radps, scenario.actuators
    if scenario.guidance.reference == "none":
        if scenario.guidance.accel_limit_degps2 is not None:
            got = f"{scenario.guidance.accel_limit_degps2:g}"
            yield warning(scenario, "guidance.accel_limit_degps2", "null, reference none has no such limit", got)
        return
    if wn * scenario.period_s > 0.5:
        expected = f"at most {0.5 / scenario.period_s:g} rad/s, half a radian per sample"
        yield warning(scenario, "guidance.wn_radps", expected, shown(wn))
    for axis, step_deg in enumerate(_largest_steps_deg(scenario)):
        step, inertia = math.radians(step_deg), scenario.plant.inertia_kgm2[axis][axis]
        torque, most_torque = inertia * wn * wn * step, actuators.chosen.torque_max_Nm[axis]
        momentum, most_momentum = inertia * wn * step / math.e, actuators.momentum_max_Nms[axis]
        if most_torque is not None and torque > most_torque:
            expected = f"at least {torque:.3g} N m for {step_deg:g} deg of {ANGLES[axis]} at wn {wn:g} rad/s"
            yield warning(scenario, f"actuators.{actuators.kind}.torque_max_Nm", expected, shown(most_torque))
        if most_momentum is not None and momentum > most_momentum:
            expected = f"at least {momentum:.3g} N m s for {step_deg:g} deg of {ANGLES[axis]} at wn {wn:g} rad/s"
            yield warning(scenario, "actuators.wheels.momentum_max_Nms", expected, shown(most_momentum))


def _largest_steps_deg(scenario: Scenario) -> list[float]:
    """Largest step of the set-point on each axis; the reference starts at the initial attitude where that is known."""
    start = scenario.plant.initial
    known = start.q is None and start.frame == scenario.attitude.frame
    points = [start.attitude_deg if known else (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
    points += [row.xyz_deg for row in scenario.setpoints()]
    if len(points) > 2 and scenario.setpoints()[0].tick == 0:
        del points[1]
    pairs = list(pairwise(points))
    return [max((abs(after[axis] - before[axis]) for before, after in pairs), default=0.0) for axis in range(3)]
