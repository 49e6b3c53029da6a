"""The satellites: one file each, one line here."""

PLANTS: dict[str, str] = {
    "rigid": "sil.plants.rigid:Rigid",
}
