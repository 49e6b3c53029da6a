"""Basilisk beside our plant and our loop: the same rigid body, orbit, integrator and step, where `bsk` is installed.

Basilisk (https://avslab.github.io/basilisk) integrates the orbit together with the attitude; ours has a circular orbit
in closed form. Free, or in orbit with gravity gradient and a constant external torque, both end at the same attitude
(angle_to says how close). The Python law is a plain PD on the readings of `simpleNav`, without arrays: as little as a
Python module can do. Its torque acts as an external one, so Basilisk has no wheels to integrate, ours has.
"""

from __future__ import annotations

import importlib
import math
import time
from typing import Any

import numpy as np

from sil.bench.series import Unavailable
from sil.plants.rigid import Parameters, Rigid
from sil.rotations import dcm_of_q
from sil.signals import Vector

MASS_KG = 100.0  # moves nothing here: no force but gravity
EARTH = "earth_planet_data"
HOW_TO_GET = "Basilisk is not installed: pip install 'attitude-sil[bench]'"
NS = 1_000_000_000


def part(name: str) -> Any:
    """A module of Basilisk. Raises Unavailable where it is not installed or will not load."""
    try:
        return importlib.import_module(f"Basilisk.{name}")
    except ImportError as error:
        missing = (error.name or "").startswith("Basilisk")
        raise Unavailable(HOW_TO_GET if missing else f"Basilisk does not load: {error}") from None


class Satellite:
    """One simulation in Basilisk: the hub of `parameters` from its initial state, integrated by RK4 in steps of step_s.

    law: gains (K, P) of the Python PD that flies it every period_s with recorders on state and torque, or None.
    """

    def __init__(
        self, parameters: Parameters, step_s: float, law: tuple[float, float] | None = None, period_s: float = 0.5
    ) -> None:
        self._sim = part("utilities.SimulationBaseClass").SimBaseClass()
        self._keep: list[Any] = []  # Basilisk holds bare pointers to these
        process = self._sim.CreateNewProcess("dynamics")
        process.addTask(self._sim.CreateNewTask("step", round(step_s * NS)))
        self._body = self._hub(parameters)
        if parameters.gravity_gradient:
            self._orbit(parameters)
        torque = part("simulation.extForceTorque").ExtForceTorque()
        torque.ModelTag = "torque"
        torque.extTorquePntB_B = _column(parameters.disturbance_Nm)
        self._body.addDynamicEffector(torque)
        self._add("step", torque)
        if law is not None:
            process.addTask(self._sim.CreateNewTask("law", round(period_s * NS)))
            self._fly(law, torque, period_s)
        self._sim.InitializeSimulation()

    def run(self, duration_s: float) -> float:
        """Seconds of wall time for the simulation alone."""
        self._sim.ConfigureStopTime(round(duration_s * NS))
        began = time.perf_counter()
        self._sim.ExecuteSimulation()
        return time.perf_counter() - began

    def angle_to(self, q_BN: Vector) -> float:
        """Degrees between the attitude now and `q_BN` (4,)."""
        sigma = np.array(self._body.scStateOutMsg.read().sigma_BN)
        C_theirs, C_BN = part("utilities.RigidBodyKinematics").MRP2C(sigma), np.empty((3, 3))
        dcm_of_q(q_BN, C_BN)
        return math.degrees(2.0 * math.asin(min(1.0, float(np.linalg.norm(C_theirs - C_BN)) / math.sqrt(8.0))))

    def _hub(self, parameters: Parameters) -> Any:
        state = Rigid(parameters).state
        body = part("simulation.spacecraft").Spacecraft()
        body.ModelTag = "satellite"
        body.hub.mHub = MASS_KG
        body.hub.IHubPntBc_B = parameters.inertia_kgm2.tolist()
        body.hub.sigma_BNInit = _column(part("utilities.RigidBodyKinematics").EP2MRP(state[:4]))
        body.hub.omega_BN_BInit = _column(state[4:7])
        integrator = part("simulation.svIntegrators").svIntegratorRK4(body)
        body.setIntegrator(integrator)
        self._keep.append(integrator)
        self._add("step", body)
        return body

    def _orbit(self, p: Parameters) -> None:
        earth = part("simulation.gravityEffector").GravBodyData()
        earth.planetName, earth.mu, earth.isCentralBody = EARTH, p.mu, True
        self._keep.append(earth)
        self._body.gravField.gravBodies = part("simulation.spacecraft").GravBodyVector([earth])
        tilt, u = math.radians(p.inclination_deg), math.radians(p.u0_deg)
        along = np.array([-math.sin(u), math.cos(u) * math.cos(tilt), math.cos(u) * math.sin(tilt)])
        up = np.array([math.cos(u), math.sin(u) * math.cos(tilt), math.sin(u) * math.sin(tilt)])
        self._body.hub.r_CN_NInit = _column(p.orbit_radius_m * up)
        self._body.hub.v_CN_NInit = _column(p.orbit_radius_m * p.orbit_rate_radps * along)
        gradient = part("simulation.GravityGradientEffector").GravityGradientEffector()
        gradient.ModelTag = "gradient"
        gradient.addPlanetName(EARTH)
        self._body.addDynamicEffector(gradient)
        self._add("step", gradient)

    def _fly(self, gains: tuple[float, float], torque: Any, period_s: float) -> None:
        sensor = part("simulation.simpleNav").SimpleNav()
        sensor.ModelTag = "sensor"
        sensor.scStateInMsg.subscribeTo(self._body.scStateOutMsg)
        law = _python_law(*gains)
        law.reading.subscribeTo(sensor.attOutMsg)
        torque.cmdTorqueInMsg.subscribeTo(law.torque)
        self._add("law", sensor)
        self._add("law", law)
        for message in (self._body.scStateOutMsg, law.torque):
            self._add("law", message.recorder(round(period_s * NS)))

    def _add(self, task: str, model: Any) -> None:
        self._sim.AddModelToTask(task, model)
        self._keep.append(model)


def _python_law(K: float, P: float) -> Any:
    """A Python module of Basilisk: torque = -K sigma_BN - P omega_BN_B."""
    messaging = part("architecture.messaging")

    class PythonPd(part("architecture.sysModel").SysModel):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__()
            self.ModelTag = "law"
            self.reading = messaging.NavAttMsgReader()
            self.torque = messaging.CmdTorqueBodyMsg()

        def Reset(self, now_ns: int) -> None:
            """Nothing to forget."""

        def UpdateState(self, now_ns: int) -> None:
            reading = self.reading()
            pairs = zip(reading.sigma_BN, reading.omega_BN_B, strict=True)
            payload = messaging.CmdTorqueBodyMsgPayload()
            payload.torqueRequestBody = [-K * sigma - P * omega for sigma, omega in pairs]
            self.torque.write(payload, now_ns, self.moduleID)

    return PythonPd()


def _column(values: Vector) -> list[list[float]]:
    return [[float(value)] for value in values]
