"""The colours of the live view: of 256, so that they are the same whatever theme a terminal has.

Each has a contrast of about 3 or more to black and to white; roll, pitch, yaw are those of plots and of the 3D scene.
"""

AXES = ("roll", "pitch", "yaw")
TONES = ("color(166)", "color(29)", "color(32)")  # #d75f00, #00875f, #0087d7
GOOD = "color(29)"
WARN = "bold color(136)"
BAD = "bold color(160)"
TITLE = "color(32)"
DIM = "dim"
