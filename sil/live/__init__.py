"""The live view: a process that reads a run's journal as it grows and shows it to viewers over a Foxglove WebSocket.

A process of its own, never imported by the laboratory (sil/live_view.py starts it). The laboratory does nothing for it:
the journal is written anyway, one write per tick, and whoever reads it can neither slow nor stop who writes it.
"""
