"""What turns a command into a torque on the body: one file each, one line here."""

ACTUATORS: dict[str, str] = {
    "thrusters": "sil.actuators.thrusters:Thrusters",
    "wheels": "sil.actuators.wheels:Wheels",
}
