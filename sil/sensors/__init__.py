"""The instruments: truth in, integers in wire units out. One file each, one line here."""

SENSORS: dict[str, str] = {
    "attitude": "sil.sensors.attitude:Attitude",
    "quaternion": "sil.sensors.quaternion:Quaternion",
    "rate": "sil.sensors.rate:Rate",
}
SUPPORT = ("sampled",)  # what goes around them
